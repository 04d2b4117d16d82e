"""NMT commands of a person: what they do to motors, and whether the nodes obeyed."""

from __future__ import annotations

import pytest

from canbase_commissioning.bus_monitor import HeardNode, Listener
from canbase_commissioning.nmt_command import EFFECTS, NodePower, Order, outcome, power_of
from canbase_commissioning.nmt_session import NmtSession
from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.sdo_session import SdoSession
from canbase_driver.cia301.nmt import NmtState, nmt
from canbase_driver.cia301.sdo_client import SdoClient
from canbase_sim.cia301.nmt import NmtState as SimState
from support.session_world import SessionWorld

STATUS = (Address(0x6041), Address(0x6841))


def power(world: SessionWorld, node: int = 1) -> NodePower:
    session = SdoSession({node: power_of(node, STATUS)}, Listener(0.0), lambda node_id: SdoClient(node_id, 0.1, 2))
    world.run(session)
    result = session.tasks[node].result
    assert result is not None
    return result


def enable(world: SessionWorld) -> None:
    dictionary = world.bench.nodes[1].dictionary
    dictionary.set_data(0x6060, 0, b"\x03")
    for word in (6, 7, 15):
        dictionary.set_data(0x6040, 0, bytes((word, 0)))
        world.wait(0.05)


def test_a_drive_without_power_needs_nobody_s_consent() -> None:
    found = power(SessionWorld())
    assert str(found) == "node 1: 6041h:0 switch on disabled; no power"
    assert not found.needs_a_person


@pytest.mark.parametrize(
    ("option", "text"),
    [
        (0, "6007h is 0: the motor goes on as before"),
        (3, "6007h is 3: quick stop"),
        (-2, "6007h is 65534, which the maker defines"),
    ],
)
def test_a_motor_with_power_is_named_with_what_stops_it(option: int, text: str) -> None:
    world = SessionWorld()
    enable(world)
    world.bench.nodes[1].dictionary.values[0x600700] = option
    found = power(world)
    assert found.needs_a_person
    assert str(found) == f"node 1: 6041h:0 operation enabled; HAS POWER; {text}"


def test_a_node_that_does_not_answer_may_have_power() -> None:
    found = power(SessionWorld(), node=9)
    assert found.needs_a_person
    assert "unknown: it does not answer SDO" in str(found)


def test_every_command_has_its_effect_and_the_simulated_drive_obeys() -> None:
    assert set(EFFECTS) == set(Order)
    world = SessionWorld()
    world.bench.nodes[1].dictionary.values[0x101700] = 50
    for order, state in (
        (Order.START, SimState.OPERATIONAL), (Order.PREOP, SimState.PRE_OPERATIONAL), (Order.STOP, SimState.STOPPED),
    ):  # fmt: skip
        session = NmtSession([nmt(order.command, 1)], Listener(world.now_s), 0.2)
        assert world.run(session) == pytest.approx(0.2, abs=0.01)
        assert world.bench.nodes[1].state is state
        assert outcome(order, session.heard.nodes.get(1), 1)[0]


def test_outcomes() -> None:
    operational = HeardNode(3, NmtState.OPERATIONAL)
    assert outcome(Order.START, operational, 3) == (True, "node 3: operational")
    assert outcome(Order.STOP, operational, 3) == (False, "node 3: operational, not stopped")
    assert outcome(Order.RESET, None, 3) == (False, "node 3: no boot-up message")
    obeyed, text = outcome(Order.STOP, None, 3)
    assert obeyed
    assert "no heartbeat" in text
