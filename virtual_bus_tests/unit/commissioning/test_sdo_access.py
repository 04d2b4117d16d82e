"""Reading and writing one object of a simulated drive, and when a write is refused."""

from __future__ import annotations

from typing import TypeVar

import pytest

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.sdo_access import Refused, Written, beside_driver, read_object, status_places, write_object
from canbase_commissioning.sdo_session import SdoSession
from canbase_commissioning.session import NodeTask
from canbase_driver.boot.steps import Steps
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.sdo_client import SdoAborted, SdoClient, SdoTimeout
from support.session_world import SessionWorld
from support.sim_rig import robot

T = TypeVar("T")
STATUS = (Address(0x6041), Address(0x6841))


def ask(world: SessionWorld, steps: Steps[T], node: int = 1) -> NodeTask[T]:
    inquiry = SdoSession({node: steps}, Listener(world.now_s), lambda node_id: SdoClient(node_id, 0.1, 2))
    world.run(inquiry)
    return inquiry.tasks[node]


def enable(world: SessionWorld) -> None:
    for index, value, kind in ((0x6060, "3", "i8"), (0x6040, "6", "u16"), (0x6040, "7", "u16"), (0x6040, "15", "u16")):
        assert ask(world, write_object(Address(index), value, kind, (), force=True)).error is None


def test_a_text_is_read_in_segments() -> None:
    assert ask(SessionWorld(), read_object(Address(0x1008))).result == b"canbase simulated drive"


def test_a_write_tells_what_was_there_before_and_what_is_there_now() -> None:
    done = ask(SessionWorld(), write_object(Address(0x1017), "100", "u16", STATUS, force=False)).result
    assert done == Written(b"\x00\x00", b"\x64\x00")


def test_without_a_type_it_is_written_as_wide_as_it_is() -> None:
    done = ask(SessionWorld(), write_object(Address(0x1017), "0x64", "", STATUS, force=False)).result
    assert done == Written(b"\x00\x00", b"\x64\x00")


def test_while_the_motor_has_power_nothing_is_written_unless_forced() -> None:
    world = SessionWorld()
    enable(world)
    refused = ask(world, write_object(Address(0x60FF), "1000", "i32", STATUS, force=False)).result
    assert refused == Refused("6041h:0 reports that a motor has power; a write now may move or stop it")
    assert world.bench.nodes[1].dictionary.values[0x60FF00] == 0
    forced = ask(world, write_object(Address(0x60FF), "1000", "i32", STATUS, force=True)).result
    assert isinstance(forced, Written)
    assert world.bench.nodes[1].dictionary.values[0x60FF00] == 1000


def test_a_node_without_statusword_is_no_drive_and_takes_writes() -> None:
    done = ask(SessionWorld(), write_object(Address(0x1017), "100", "u16", (Address(0x5000),), force=False)).result
    assert isinstance(done, Written)


def test_what_the_drive_refuses_and_who_does_not_answer_are_errors_with_their_codes() -> None:
    world = SessionWorld()
    refused = ask(world, write_object(Address(0x6060), "1", "i8", STATUS, force=False)).error
    assert isinstance(refused, SdoAborted)
    assert refused.code == 0x0609_0030
    assert isinstance(ask(world, read_object(Address(0x1000)), node=9).error, SdoTimeout)


def test_a_value_that_does_not_fit_is_our_own_mistake_and_raises() -> None:
    with pytest.raises(ValueError, match="does not fit u16"):
        ask(SessionWorld(), write_object(Address(0x1017), "65536", "u16", STATUS, force=False))


def test_the_statuswords_are_where_the_profile_has_them() -> None:
    shared = {"node_id": 1, "profile": "zlac8015d", "velocity_unit": None}
    of = robot({"joint": "left", "side": "left", **shared}, {"joint": "right", "side": "right", "axis": 1, **shared})
    assert status_places(1, of) == (Address(0x6041),)
    assert status_places(1, robot()) == (Address(0x6041),)
    assert status_places(9, robot()) == STATUS


@pytest.mark.parametrize(
    ("at", "becomes"),
    [
        (Address(0x1016, 1), "After a write to 1016h:1 the driver boots node 1 anew"),
        (Address(0x1201, 1), "After a write to 1201h:1 the driver boots"),
        (Address(0x6885), "After a write to 6885h:0 the driver boots"),
        (Address(0x60F9, 1), "After a write to 60F9h:1 the driver boots"),
        (Address(0x60FF), "the watchdog stops the robot"),
        (Address(0x6840), "The driver sends 6840h:0 itself"),
    ],
)
def test_beside_the_driver_a_write_leads_to_a_boot_or_to_a_stop(at: Address, becomes: str) -> None:
    assert becomes in beside_driver(1, at, robot())
    assert becomes in beside_driver(1, at, None)


def test_what_the_boot_only_compares_is_not_undone() -> None:
    noted = {"joint": "left", "node_id": 1, "side": "left", "expects": ({"index": 0x2010, "value": 1},)}
    of = robot(noted, {"joint": "right", "node_id": 2, "side": "right"})
    for at in (Address(0x607E), Address(0x6891, 1), Address(0x2010)):
        assert "no power where `expects` in robot.yaml has another value" in beside_driver(1, at, of)
    assert "what the boot sets gets its value again" in beside_driver(1, Address(0x2010), robot())


def test_a_node_that_is_no_drive_is_not_observed() -> None:
    assert beside_driver(9, Address(0x1016, 1), robot()) == (
        "Node 9 is no drive of robot.yaml, and the driver does not notice the write"
    )


def test_a_channel_that_others_use_all_the_time_is_left_to_them_for_five_seconds_and_then_given_up() -> None:
    world = SessionWorld()
    question, heard = Frame(0x601, bytes.fromhex("4064600000000000")), Listener(world.now_s)
    heard.on_frame(question, world.now_s)
    world.others.append(lambda now_s: [question])
    inquiry = SdoSession({1: read_object(Address(0x1000))}, heard, lambda node_id: SdoClient(node_id, 0.1, 2))
    assert world.run(inquiry) == pytest.approx(5.0, abs=0.1)
    assert inquiry.tasks[1].blocked
    assert world.said == []
