"""A base that drives at a wall 2 m ahead while its scanner lies: blind, partly blind, frozen, mirrored, too large.

Footprint 0.3 m to all sides, 0.8 m/s at most, stop distance 0.15 m, blind_mps 0.15 m/s, 10 scans a second. The scanner
is sound for 0.5 s; then it lies, and the base has 1.3 m to go at the most.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from canbase_campaign.lidar import (
    ByTurns,
    Fault,
    Frozen,
    FrozenPart,
    Lidar,
    TwoOnOneTopic,
    blind,
    far_from,
    one_beam_left,
)
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.clearance import ScanReader
from canbase_velocity.frozen import FrozenWatch
from canbase_velocity.placement import Placement
from canbase_velocity.scan import MAX_READINGS, Scan, ScanError, check
from canbase_velocity.sweep import Floats, fastest_mps
from canbase_velocity.twist import ZERO, Twist
from support.filter_world import FilterWorld, robot_with

WALL = np.array([(2.0, y_m / 20.0) for y_m in range(-20, 21)] + [(-3.0, 0.5)])
AHEAD = Twist(0.8, 0.0)
INF, NAN = math.inf, math.nan


def world(blind_mps: float = 0.15, **scan: object) -> FilterWorld:
    made = FilterWorld(robot_with(blind_mps=blind_mps, scan={"required": True, **scan}), WALL)
    made.lidar = Lidar()
    return made


def lies(made: FilterWorld, fault: Fault, duration_s: float = 6.0) -> tuple[float, set[StopCause], float]:
    """The smallest gap, the causes, and the fastest order in the second half of the time."""
    made.run(AHEAD, 0.5)
    made.fault = fault
    least_m, causes, fastest = made.gap_m, set(), 0.0
    for step in range(round(duration_s / 0.02)):
        least_m = min(least_m, made.run(AHEAD, 0.02))
        assert made.decision is not None
        causes.add(made.decision.cause)
        if step > duration_s / 0.04:
            fastest = max(fastest, fastest_mps(made.box, made.decision.twist))
    return least_m, causes, fastest


def test_a_sound_scanner_lets_the_base_come_to_the_stop_distance_and_no_further() -> None:
    least_m, causes, _ = lies(world(), lambda scan: scan)
    assert 0.12 < least_m < 0.2
    assert causes == {StopCause.NONE, StopCause.OBSTACLE_NEAR, StopCause.OBSTACLE}


@pytest.mark.parametrize(
    "fault",
    [
        one_beam_left,
        blind(NAN, 0.5),
        blind(0.0, 0.5),
        blind(0.04, 0.5),
        blind(-1.0, 0.5),
        blind(NAN, 0.2),
        blind(NAN, 0.05, 0.12),  # a part of the corridor, left of the middle
    ],
)
def test_where_the_beams_say_nothing_the_base_creeps_or_does_not_go_at_all(fault: Fault) -> None:
    """Blind for the wall 1.5 m ahead it goes no faster than blind_mps; with 0 it is not touched."""
    least_m, causes, fastest = lies(world(), fault)
    assert StopCause.SCAN_BLIND in causes
    assert fastest <= 0.15 + 1e-9
    least_m, causes, fastest = lies(world(blind_mps=0.0), fault)
    assert least_m > 0.5
    assert fastest == 0.0


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        (blind(NAN), StopCause.SCAN_INVALID),
        (blind(0.0), StopCause.SCAN_INVALID),
        (Frozen(new_stamps=True), StopCause.SCAN_FROZEN),
        (Frozen(new_stamps=False), StopCause.SCAN_FROZEN),
        (FrozenPart(0.2), StopCause.SCAN_FROZEN),
        (FrozenPart(0.1), StopCause.SCAN_FROZEN),
        (ByTurns(2, new_stamps=True), StopCause.SCAN_FROZEN),
        (ByTurns(2, new_stamps=False), StopCause.SCAN_FROZEN),
        (ByTurns(5, new_stamps=True), StopCause.SCAN_FROZEN),
        (lambda scan: dataclasses.replace(scan, angle_increment_rad=-scan.angle_increment_rad), StopCause.SCAN_INVALID),
        (
            lambda scan: dataclasses.replace(
                scan,
                angle_min_rad=scan.angle_max_rad or 0.0,
                angle_max_rad=scan.angle_min_rad,
                angle_increment_rad=-scan.angle_increment_rad,
            ),
            StopCause.SCAN_INVALID,  # counts the other way round all of a sudden: its readings are mirrored
        ),
        (lambda scan: dataclasses.replace(scan, angle_min_rad=3.0, angle_max_rad=-3.0), StopCause.SCAN_INVALID),
        (lambda scan: dataclasses.replace(scan, ranges_m=np.full(180, INF)), StopCause.SCAN_INVALID),
        (lambda scan: dataclasses.replace(scan, angle_min_rad=NAN), StopCause.SCAN_INVALID),
        (lambda scan: dataclasses.replace(scan, angle_max_rad=INF), StopCause.SCAN_INVALID),
        (lambda scan: dataclasses.replace(scan, ranges_m=np.full(MAX_READINGS + 1, INF)), StopCause.SCAN_INVALID),
        (lambda scan: dataclasses.replace(scan, ranges_m=[]), StopCause.SCAN_INVALID),
    ],
)
def test_a_scan_that_says_nothing_or_cannot_be_right_stops_the_base_before_the_wall(
    fault: Fault, cause: StopCause
) -> None:
    made = world()
    least_m, causes, fastest = lies(made, fault)
    assert least_m > 0.14
    assert fastest == 0.0
    assert cause in causes
    (scanner,) = made.filter.inputs(made.now_s).scans
    assert scanner.dropped > 0
    assert scanner.why_dropped


def test_a_frozen_scanner_is_noticed_after_frozen_s_and_the_base_drives_on_when_it_wakes() -> None:
    made = world()
    made.run(AHEAD, 0.5)
    made.fault = Frozen(new_stamps=True)
    made.run(AHEAD, 0.7)
    assert made.decision is not None
    assert (made.decision.cause, made.decision.twist) == (StopCause.SCAN_FROZEN, ZERO)
    assert "the same 360 readings for" in made.decision.detail
    made.fault = lambda scan: scan
    made.run(AHEAD, 0.2)
    assert made.decision.cause in (StopCause.NONE, StopCause.OBSTACLE_NEAR)


def cause_of(made: FilterWorld) -> StopCause:
    assert made.decision is not None
    return made.decision.cause


def test_a_simulator_without_noise_starts_from_standstill_and_is_frozen_only_while_the_base_moves() -> None:
    made = world(noisy=False)
    made.lidar = Lidar(noise_m=0.0)
    made.run(ZERO, 3.0)
    made.run(AHEAD, 0.5)
    assert cause_of(made) is StopCause.NONE
    made.fault = Frozen(new_stamps=True)
    assert made.run(AHEAD, 6.0) > 0.14
    assert cause_of(made) is StopCause.SCAN_FROZEN
    strict = world()
    strict.lidar = Lidar(noise_m=0.0)
    strict.run(ZERO, 3.0)
    assert strict.decision is not None
    strict.run(AHEAD, 0.5)
    assert strict.decision.cause is StopCause.SCAN_FROZEN


def test_in_an_empty_hall_equal_scans_are_no_sign_of_a_frozen_scanner_unless_it_may_not_be_empty() -> None:
    """Nothing in range for 5 s: free. A scanner that always sees a part of its robot can rule that out."""
    made = world()
    made.obstacles = np.empty((0, 2))
    made.run(AHEAD, 5.0)
    assert made.decision is not None
    assert made.decision.cause is StopCause.NONE
    strict = world(allow_empty=False)
    strict.obstacles = np.empty((0, 2))
    strict.run(AHEAD, 1.0)
    assert strict.decision is not None
    assert strict.decision.cause is StopCause.SCAN_INVALID
    assert "allow_empty" in strict.decision.detail


def test_readings_below_range_min_are_obstacles_where_the_scanner_means_them_so() -> None:
    """Something is put right before the scanner: 0 ahead. By default such beams say nothing."""
    for meant, cause in (("invalid", StopCause.SCAN_BLIND), ("too_near", StopCause.OBSTACLE)):
        made = world(below_range_min=meant, blind_mps=0.15)
        _, causes, _ = lies(made, blind(0.0, 0.2), 1.0)
        assert cause in causes, meant


def test_single_beams_that_say_nothing_do_not_hold_up_the_base() -> None:
    """Every tenth reading is NaN: black or shiny things, sunlight."""

    def fault(scan: Scan) -> Scan:
        ranges_m = np.array(scan.ranges_m)
        ranges_m[::10] = np.nan
        return dataclasses.replace(scan, ranges_m=ranges_m)

    least_m, causes, _ = lies(world(), fault)
    assert causes == {StopCause.NONE, StopCause.OBSTACLE_NEAR, StopCause.OBSTACLE}
    assert 0.12 < least_m < 0.2


def test_a_scanner_whose_reach_is_shorter_than_the_way_to_stop_lets_the_base_creep() -> None:
    """Ahead 0.8 m are needed at 0.8 m/s; a range_max of 0.5 m shows 0.2 m of them."""

    def fault(scan: Scan) -> Scan:
        return dataclasses.replace(scan, range_max_m=0.5)

    _, causes, fastest = lies(world(), fault, 2.0)
    assert StopCause.BLIND in causes
    assert fastest <= 0.15 + 1e-9


def test_a_huge_scan_is_thinned_out_to_the_nearest_of_neighbours() -> None:
    made = world()

    def fine(scan: Scan) -> Scan:
        ranges_m = np.repeat(np.asarray(scan.ranges_m), 250)
        step_rad = scan.angle_increment_rad / 250
        return dataclasses.replace(
            scan,
            ranges_m=ranges_m,
            angle_increment_rad=step_rad,
            angle_max_rad=scan.angle_min_rad + step_rad * (ranges_m.size - 1),
        )

    made.fault = fine
    least_m, causes, _ = lies(made, fine)
    assert causes == {StopCause.NONE, StopCause.OBSTACLE_NEAR, StopCause.OBSTACLE}
    assert 0.12 < least_m < 0.2


def test_a_scanner_that_keeps_its_stamp_is_frozen_though_its_readings_change() -> None:
    least_m, causes, fastest = lies(world(), lambda scan: dataclasses.replace(scan, stamp_ns=7))
    assert StopCause.SCAN_FROZEN in causes
    assert least_m > 0.14
    assert fastest == 0.0


def test_until_frozen_s_is_over_equal_readings_are_taken_for_as_old_as_they_are() -> None:
    """With 10 s of patience: the base counts its own way since the readings were new, and does not touch the wall."""
    least_m, causes, _ = lies(world(frozen_s=10.0), Frozen(new_stamps=True))
    assert StopCause.SCAN_FROZEN not in causes
    assert least_m > 0.1


def test_a_scan_of_more_than_the_most_readings_is_dropped_though_its_angles_fit() -> None:
    step_rad = 2.0 * math.pi / (MAX_READINGS + 1)
    check(Scan(np.full(MAX_READINGS, INF), 0.0, step_rad, 0.05, 10.0))
    with pytest.raises(ScanError, match="readings, at most"):
        check(Scan(np.full(MAX_READINGS + 1, INF), 0.0, step_rad, 0.05, 10.0))


def test_of_neighbours_that_are_taken_together_the_nearest_counts_where_it_is() -> None:
    """2880 readings, two together: one of 1 m beside one of 3 m, ahead of the scanner."""
    ranges_m = np.full(2880, INF)
    ranges_m[1440], ranges_m[1441] = 3.0, 1.0
    step_rad = 2.0 * math.pi / 2880
    scanner = robot_with().safety.scan
    view = ScanReader(scanner).read(Scan(ranges_m, -math.pi, step_rad, 0.05, 10.0), Placement.of(scanner))
    assert view.points.at_m == pytest.approx(np.array([[math.cos(step_rad), math.sin(step_rad)]]))


@pytest.mark.parametrize("range_min_m", [0.3, 0.48, 0.6, 0.8])
@pytest.mark.parametrize("reading_m", [-INF, 0.0])
def test_what_is_too_near_to_be_measured_is_not_touched(range_min_m: float, reading_m: float) -> None:
    """Footprint 0.3 m: the wall may come nearer than range_min, and then says nothing but that it is too near."""
    least_m, _, fastest = lies(world(below_range_min="too_near"), far_from(range_min_m, reading_m), 20.0)
    assert least_m > 0.15
    assert fastest == 0.0


def test_from_what_is_too_near_the_base_drives_away() -> None:
    made = world()
    lies(made, far_from(0.6), 14.0)
    stood_m = made.path_m
    made.run(Twist(-0.3, 0.0), 3.0)
    assert made.path_m > stood_m + 0.3


def test_one_reading_in_range_may_come_again_by_chance_and_many_may_not() -> None:
    """Three readings by turns, as of a single far pole in millimetres; then the same of a wall."""
    for beams, frozen in ((1, False), (7, False), (8, True), (360, True)):
        watch, told = FrozenWatch(0.5, noisy=True), ""
        for number in range(40):
            ranges_m = np.full(360, np.inf)
            ranges_m[:beams] = 4.0 + 0.001 * (number % 3)
            scan = Scan(ranges_m, -math.pi, math.tau / 360, 0.05, 10.0)
            told = told or watch.check_scan(scan, 0.05 * number, moves=False)
        assert bool(told) is frozen
        assert not frozen or told.endswith("3 scans by turns")


def part_of(
    frozen: range,
    seconds: float = 3.0,
    *,
    moves: bool = True,
    noisy: bool = True,
    old_m: float = 4.0,
    noise_m: float = 0.002,
    step_m: float = 0.001,
    unread: tuple[int, ...] = (),
) -> str:
    """What is found in 360 readings of a wall 4 m away in steps of `step_m`, of which `frozen` are always `old_m`."""
    watch, told, random = FrozenWatch(0.5, noisy=noisy), "", np.random.default_rng(7)
    for number in range(round(seconds * 20)):
        ranges_m = np.round((4.0 + random.normal(0.0, noise_m, 360)) / step_m) * step_m
        ranges_m[[beam % 360 for beam in frozen]] = old_m
        ranges_m[list(unread)] = NAN
        scan = Scan(ranges_m, -math.pi, math.tau / 360, 0.05, 10.0)
        told = told or watch.check_scan(scan, 0.05 * number, moves=moves)
    return told


@pytest.mark.parametrize("frozen", [range(30), range(100, 130), range(345, 375), range(330, 360)])
def test_a_twelfth_that_is_frozen_while_the_base_moves_is_found_wherever_it_is(frozen: range) -> None:
    assert part_of(frozen) == "30 of its 360 readings, beside each other, the same for 0.5 s of motion"
    assert part_of(frozen, seconds=0.4) == ""  # not yet
    assert part_of(frozen[1:]) == ""  # less than a twelfth
    assert part_of(frozen, moves=False) == ""


def test_a_reading_that_is_missing_from_the_first_scan_on_splits_no_frozen_part() -> None:
    assert part_of(range(100, 131), unread=(110,)).startswith("30 of its 360 readings, beside each other")


@pytest.mark.parametrize("old_m", [INF, NAN, 10.0, 0.05, 0.0])
def test_a_part_without_measurements_is_not_frozen(old_m: float) -> None:
    assert part_of(range(90), old_m=old_m) == ""


def test_equal_readings_by_chance_of_a_coarse_scanner_or_without_noise_are_no_frozen_part() -> None:
    assert part_of(range(0), 60.0, noise_m=0.003, step_m=0.01) == ""
    assert part_of(range(180), noisy=False) == ""


@pytest.mark.parametrize("command", [Twist(0.0, 5e-324), Twist(5e-324, 0.0), Twist(-5e-324, -5e-324)])
def test_the_smallest_numbers_that_there_are_do_not_end_the_filter_where_no_scanner_looks(command: Twist) -> None:
    made = world()
    made.fault = blind(NAN, 0.5)
    made.run(ZERO, 0.5)
    made.run(command, 0.5)
    made.fault = lambda scan: dataclasses.replace(scan, angle_increment_rad=1e-17, angle_max_rad=None)
    made.run(command, 0.5)
    assert made.path_m < 1e-9


def test_two_scanners_on_one_topic_stop_the_base_until_the_next_start() -> None:
    """Taken for one, they would show the wall in every second scan: the base would touch it."""
    made = world()
    made.lidar = Framed()
    least_m, causes, fastest = lies(made, TwoOnOneTopic(), 20.0)
    assert least_m > 0.9
    assert StopCause.SCAN_INVALID in causes
    assert fastest == 0.0
    assert made.decision is not None
    assert "scans of laser_front and of laser_rear come on one topic" in made.decision.detail
    made.fault = lambda scan: scan
    assert made.run(AHEAD, 3.0) > 0.9
    assert made.decision.cause is StopCause.SCAN_INVALID


# sound for 0.5 s ── the only scanner ends: with one of two that ended, too, the base would creep on its side
def test_when_the_last_scanner_ends_that_is_not_required_the_base_creeps() -> None:
    made = FilterWorld(robot_with(scan={"required": False}), WALL)
    made.lidar = Lidar()
    made.run(AHEAD, 0.5)
    made.scans = False
    assert made.run(AHEAD, 6.0) > 0.1
    assert made.decision is not None
    assert cause_of(made) is StopCause.BLIND
    assert fastest_mps(made.box, made.decision.twist) <= 0.15 + 1e-9
    made.scans = True
    made.run(Twist(-0.3, 0.0), 0.5)
    assert cause_of(made) is StopCause.NONE


class Framed(Lidar):
    def scan(self, obstacles: Floats) -> Scan:
        return dataclasses.replace(super().scan(obstacles), frame="laser_front")
