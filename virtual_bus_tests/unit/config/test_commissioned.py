"""Mistakes in robot.yaml that every part and every drive agrees with, and the marks of the commissioning."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from canbase_commissioning.edits import Edit, commissioned_edits, edited, with_edits
from canbase_config.commissioned import STEPS, Commissioned, Step, _shown, mark, uncommissioned
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_doctor.check import Verdict, commissioning
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import StopCause
from canbase_sim.world.bench import Bench
from canbase_velocity.safety_filter import FilterConfig, decide
from canbase_velocity.twist import Twist
from support.chain_world import World, bench_robot
from support.crews import robot_with
from support.filter_inputs import GOOD

Values = dict[str, Any]
Change = Callable[[Values], object]
CURVE = Twist2D(0.2, 0.4)


def changed(robot: Robot, change: Change) -> Robot:
    values = robot.model_dump()
    change(values)
    return Robot.model_validate(values)


def swap(key: str) -> Change:
    def change(values: Values) -> None:
        left, right = values["drives"]
        left[key], right[key] = right[key], left[key]

    return change


def every_drive(**keys: object) -> Change:
    return lambda values: [drive.update(keys) for drive in values["drives"]]


def commissioned(robot: Robot) -> Robot:
    """On a bus with a wire, with all its marks."""
    bus = robot.bus.model_copy(update={"interface": "socketcan", "channel": "can0", "extra": {}})
    wired = robot.model_copy(update={"bus": bus})
    return wired.model_copy(
        update={"commissioned": wired.commissioned.model_copy(update={step: mark(wired, step) for step in STEPS})}
    )


MISTAKES: dict[str, tuple[Change, tuple[Step, ...], Twist2D]] = {
    "a radius that is half of it": (
        lambda values: values["base"].update(wheel_radius_m=0.05),
        ("floor",),
        Twist2D(0.4, 0.8),
    ),
    "another gear": (every_drive(gear_ratio=40.0), ("scale", "floor"), Twist2D(0.4, 0.8)),
    "drives swapped": (swap("node_id"), ("directions", "scale", "proof", "floor"), Twist2D(-0.2, 0.4)),
    "sides swapped": (swap("side"), ("directions", "floor"), Twist2D(0.2, -0.4)),
    "both directions reversed": (swap("direction"), ("directions", "floor"), Twist2D(-0.2, -0.4)),
    "half of the track": (lambda values: values["base"].update(track_m=0.25), ("floor",), Twist2D(0.2, 0.2)),
    # each side is 2 % from the mean: 0.1 m/s becomes 0.102 on the left, 0.3 becomes 0.294 on the right
    "a right wheel that is no larger": (
        lambda values: values["base"].update(wheel_ratio=1.04),
        ("floor",),
        Twist2D(0.198, 0.384),
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_no_part_sees_it_and_the_base_moves_otherwise_than_ordered(name: str) -> None:
    """That is why the marks are needed: driver and watchdog compute with the same wrong numbers."""
    change, _, moves = MISTAKES[name]
    world = World(changed(bench_robot(), change))
    world.bench = Bench(bench_robot(), world.now_s)
    world.drive(CURVE, seconds=2.0)
    assert world.core.state is DriverState.ENABLED
    assert (world.truth.linear_mps, world.truth.angular_radps) == pytest.approx(
        (moves.linear_mps, moves.angular_radps), abs=0.01
    )


@pytest.mark.parametrize("name", MISTAKES)
def test_the_marks_of_the_commissioning_do_not_fit_to_it_any_more(name: str) -> None:
    change, steps, _ = MISTAKES[name]
    assert uncommissioned(commissioned(bench_robot())) == ""
    told = uncommissioned(changed(commissioned(bench_robot()), change))
    assert told == f"this robot is not commissioned (robot.yaml has changed since: {', '.join(steps)})"


def test_another_time_until_a_drive_stops_by_itself_needs_another_proof() -> None:
    later = changed(commissioned(bench_robot()), lambda values: values["timeouts"].update(drive_heartbeat_s=0.8))
    assert uncommissioned(later) == "this robot is not commissioned (robot.yaml has changed since: proof)"


def test_limits_and_names_may_change_without_another_commissioning() -> None:
    def change(values: Values) -> None:
        values["name"] = "other"
        values["limits"]["linear_mps"] = 0.5
        values["safety"]["footprint"]["front_m"] = 0.4

    assert uncommissioned(changed(commissioned(bench_robot()), change)) == ""


def test_a_step_alone_leaves_its_mark_and_the_others_are_named(tmp_path: Path) -> None:
    text = sample("example_can0").read_text(encoding="utf-8")
    robot = load_robot(sample("example_can0")).robot
    edits = [Edit(("drives", 0, "gear_ratio"), robot.drives[0].gear_ratio, 25.5)]
    edits += commissioned_edits(robot, edits, ("directions", "scale"))
    file = tmp_path / "robot.yaml"
    file.write_text(edited(text, edits), encoding="utf-8")
    loaded = load_robot(file)
    assert loaded.robot.commissioned.scale == mark(with_edits(robot, edits[:1]), "scale")
    assert uncommissioned(loaded.robot) == "this robot is not commissioned (not done: proof, floor)"
    assert any("this robot is not commissioned" in str(warning) for warning in loaded.warnings)


def test_a_profile_beside_robot_yaml_may_move_with_it(tmp_path: Path) -> None:
    marks = []
    for folder in (tmp_path / "home", tmp_path / "etc"):
        folder.mkdir()
        (folder / "own.yaml").write_text("title: own\nunits: {target_velocity: 0.1rpm, actual_velocity: 0.1rpm}\n")
        text = sample("bench").read_text().replace("    # profile: generic ", "    profile: own.yaml # ")
        (folder / "robot.yaml").write_text(text)
        robot = load_robot(folder / "robot.yaml").robot
        marks.append([mark(robot, step) for step in STEPS])
    assert marks[0] == marks[1]


def test_until_then_no_corner_of_the_base_is_faster_than_safety_uncommissioned_mps() -> None:
    robot = commissioned(bench_robot())
    known = FilterConfig.of(robot)
    unknown = FilterConfig.of(robot.model_copy(update={"commissioned": bench_robot().commissioned}))
    ahead, turning = Twist(0.8, 0.0), Twist(0.0, 2.0)
    assert decide(replace(GOOD, command=ahead), known).twist == ahead
    proven = Commissioned(scale=mark(robot, "scale"))
    measured = FilterConfig.of(robot.model_copy(update={"commissioned": proven}))
    assert decide(replace(GOOD, command=ahead), measured).twist.linear_mps == pytest.approx(0.3)
    slower = decide(replace(GOOD, command=ahead), unknown)
    assert slower.twist.linear_mps == pytest.approx(robot.limits.linear_mps / 10.0)
    assert slower.cause is StopCause.SPEED
    assert "this robot is not commissioned (not done: directions, scale, proof, floor)" in slower.detail
    assert slower.clears_on == "canbase setup commission"
    assert decide(replace(GOOD, command=turning), unknown).twist.angular_radps == pytest.approx(0.08 / (0.31 * 2**0.5))


def test_a_bus_without_a_wire_needs_none() -> None:
    assert uncommissioned(bench_robot()) == ""
    assert commissioning(load_robot(sample("bench"))) == []


def test_the_doctor_has_a_row_for_it(tmp_path: Path) -> None:
    row, _ = commissioning(load_robot(sample("example_can0")))
    assert (row.verdict, "not done: directions, scale, proof, floor" in row.found) == (Verdict.WARN, True)
    robot = load_robot(sample("example_can0")).robot
    file = tmp_path / "robot.yaml"
    text = sample("example_can0").read_text(encoding="utf-8")
    file.write_text(edited(text, commissioned_edits(robot, [], STEPS)), encoding="utf-8")
    row, _ = commissioning(load_robot(file))
    assert (row.verdict, row.found) == (Verdict.OK, "done, and robot.yaml has not changed since")


def test_a_proof_from_before_node_guarding_stays_valid_and_a_guarded_drive_has_another() -> None:
    """The mark of the sample's proof, as the first robots were commissioned with it."""
    robot = load_robot(sample("example_can0")).robot
    assert mark(robot, "proof") == "p97562ecf78f0"
    assert "node_guarding" in json.dumps(_shown(robot_with("technosoft"), "proof"))
    assert "node_guarding" not in json.dumps(_shown(robot, "proof"))
