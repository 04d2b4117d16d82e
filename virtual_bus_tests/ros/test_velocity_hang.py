"""velocity_mux and safety_filter that hang and go on: silence meanwhile, and nothing of what waited is obeyed after."""

from __future__ import annotations

import pytest
from canbase.msg import SafetyState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from support.velocity_chain import Chain, drive

pytestmark = pytest.mark.ros


@pytest.fixture
def chain(module_chain: Chain) -> Chain:
    module_chain.rest()
    return module_chain


def test_a_process_that_hangs_is_silent_and_a_command_that_waited_meanwhile_moves_nothing_after(chain: Chain) -> None:
    chain.joystick.message = drive(0.0)
    chain.node.spin_for(0.3)
    chain.process.stop()
    chain.joystick.message = drive(0.3)
    chain.node.spin_for(0.2)
    chain.orders.clear()
    chain.leases.clear()
    chain.node.spin_for(0.8)
    assert (chain.orders.messages, chain.leases) == ([], [])
    chain.joystick.message = None  # its last 50 commands wait in the sockets of the process, the newest in its queue
    chain.node.spin_for(0.5)
    chain.orders.clear()
    chain.process.resume()
    chain.node.spin_for(1.0)
    assert len(chain.orders.messages) > 20
    assert {message.twist.linear.x for message in chain.orders.messages} == {0.0}
    chain.joystick.message = drive(0.2)  # the stick was held while the process stood still
    chain.node.spin_for(0.5)
    assert chain.ordered == (0.0, 0.0)
    chain.node.release(chain.joystick)
    chain.joystick.message = drive(0.2)
    chain.wait_for_order(0.2)


# pressed, released ── the process stands still ── a reset is sent; its caller gives up ── it goes on
def test_a_reset_of_the_emergency_stop_that_waited_meanwhile_is_refused(chain: Chain) -> None:
    chain.estop.message = Bool(data=True)
    chain.wait_for_cause(SafetyState.CAUSE_ESTOP)
    chain.estop.message = Bool(data=False)
    chain.node.spin_for(0.3)
    client = chain.node.node.create_client(Trigger, "safety_filter/reset")
    assert client.wait_for_service(5.0)
    chain.process.stop()
    old = client.call_async(Trigger.Request())
    chain.node.spin_for(1.5)
    chain.process.resume()
    chain.node.wait_for(old.done, 5.0, "the answer to the old reset")
    assert not old.result().success
    assert "it may be old" in old.result().message
    chain.node.spin_for(1.0)
    assert chain.state.last is not None
    assert chain.state.last.cause == SafetyState.CAUSE_ESTOP
    new = client.call_async(Trigger.Request())
    chain.node.wait_for(new.done, 5.0, "the answer to the new reset")
    assert new.result().success
    chain.wait_for_cause(SafetyState.CAUSE_NONE)
