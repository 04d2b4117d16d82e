"""velocity_mux and safety_filter that hang and go on: silence meanwhile, and nothing of what waited is obeyed after."""

from __future__ import annotations

import pytest

from ros.velocity_chain import Chain, drive

pytestmark = pytest.mark.ros


def test_a_process_that_hangs_falls_silent_on_cmd_vel_and_at_the_watchdog(chain: Chain) -> None:
    chain.action.message = drive(0.2)
    chain.wait_for_order(0.2)
    chain.process.stop()
    chain.node.spin_for(0.2)
    chain.drain()
    chain.leases.clear()
    chain.orders.clear()
    chain.node.spin_for(0.5)
    assert chain.orders.messages == []
    assert chain.leases == []


def test_a_command_that_waited_meanwhile_moves_nothing_after(chain: Chain) -> None:
    chain.joystick.message = drive(0.0)
    chain.node.spin_for(0.3)
    chain.process.stop()
    chain.joystick.message = drive(0.3)
    chain.node.spin_for(1.0)
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
