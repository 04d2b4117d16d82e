"""Squares in both directions: wheel radii and track of simulated bases, with an honest certainty, or refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from calibration import MOUNT, measure, robot_with_scanner
from canbase_cli.main import app
from canbase_commissioning.edits import edited, with_edits
from canbase_commissioning.onbus.robot_file import write_edits
from canbase_commissioning.umbmark.planar import Array, Wheels, between, compose, pose, rolled
from canbase_commissioning.umbmark.scan_match import FLOOR
from canbase_commissioning.umbmark.squares import Course, Move
from canbase_commissioning.umbmark.verdict import check, course_of, geometry_edits, lines, result, wheels_of
from canbase_commissioning.umbmark.wheel_fit import Fit, FitError, Leg, fit
from canbase_config.commissioned import mark
from canbase_config.errors import ConfigError
from canbase_config.load import load_robot, sample
from support.room import CORRIDOR, SimulatedBase, Truth, drawn_truth, drive_course, open_squares

ROBOT = robot_with_scanner()
OLD = wheels_of(ROBOT.base)
ORIGIN = pose(0.0, 0.0, 0.0)


def base_of(truth: Truth, seed: int = 0) -> SimulatedBase:
    return SimulatedBase(truth, OLD, np.random.default_rng(seed), pose(0.0, 0.0, 0.3))


def legs_of(base: SimulatedBase, plan: list[Move], noise: Array = FLOOR) -> list[Leg]:
    """With the scanner's motion known but for the stated noise: no scans."""
    legs = []
    for move in plan:
        before = base.scanner()
        angles = base.go(move)
        error = base.rng.multivariate_normal(np.zeros(3), noise)
        legs.append(Leg(angles, between(before, base.scanner()) + error, noise))
    return legs


def fitted(legs: list[Leg]) -> Fit:
    return fit(legs, OLD, MOUNT, ROBOT.odometry)


def test_a_base_that_is_3_percent_off_is_found_in_a_room() -> None:
    one = measure(ROBOT, seed=11)
    assert one.refused == ""
    assert [abs(error) < limit for error, limit in zip(one.errors.values(), (0.2, 0.2, 0.5), strict=True)] == [True] * 3
    assert len(one.before_m) == 8
    assert max(one.after_m) < 0.12 < max(one.before_m)


def test_the_certainty_is_honest() -> None:
    """100 bases: errors in multiples of their σ have the variance 1."""
    multiples = []
    for seed in range(100):
        base = base_of(drawn_truth(OLD, MOUNT, np.random.default_rng(seed)), seed + 1000)
        found, true = fitted(legs_of(base, open_squares(1.5, 1))), base.truth.wheels
        multiples.append(
            [
                (found.wheels.left_m - true.left_m) / found.sigma.left_m,
                (found.wheels.right_m - true.right_m) / found.sigma.right_m,
                (found.wheels.track_m - true.track_m) / found.sigma.track_m,
            ]
        )
    assert np.var(multiples, axis=0) == pytest.approx([1.0, 1.0, 1.0], abs=0.35)
    assert np.mean(multiples, axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.35)


def test_a_match_that_is_uncertain_in_one_direction_weighs_little_in_it_alone() -> None:
    """Turns of 60°: 5 cm along x of the scan before, 2 mm across. Weighed rightly, chi² is as large as it should be."""
    noise, plan = np.diag([0.05, 0.002, 0.001]) ** 2, [Move("turn", math.pi / 3.0), Move("drive", 1.0)] * 8
    truths = [drawn_truth(OLD, MOUNT, np.random.default_rng(seed)) for seed in range(30)]
    found = [fitted(legs_of(base_of(truth, seed), plan, noise)) for seed, truth in enumerate(truths)]
    assert np.mean([each.chi2_share for each in found]) == pytest.approx(1.0, abs=0.12)
    assert sum(len(each.outliers) for each in found) < 8


def test_without_noise_it_is_exact_and_the_scanner_is_found_as_well() -> None:
    truth = Truth(Wheels(0.103, 0.098, 0.49), MOUNT + np.array([0.03, -0.02, 0.02]), slip_m=0.0)
    found = fitted(legs_of(base_of(truth), open_squares(1.0, 1), FLOOR * 1e-6))
    assert [found.wheels.left_m, found.wheels.right_m, found.wheels.track_m] == pytest.approx(
        [0.103, 0.098, 0.49], rel=1e-4
    )
    assert found.mount == pytest.approx(truth.mount, abs=1e-3)


def test_a_leg_that_slipped_is_left_out() -> None:
    truth = drawn_truth(OLD, MOUNT, np.random.default_rng(5))
    legs = legs_of(base_of(truth, 5), open_squares(1.5, 2))
    slipped = legs[4]
    legs[4] = Leg(slipped.angles_rad, compose(slipped.motion, pose(-0.06, 0.0, 0.05)), slipped.covariance)
    found = fitted(legs)
    assert found.outliers == (4,)
    assert found.wheels.track_m == pytest.approx(truth.wheels.track_m, rel=0.005)


def test_legs_that_contradict_each_other_are_refused() -> None:
    legs = legs_of(base_of(drawn_truth(OLD, MOUNT, np.random.default_rng(6)), 6), open_squares(1.5, 1))
    rng = np.random.default_rng(7)
    wild = [Leg(leg.angles_rad, leg.motion + rng.normal(0.0, 0.1, 3), leg.covariance) for leg in legs]
    with pytest.raises(FitError, match="legs contradict the others"):
        fitted(wild)


def test_a_straight_line_says_nothing_certain_about_the_track() -> None:
    legs = legs_of(base_of(drawn_truth(OLD, MOUNT, np.random.default_rng(8)), 8), [Move("drive", 1.5)] * 8)
    with pytest.raises(FitError, match=r"not certain enough: .*track .*Raise --squares or --side"):
        check(fitted(legs), OLD)


def test_one_short_square_is_not_certain_enough() -> None:
    legs = legs_of(base_of(drawn_truth(OLD, MOUNT, np.random.default_rng(9)), 9), open_squares(0.5, 1))
    with pytest.raises(FitError, match="wheel radius left ±"):
        check(fitted(legs), OLD)


def test_a_diameter_for_a_radius_is_no_matter_of_calibration() -> None:
    truth = Truth(Wheels(0.08, 0.08, 0.5), MOUNT)
    with pytest.raises(FitError, match=r"would change from 0.1 to 0.0[78]\d+ m.*canbase setup commission first"):
        check(fitted(legs_of(base_of(truth), open_squares(1.5, 4))), OLD)


def test_in_a_corridor_it_says_so() -> None:
    course = course_of(ROBOT, 1.0, 1)
    drive_course(base_of(Truth(OLD, MOUNT)), course, CORRIDOR)
    with pytest.raises(FitError, match=r"of 16 legs have no match; the first: the room does not fix the pose"):
        result(ROBOT, course)


@pytest.mark.parametrize(("matched", "refused"), [(12, False), (11, True)])
def test_three_quarters_of_the_legs_need_a_match(matched: int, refused: bool) -> None:
    course = course_of(ROBOT, 1.0, 1)
    course.legs = legs_of(base_of(Truth(OLD, MOUNT)), open_squares(1.5, 1))[:matched]
    course.problems = ["too dark"] * (16 - matched)
    if refused:
        with pytest.raises(FitError, match="5 of 16 legs have no match; the first: too dark"):
            course.enough()
    else:
        course.enough()


def test_the_course_turns_left_and_right_in_turn_and_comes_back() -> None:
    course, base = course_of(ROBOT, 1.5, 1), base_of(Truth(OLD, MOUNT, slip_m=0.0))
    reached = corners_of(course, base)
    assert course.moves == len(base.been) == 16
    corners = [[1.5, 0.0], [1.5, 1.5], [0.0, 1.5], [0.0, 0.0], [1.5, 0.0], [1.5, -1.5], [0.0, -1.5], [0.0, 0.0]]
    assert reached == pytest.approx(np.array(corners), abs=0.02)


def test_wheels_that_are_6_percent_apart_do_not_lead_it_off_its_course() -> None:
    """By its odometry alone it would be metres away: 0.12 rad/m of curve over 24 m."""
    truth = Truth(Wheels(0.097, 0.103, 0.485), MOUNT + np.array([0.02, -0.02, 0.015]))
    course, base = course_of(ROBOT, 1.5, 2), base_of(truth)
    reached = corners_of(course, base)
    square = np.array(
        [[1.5, 0.0], [1.5, 1.5], [0.0, 1.5], [0.0, 0.0], [1.5, 0.0], [1.5, -1.5], [0.0, -1.5], [0.0, 0.0]]
    )
    assert np.abs(reached - np.concatenate([square, square])).max() < 0.25


def corners_of(course: Course, base: SimulatedBase) -> Array:
    """Where the base really is after each side, as seen from its start."""
    start = base.at
    drive_course(base, course)
    return np.array([between(start, at)[:2] for at in base.been[::2]])


def test_the_way_of_the_wheels_is_exact_on_an_arc() -> None:
    angles = np.linspace(0.0, 1.0, 50)[:, None] * np.array([[4.0 * math.pi, 6.0 * math.pi]])
    assert rolled(angles, Wheels(0.1, 0.1, 0.4)) == pytest.approx([1.0, 1.0, math.pi / 2.0])


def found_with(truth: Wheels) -> Fit:
    return fitted(legs_of(base_of(Truth(truth, MOUNT)), open_squares(1.5, 4)))


def test_the_new_values_go_into_robot_yaml_with_their_certainty_and_the_comments_stay(tmp_path: Path) -> None:
    found = found_with(Wheels(0.102, 0.1, 0.51))
    edits = geometry_edits(ROBOT, found)
    file = tmp_path / "robot.yaml"
    text = sample("bench").read_text(encoding="utf-8")
    file.write_text(text, encoding="utf-8")
    write_edits(file, edits)
    new = load_robot(file).robot
    assert (new.base.radius_m("left"), new.base.radius_m("right"), new.base.track_m) == pytest.approx(
        (found.wheels.left_m, found.wheels.right_m, found.wheels.track_m), rel=2e-5
    )
    assert (new.odometry.radius_error, new.odometry.track_error) == (0.001, 0.002)
    assert "# --- The wheels under the base." in file.read_text(encoding="utf-8")
    assert (tmp_path / "robot.yaml.before").read_text(encoding="utf-8") == text
    assert mark(new, "floor") != mark(ROBOT, "floor")


def test_a_file_that_would_be_bad_is_left_as_it_was(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text("name: other\n", encoding="utf-8")
    with pytest.raises(ConfigError):
        write_edits(file, geometry_edits(ROBOT, found_with(Wheels(0.102, 0.1, 0.51))))
    assert file.read_text(encoding="utf-8") == "name: other\n"
    assert [each.name for each in tmp_path.iterdir()] == ["robot.yaml"]


def test_what_is_right_already_changes_nothing() -> None:
    robot = with_edits(ROBOT, geometry_edits(ROBOT, found_with(Wheels(0.102, 0.1, 0.51))))
    assert geometry_edits(robot, found_with(Wheels(0.102, 0.1, 0.51))) == []
    assert edited("base: {track_m: 0.5}\n", []) == "base: {track_m: 0.5}\n"


def test_the_lines_have_old_and_new_values_and_how_the_squares_close() -> None:
    found = found_with(Wheels(0.102, 0.1, 0.51))
    told = lines(found, OLD, [])
    assert told[0].startswith("wheel radius left   0.10000 → 0.10")
    assert "64 legs used, 0 left out" in told[4]


def called(*words: str, answer: str = "") -> tuple[int, str]:
    ended = CliRunner().invoke(app, ["setup", "calibrate", *words], input=answer)
    return ended.exit_code, ended.output


def test_a_scanner_whose_pose_comes_from_tf_is_refused_before_anything_open_squares(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    text = sample("bench").read_text(encoding="utf-8")
    file.write_text(
        text.replace(
            "    required: false               # true: nothing moves without a laser",
            "    required: false\n    pose: tf # ",
        )
    )
    code, output = called(str(file))
    assert code == 2
    assert "safety.scan.pose is tf" in output


def test_without_a_yes_nothing_open_squares() -> None:
    code, output = called(str(sample("bench")), "--side", "2", answer="n\n")
    assert code == 1
    assert "2 m ahead, to the left and to the right" in output
