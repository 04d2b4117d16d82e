"""Direction, scale, radius and track: drives that are not what robot.yaml says, and a person who sees what is true."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from canbase_commissioning.edits import Edit, edited, floor_edits, identity_edits, wheel_edits, with_edits
from canbase_commissioning.floor import FloorFound, measure_floor
from canbase_commissioning.guide import CommissionError, Script
from canbase_commissioning.powered_drives import PoweredDrives, RigError
from canbase_commissioning.report import Results, markdown, verdict
from canbase_commissioning.self_stop_test import get_ready
from canbase_commissioning.wheel_direction import WheelFound, find_direction, measure_scale
from canbase_config.drive import Identity
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_driver.boot.sequence import BootReport
from canbase_driver.boot.settings import STOPS_BY_NOTHING
from support.crews import robot_with
from support.guide_world import GuideWorld
from support.sim_rig import robot

LEFT: dict[str, Any] = {"joint": "left", "node_id": 1, "side": "left"}
RIGHT: dict[str, Any] = {"joint": "right", "node_id": 2, "side": "right", "direction": -1}
RADIUS_M = 0.1


def with_left(**keys: Any) -> Robot:
    return robot(LEFT | keys, RIGHT)


def direction_of_left(rig: PoweredDrives) -> Script[WheelFound]:
    yield from get_ready(rig)
    return (yield from find_direction(rig, rig.robot.drives[0]))


def scale_of_left(rig: PoweredDrives) -> Script[WheelFound]:
    yield from get_ready(rig)
    scale, turned = yield from measure_scale(rig, rig.robot.drives[0], 0.6, 0.1)
    return WheelFound("left", 1, scale, turned)


class Witness(GuideWorld):
    """`robot` is what robot.yaml says, `drives` what is there; the person sees what the world really does."""

    def __init__(self, says: Robot, there: Robot) -> None:
        super().__init__(says, there, {"mark.left": "yes", "floor.straight": "yes", "floor.turn": "y"})
        self.answers |= {
            "direction.left": self.way,
            "revolutions.left": self.revolutions,
            "floor.distance_m": lambda: str(self.bench.base.travel_m),
            "floor.angle_deg": lambda: str(math.degrees(self.bench.base.turned_rad)),
        }

    def way(self) -> str:
        left_m = self.bench.base.travel_left_m
        return "nothing" if abs(left_m) < 0.001 else "forward" if left_m > 0.0 else "b"

    def revolutions(self) -> str:
        return f"{abs(self.bench.base.travel_left_m) / (2.0 * math.pi * RADIUS_M):.3f}"


@pytest.mark.parametrize(("says", "there", "right"), [(1, 1, 1), (1, -1, -1), (-1, 1, 1), (-1, -1, -1)])
def test_the_direction_comes_out_right_whatever_robot_yaml_said(says: int, there: int, right: int) -> None:
    world = Witness(with_left(direction=says), with_left(direction=there))
    found = world.guide(direction_of_left)
    assert found.direction == right
    assert len(wheel_edits(world.robot, [found])) == int(says != right)


@pytest.mark.parametrize(
    ("says", "there", "key"),
    [
        ({}, {}, None),
        ({}, {"gear_ratio": 20.0}, "gear_ratio"),
        ({"velocity_unit": "rpm"}, {"velocity_unit": "0.1rpm"}, "velocity_unit"),
    ],
)
def test_the_wrong_key_is_found_and_corrected(says: dict[str, Any], there: dict[str, Any], key: str | None) -> None:
    world = Witness(with_left(**says), with_left(**there))
    edits = wheel_edits(world.robot, [world.guide(scale_of_left)])
    assert [edit.loc for edit in edits] == ([("drives", 0, key)] if key else [])
    corrected = with_edits(world.robot, edits).drives[0]
    wanted = with_left(**there).drives[0]
    assert corrected.gear_ratio == pytest.approx(wanted.gear_ratio, rel=0.02)
    assert corrected.counts_per_motor_rev == pytest.approx(wanted.counts_per_motor_rev, rel=0.02)
    assert corrected.velocity_unit == wanted.velocity_unit


@pytest.mark.parametrize("counts", [2048, 8192])
def test_an_encoder_resolution_that_the_drive_contradicts_is_named_before_a_wheel_turns(counts: int) -> None:
    world = Witness(with_left(counts_per_motor_rev=counts), with_left())
    with pytest.raises(CommissionError, match=rf"608Fh:1 = 4096 .* robot\.yaml has counts_per_motor_rev: {counts}"):
        world.guide(scale_of_left)
    assert world.bench.base.travel_left_m == 0.0


def test_a_wheel_that_runs_ten_times_as_fast_as_ordered_is_stopped_before_anybody_is_asked() -> None:
    world = Witness(with_left(velocity_unit="0.1rpm"), with_left(velocity_unit="rpm"))
    with pytest.raises(RigError, match=r"left turns at 0\.[123]\d m/s, .*: check velocity_unit"):
        world.guide(direction_of_left)
    assert world.asked == []
    world.wait(0.5)
    assert world.speeds[0] == 0.0


@pytest.mark.parametrize(
    ("answer", "told"),
    [("other", "exchange node_id"), ("nothing", "it was not seen to turn"), ("n", "it was not seen to turn")],
)
def test_a_person_who_sees_something_else_ends_it_with_advice(answer: str, told: str) -> None:
    world = GuideWorld(answers={"direction.left": answer})
    with pytest.raises(CommissionError, match=told):
        world.guide(direction_of_left)


def test_an_encoder_that_does_not_count_ends_it_with_advice() -> None:
    world = Witness(robot(), robot())
    world.bench.nodes[1].axes[0].faults.frozen_position = 0
    with pytest.raises(CommissionError, match=r"left: it turned, its encoder moved by 0\.0 mm"):
        world.guide(direction_of_left)


def test_who_does_not_confirm_moves_nothing() -> None:
    world = GuideWorld(answers={"mark.left": "no"})
    with pytest.raises(CommissionError, match="not confirmed"):
        world.guide(scale_of_left)
    assert world.bench.base.path_m == 0.0


def floor(rig: PoweredDrives) -> Script[FloorFound]:
    yield from get_ready(rig)
    return (yield from measure_floor(rig, 0.4, 0.25, 0.1))


@pytest.mark.parametrize(("radius_m", "track_m"), [(0.1, 0.5), (0.11, 0.5), (0.1, 0.55), (0.095, 0.47)])
def test_radius_and_track_of_the_real_base_are_found(radius_m: float, track_m: float) -> None:
    there = robot(base={"wheel_radius_m": radius_m, "track_m": track_m})
    world = Witness(robot(), there)
    found = world.guide(floor)
    assert found.wheel_radius_m == pytest.approx(radius_m, rel=0.005)
    assert found.track_m == pytest.approx(track_m, rel=0.01)
    assert found.odometry_m == pytest.approx(0.4, abs=0.02)
    corrected = with_edits(robot(), floor_edits(robot(), found))
    assert corrected.base.wheel_radius_m == pytest.approx(radius_m, rel=0.005)


@pytest.mark.parametrize(
    ("tape_m", "changes"),
    [(0.1021, []), (0.104, ["base.wheel_radius_m: 0.1 → 0.104", "odometry.radius_error: 0.001 → 0.005"])],
)
def test_a_calibrated_radius_stays_where_the_tape_agrees(tape_m: float, changes: list[str]) -> None:
    before = robot(base={"wheel_radius_m": 0.1, "track_m": 0.5}, odometry={"radius_error": 0.001, "track_error": 0.002})
    found = FloorFound(tape_m, 0.502, 1.0, 1.0, 360.0, 360.0)
    assert [str(edit) for edit in floor_edits(before, found)] == changes


def test_robot_yaml_keeps_every_comment_and_line_that_is_not_changed(tmp_path: Any) -> None:
    text = sample("example_can0").read_text(encoding="utf-8")
    before = load_robot(sample("example_can0")).robot
    found = FloorFound(0.0987654, 0.51234, 1.0, 0.99, 360.0, 350.0)
    edits = [*wheel_edits(before, [WheelFound("left_wheel", -1)]), *floor_edits(before, found)]
    new = edited(text, edits)
    changed = [(a, b) for a, b in zip(text.splitlines(), new.splitlines(), strict=True) if a != b]
    assert [b.strip() for _, b in changed] == [
        "direction: -1                 # -1: a positive motor velocity drives the base backward (may be left out: 1)",
        "wheel_radius_m: 0.098765        # under load",
        "track_m: 0.51234                # between the contact points of left and right wheel",
    ]
    (tmp_path / "robot.yaml").write_text(new, encoding="utf-8")
    after = load_robot(tmp_path / "robot.yaml").robot
    assert (after.drives[0].direction, after.base.track_m) == (-1, 0.51234)


def boot_of(node_id: int, **identity: int | None) -> BootReport:
    return BootReport(node_id, Identity.model_validate(identity), STOPS_BY_NOTHING, (), ())


def test_who_the_drives_are_is_added_beside_comments_that_stay_with_their_section(tmp_path: Path) -> None:
    text = sample("example_can0").read_text(encoding="utf-8")
    before = load_robot(sample("example_can0")).robot
    boots = {1: boot_of(1, vendor_id=0x469, serial=7), 2: boot_of(2, vendor_id=0x469, serial=0xCAFE)}
    edits = identity_edits(before, boots)
    assert str(edits[3]) == "drives[1].identity.serial: None → 0xCAFE"
    new = edited(text, [*edits, Edit(("drives", 1, "side"), "right", "right")])
    added = [line for line in new.splitlines() if line not in text.splitlines()]
    assert added == [
        "    identity: {vendor_id: 0x469, serial: 0x7}",
        "    identity: {vendor_id: 0x469, serial: 0xCAFE}",
    ]
    assert [line for line in new.splitlines() if line not in added] == text.splitlines()
    assert new.index(added[1]) < new.index("# --- The wheels under the base")
    file = tmp_path / "robot.yaml"
    file.write_text(new, encoding="utf-8")
    after = load_robot(file).robot
    assert [drive.identity.serial for drive in after.drives] == [7, 0xCAFE]
    assert identity_edits(after, boots) == []
    again = identity_edits(after, {1: boot_of(1, vendor_id=0x469, serial=8)})
    assert [str(edit) for edit in again] == ["drives[0].identity.serial: 0x7 → 0x8"]
    assert "identity: {vendor_id: 0x469, serial: 0x8}" in edited(new, again)


def test_another_drive_than_the_commissioned_one_is_refused_before_anything_moves() -> None:
    world = Witness(with_left(identity={"serial": 0x22}), robot())
    with pytest.raises(CommissionError, match=r"1018h:4 \(serial\) is 00000001h, expected 00000022h"):
        world.guide(get_ready)
    assert world.bench.base.path_m == 0.0


def test_both_motors_of_a_node_are_the_same_drive_and_what_it_does_not_tell_is_not_asked() -> None:
    edits = identity_edits(robot_with("zlac8015d"), {1: boot_of(1, vendor_id=0x100, product_code=1)})
    assert [str(edit) for edit in edits] == [
        "drives[0].identity.vendor_id: None → 0x100",
        "drives[0].identity.product_code: None → 0x1",
        "drives[1].identity.vendor_id: None → 0x100",
        "drives[1].identity.product_code: None → 0x1",
    ]


def test_without_trials_the_report_does_not_pretend() -> None:
    results = Results(ended_by="stopped by SIGINT")
    assert "NOT PROVEN" in verdict(results)
    told = markdown(robot(), results, "2024-01-01", "1.0")
    assert "It did not come to its end: stopped by SIGINT" in told
    assert "STO through a safety relay" in told
