"""Doctor reads what the boot of the driver would change, and changes nothing itself: before every kind of drive."""

from __future__ import annotations

from typing import Any

import pytest
from canopen import SdoAbortedError

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.sdo_session import SdoSession
from canbase_config.robot import Robot
from canbase_doctor.inspection import Inspection, inspect
from canbase_driver.boot.node_boot import NodeBoot, sdo_client
from canbase_driver.boot.settings import HEARTBEAT_CONSUMER
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia402 import DriveState
from canbase_sim.cia301 import abort
from canbase_sim.personality import PERSONALITIES
from support.crews import robot_with
from support.session_world import SessionWorld
from support.sim_rig import robot

KINDS = sorted(PERSONALITIES)


class BootSession:
    """The driver's boot of all nodes."""

    def __init__(self, of: Robot) -> None:
        nodes = {drive.node_id: tuple(d for d in of.drives if d.node_id == drive.node_id) for drive in of.drives}
        self.boots = [NodeBoot(node_id, drives, of) for node_id, drives in nodes.items()]

    @property
    def done(self) -> bool:
        return all(boot.done for boot in self.boots)

    def on_frame(self, frame: Frame, now_s: float) -> None:
        for boot in self.boots:
            boot.on_frame(frame, now_s)

    def tick(self, now_s: float) -> list[Frame]:
        return [frame for boot in self.boots for frame in boot.tick(now_s)]


def inspected(world: SessionWorld, of: Robot | None = None) -> dict[int, Inspection]:
    looked = of or world.robot
    nodes = {drive.node_id: tuple(d for d in looked.drives if d.node_id == drive.node_id) for drive in looked.drives}
    inquiry = SdoSession(
        {node_id: inspect(node_id, drives, looked) for node_id, drives in nodes.items()},
        Listener(world.now_s),
        lambda node_id: sdo_client(node_id, nodes[node_id][0].kind.sdo, 0.3),
    )
    world.run(inquiry)
    errors = [str(task.error) for task in inquiry.tasks.values() if task.error]
    assert errors == []
    return {node_id: task.result for node_id, task in inquiry.tasks.items() if task.result}


def writes(world: SessionWorld) -> list[Frame]:
    """Frames that order something: SDO downloads and everything that is no SDO."""
    return [frame for _, frame in world.said if frame.cob_id < 0x600 or frame.data[0] >> 5 == 1]


@pytest.mark.parametrize("kind", KINDS)
def test_a_drive_out_of_its_box_differs_and_nothing_is_written(kind: str) -> None:
    world = SessionWorld(robot_with(kind))
    world.wait(1.0)
    found = inspected(world)
    assert writes(world) == []
    assert all(each.pdos.changes for each in found.values())
    assert [each.settings.problem + each.pdos.problem + each.self_stop_part.problem for each in found.values()] == [
        ""
    ] * len(found)


@pytest.mark.parametrize("kind", KINDS)
def test_after_the_boot_nothing_differs_and_both_say_the_same_about_the_self_stop(kind: str) -> None:
    world = SessionWorld(robot_with(kind))
    session = BootSession(world.robot)
    world.run(session)
    for node_id, found in inspected(world).items():
        assert (found.settings.changes, found.pdos.changes, found.self_stop_part.changes) == ((), (), ())
        report = next(boot.report for boot in session.boots if boot.node_id == node_id)
        assert report is not None
        assert found.self_stop == report.self_stop.text


def test_what_somebody_changed_afterwards_is_named_with_both_values() -> None:
    world = SessionWorld()
    world.run(BootSession(world.robot))
    world.bench.nodes[2].dictionary.values[HEARTBEAT_CONSUMER << 8 | 1] = 0
    world.bench.nodes[2].dictionary.values[0x6085 << 8] = 1
    found = inspected(world)
    assert found[1].self_stop_part.changes == ()
    assert found[2].self_stop_part.changes == ("1016h:1: 00000000h → 007E012Ch",)
    assert [change[:8] for change in found[2].settings.changes] == ["6085h:0:"]


def test_what_the_boot_would_only_switch_off_and_on_again_is_no_difference() -> None:
    """The drive refuses the synchronous types, so the boot takes another one: that is all that differs."""

    def refuse(sub: int, value: int) -> None:
        if sub == 2 and value <= 240:
            raise SdoAbortedError(abort.INVALID_VALUE)

    world = SessionWorld()
    for node in world.bench.nodes.values():
        node.dictionary.guard(0x1800, refuse)
    world.run(BootSession(world.robot))
    assert inspected(world)[1].pdos.changes == ("1800h:2: FFh → 01h",)


def test_a_target_that_the_driver_has_ordered_is_no_difference() -> None:
    world = SessionWorld()
    world.run(BootSession(world.robot))
    world.bench.nodes[1].dictionary.values[0x60FF << 8] = 4711
    assert inspected(world)[1].settings.changes == ()


def test_state_error_code_and_a_wrong_identity() -> None:
    left = {"joint": "left", "node_id": 1, "side": "left", "identity": {"vendor_id": 0xAA}}
    right = {"joint": "right", "node_id": 2, "side": "right"}
    expected = robot(left, right)
    world = SessionWorld(expected, drives=robot())
    world.bench.nodes[2].fail(0, 0x2310)
    found = inspected(world)
    assert found[1].wrong_identity == "vendor_id is 0h, robot.yaml expects AAh"
    assert found[2].states == {"right": DriveState.FAULT}
    assert found[2].error_codes == {"right": 0x2310}


def test_a_drive_with_too_few_pdos_is_a_problem_in_words() -> None:
    world = SessionWorld()
    dictionary: Any = world.bench.nodes[1].dictionary
    dictionary.entries = {key: entry for key, entry in dictionary.entries.items() if key >> 8 != 0x1801}
    assert "it has no TPDO2 (1801h), but 4 RPDOs, 3 TPDOs" in inspected(world)[1].pdos.problem


def test_a_drive_that_means_something_else_by_its_numbers_is_a_problem_before_the_boot_says_it() -> None:
    left = {"joint": "left", "node_id": 1, "side": "left", "expects": ({"index": 0x608F, "sub": 1, "value": 1000},)}
    found = inspected(SessionWorld(robot(left, {"joint": "right", "node_id": 2, "side": "right"})))
    problem = "608Fh:1 (position encoder resolution) of left is 4096, and was 1000 when its wheel was measured"
    assert problem in found[1].settings.problem
    assert found[2].settings.problem == ""


def test_an_open_sdo_channel_is_a_difference() -> None:
    world = SessionWorld(robot_with("inverter"))
    world.run(BootSession(world.robot))
    world.bench.nodes[2].dictionary.values |= {0x1201 << 8 | 1: 0x642, 0x1201 << 8 | 2: 0x5C2}
    found = inspected(world)
    assert (found[1].settings.changes, found[2].settings.changes) == ((), ("1201h:1: 00000642h → 80000642h",))
