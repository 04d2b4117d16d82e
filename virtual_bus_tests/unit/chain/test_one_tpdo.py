"""Inverters with one TPDO each: status, position and 16-bit velocity in one frame. Boot, drive, stop, failures."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from pydantic import ValidationError

from canbase_config.profile_file import load_profile
from canbase_config.robot import Robot
from canbase_driver.cia301.pdo import node_layout
from canbase_driver.motion.kinematics import Twist2D
from canbase_recording.pdo_layouts import PdoLayouts
from canbase_runtime.driver_state import DriverState
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.personality import PERSONALITIES, Personality
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import Watchdog
from canbase_web.stop_recording import wheel_speeds
from support.chain_world import FORWARD, World, bench_robot, world_of
from support.crews import robot_with
from support.personalities import set_personality, with_tpdos

STATUS, VELOCITY = 0x181, 0x281
"""TPDOs of the left drive."""
SECOND_STATUS = 0x381
"""Of the second motor, where node 1 has two."""


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    set_personality(monkeypatch, "inverter", with_tpdos(PERSONALITIES["inverter"], 1))
    return world_of("inverter")


def watchdog(world: World) -> Watchdog:
    assert world.watchdog is not None
    return world.watchdog


def cause(world: World) -> TripCause:
    return watchdog(world).status.verdict.cause


def falsify(world: World, change: Callable[[bytes], bytes], cob_id: int = STATUS) -> None:
    """From now on the data of this TPDO are changed on their way."""
    tick = world.bench.tick

    def changed(now_s: float) -> list[BenchFrame]:
        return [
            BenchFrame(frame.cob_id, change(frame.data)) if frame.cob_id == cob_id else frame for frame in tick(now_s)
        ]

    world.bench.tick = changed  # type: ignore[method-assign]


def test_it_boots_drives_and_stops_with_one_frame_of_feedback_in_each_cycle(world: World) -> None:
    world.drive(seconds=1.0)
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, rel=0.02)
    notes = " ".join(world.snapshot.drives[0].boot_notes)
    assert "the drive has no TPDO2: TPDO1 carries the velocity behind the position" in notes
    assert "torque unknown: one TPDO for each motor has no room for it" in notes
    before = len(world.sent(STATUS))
    world.run(1.0)
    assert len(world.sent(STATUS)) - before == pytest.approx(100, abs=2)
    assert world.sent(VELOCITY) == []
    assert {len(data) for data in world.sent(STATUS)[before:]} == {8}
    world.command = Twist2D.ZERO
    assert world.stands_after(1.5) < 0.6
    assert world.core.state is DriverState.ENABLED


def test_the_driver_and_the_watchdog_see_both_wheels_as_they_turn(world: World) -> None:
    world.drive(Twist2D(0.2, 0.5), seconds=2.0)
    assert world.snapshot.odometry.twist.linear_mps == pytest.approx(world.truth.linear_mps, abs=0.01)
    assert world.snapshot.odometry.twist.angular_radps == pytest.approx(world.truth.angular_radps, abs=0.03)
    seen = [axis.velocity_mps for axis in watchdog(world)._observer.bus_view().axes]
    half_track_m = world.robot.base.track_m / 2.0
    assert seen == pytest.approx([0.2 - 0.5 * half_track_m, 0.2 + 0.5 * half_track_m], abs=0.02)


def test_the_pose_goes_as_far_as_the_base(world: World) -> None:
    world.enable()
    from_m = world.truth.x_m
    pose_m = world.snapshot.odometry.pose.x_m
    world.command = FORWARD
    world.run(3.0)
    assert world.snapshot.odometry.pose.x_m - pose_m == pytest.approx(world.truth.x_m - from_m, abs=0.01)


@pytest.mark.parametrize("kept_bytes", [7, 6, 2, 0])
def test_a_frame_without_its_velocity_counts_for_nothing_and_the_base_stops(world: World, kept_bytes: int) -> None:
    """Cut to six bytes it is a status TPDO of a drive with two: 606Ch is missing, and that must be seen."""
    world.drive()
    falsify(world, lambda data: data[:kept_bytes])
    start = world.now_s
    assert world.run(1.0, lambda: cause(world) is not TripCause.NONE or world.core.state is not DriverState.ENABLED)
    assert world.now_s - start <= world.robot.timeouts.feedback_s + 0.03
    assert world.stands_after(1.5) < 0.8


def test_a_second_drive_with_its_node_id_trips(world: World) -> None:
    world.drive()
    tick = world.bench.tick

    def twice(now_s: float) -> list[BenchFrame]:
        said = tick(now_s)
        return said + [frame for frame in said if frame.cob_id == STATUS]

    world.bench.tick = twice  # type: ignore[method-assign]
    assert world.run(1.0, lambda: cause(world) is not TripCause.NONE)
    assert cause(world) is TripCause.ANSWERED_TWICE


# one node, two motors, two TPDOs: 181h and 381h ── 0.3 m/s ── 381h loses its last two bytes ── stop within 0.13 s
def test_two_motors_of_one_node_send_a_frame_each_and_each_is_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = profile_of(tmp_path, "generic", tpdos=4, layout={"axes": 2, "velocity_bits": 16})
    kind = with_tpdos(Personality(widths={0x606C: "h", 0x686C: "h"}), 2)
    set_personality(monkeypatch, profile, kind)
    robot = robot_with("generic").model_dump()
    for axis, drive in enumerate(robot["drives"]):
        drive |= {"profile": profile, "node_id": 1, "axis": axis}
    world = World(Robot.model_validate(robot))
    world.drive(seconds=1.0)
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, rel=0.02)
    assert "the drive has no TPDO3: TPDO1 and TPDO2 carry" in world.snapshot.drives[0].boot_notes[0]
    assert [len(world.sent(cob_id)[-1]) for cob_id in (STATUS, SECOND_STATUS)] == [8, 8]
    falsify(world, lambda data: data[:6], SECOND_STATUS)
    start = world.now_s
    assert world.run(1.0, lambda: cause(world) is not TripCause.NONE or world.core.state is not DriverState.ENABLED)
    assert world.now_s - start <= world.robot.timeouts.feedback_s + 0.03


# two drives with node id 1: one has a single TPDO, and the boot has believed the other one, that it has two
def test_a_second_drive_with_its_node_id_that_sends_its_status_alone_trips(world: World) -> None:
    """Six bytes without a velocity go before each frame: of that drive nothing else is ever seen."""
    world.drive()
    tick = world.bench.tick

    def with_another(now_s: float) -> list[BenchFrame]:
        said = tick(now_s)
        return [BenchFrame(STATUS, frame.data[:6]) for frame in said if frame.cob_id == STATUS] + said

    world.bench.tick = with_another  # type: ignore[method-assign]
    start = world.now_s
    assert world.run(1.0, lambda: cause(world) is not TripCause.NONE)
    assert cause(world) is TripCause.ANSWERED_TWICE
    assert world.now_s - start <= world.robot.timeouts.feedback_s + 0.03


def test_a_frozen_velocity_beside_a_position_that_runs_trips(world: World) -> None:
    """The encoder's counts say one thing, the last two bytes another."""
    world.drive()
    falsify(world, lambda data: data[:6] + bytes(2))
    assert world.run(2.0, lambda: cause(world) is not TripCause.NONE)
    assert world.stands_after(2.0) < 1.0


def test_a_profile_can_say_it_before_the_boot(tmp_path: Path) -> None:
    narrow, wide = (profile_of(tmp_path, kind, tpdos=1) for kind in ("inverter", "generic"))
    robot = robot_with("inverter")
    drives = [drive.model_dump(exclude_unset=True) for drive in robot.drives]
    said = Robot.model_validate({**robot.model_dump(), "drives": [{**each, "profile": narrow} for each in drives]})
    layout = node_layout(1, (said.drives[0],), said)
    assert [(pdo.name, pdo.cob_id, len(pdo.mapping)) for pdo in layout.pdos() if pdo.is_received] == [
        ("TPDO1", 0x181, 3)
    ]
    with pytest.raises(ValidationError, match=r"1 motor\(s\) need 2 RPDOs and 2 TPDOs; .* has fewer"):
        Robot.model_validate({**bench_robot().model_dump(), "drives": [{**each, "profile": wide} for each in drives]})


# 0.1 rpm a bit, gear 20: 16 bits end at 1.72 m/s of the wheel ── 606Ch must show 1.2 times the fastest wheel, too
@pytest.mark.parametrize(
    ("narrow", "linear_mps", "problem"),
    [
        ("velocity_bits", 1.42, ""),
        ("velocity_bits", 1.44, r"606Ch of left_wheel has 16 bits of 0.1rpm: up to 1.72 m/s at its wheel. 1.73 m/s"),
        ("target_bits", 1.71, ""),
        ("target_bits", 1.72, r"60FFh of left_wheel has 16 bits of 0.1rpm: up to 1.72 m/s at its wheel. 1.72 m/s"),
    ],
)
def test_a_speed_that_its_objects_cannot_hold_is_refused(
    tmp_path: Path, narrow: str, linear_mps: float, problem: str
) -> None:
    """606Ch would go from 1.72 to -1.72 m/s there."""
    profile = profile_of(tmp_path, "generic", tpdos=4, layout={narrow: 16})
    robot = robot_with("generic").model_dump()
    robot["limits"] |= {"linear_mps": linear_mps, "angular_radps": 0.01}
    for drive in robot["drives"]:
        drive |= {"profile": profile, "velocity_unit": "0.1rpm"}
    if not problem:
        assert Robot.model_validate(robot).limits.linear_mps == linear_mps
        return
    with pytest.raises(ValidationError, match=problem):
        Robot.model_validate(robot)


def profile_of(folder: Path, kind: str, tpdos: int, **sections: dict[str, int]) -> str:
    keys = load_profile(kind).model_dump(mode="json", exclude_unset=True)
    file = folder / f"{kind}.yaml"
    file.write_text(json.dumps({**keys, **sections, "pdo": {**keys.get("pdo", {}), "tpdos": tpdos}}, indent=1))
    return str(file)


def test_a_drive_with_one_tpdo_and_a_wide_velocity_cannot_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    set_personality(monkeypatch, "generic", with_tpdos(PERSONALITIES["generic"], 1))
    world = world_of("generic")
    world.run(3.0)
    assert world.core.state is not DriverState.ENABLED
    assert "it has no TPDO2 (1801h), but 4 RPDOs, 1 TPDOs" in world.snapshot.drives[0].boot_problem


def test_the_recording_and_the_page_of_a_stop_read_its_velocity(world: World) -> None:
    world.drive(seconds=1.0)
    layout = PdoLayouts(world.robot).of(STATUS, 8)
    assert layout is not None
    assert [(each.base, each.first_bit, each.bits) for each in layout.mapped] == [
        (0x6041, 0, 16), (0x6064, 16, 32), (0x606C, 48, 16),
    ]  # fmt: skip
    frames = [(0.0, STATUS, data) for data in world.sent(STATUS)[-5:]]
    left = wheel_speeds(world.robot, frames)[0]
    assert left.measured[-1][1] == pytest.approx(FORWARD.linear_mps, abs=0.01)
