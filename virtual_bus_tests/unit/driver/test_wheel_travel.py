"""From raw 32-bit positions to travel: unwrapping, the first sample, power cycles, and jumps that are no motion."""

import math
from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_driver.motion.odometry import WheelTravel, unwrap

property_of_all = settings(deadline=None)
I32_MIN, I32_MAX = -(2**31), 2**31 - 1
MM = 0.001
"""One count is one millimetre of rim in these tests, and 20 counts a cycle are possible."""


def wheel(*raw: int) -> WheelTravel:
    """A wheel that has seen these samples, one a cycle."""
    travel = WheelTravel(MM, 20)
    for sample in raw:
        travel.update(sample)
    return travel


# Unwrapping


@pytest.mark.parametrize(
    ("previous", "raw", "difference"),
    [
        (0, 0, 0),
        (0, 1, 1),
        (0, -1, -1),
        (I32_MAX, I32_MIN, 1),
        (I32_MIN, I32_MAX, -1),
        (I32_MAX - 2, I32_MIN + 2, 5),
        (I32_MIN + 2, I32_MAX - 2, -5),
        (0xFFFF_FFFF, 0, 1),  # the same bits given as u32
        (0, 0xFFFF_FFFF, -1),
        (-1, 0xFFFF_FFFF, 0),
        (0, I32_MAX, I32_MAX),
        (0, I32_MIN, I32_MIN),
        (I32_MAX, -1, I32_MIN),
    ],
)
def test_the_difference_is_the_shorter_way_round(previous: int, raw: int, difference: int) -> None:
    assert unwrap(previous, raw) == difference


@property_of_all
@given(st.integers(I32_MIN, I32_MAX), st.integers(I32_MIN, I32_MAX))
def test_a_step_of_half_the_range_or_less_is_found_again(start: int, step: int) -> None:
    wrapped = (start + step - I32_MIN) % 2**32 + I32_MIN
    assert unwrap(start, wrapped) == step


# Travel of one wheel


def test_before_the_first_sample_there_is_no_reference_and_no_travel() -> None:
    assert not wheel().referenced
    assert wheel().travel_m == 0.0


@pytest.mark.parametrize("first", [0, 1, -1, 123_456, I32_MAX, I32_MIN])
def test_the_first_sample_is_an_offset_wherever_it_is(first: int) -> None:
    travel = WheelTravel(MM, 20)
    assert travel.update(first) == 0.0
    assert travel.referenced
    assert travel.update(first + 20) == pytest.approx(0.020)
    assert travel.referenced


@pytest.mark.parametrize("direction", [1, -1])
def test_a_wheel_rolls_over_the_end_of_the_counter_and_back(direction: int) -> None:
    near_the_end = I32_MAX - 25
    there = [(near_the_end + direction * 10 * k - I32_MIN) % 2**32 + I32_MIN for k in range(8)]
    assert wheel(*there).travel_m == pytest.approx(direction * 0.070)
    assert wheel(*there, *reversed(there)).travel_m == 0.0
    assert wheel(*there, *reversed(there)).referenced


def test_a_mirrored_axis_counts_down_while_the_wheel_rolls_forward() -> None:
    travel = WheelTravel(-MM, 20)
    travel.update(0)
    assert travel.update(-10) == pytest.approx(0.010)


def test_after_a_power_cycle_the_travel_goes_on_from_where_it_was() -> None:
    travel = wheel(5_000, 5_010, 5_020)
    travel.reset_reference()
    assert not travel.referenced
    assert travel.update(0) == pytest.approx(0.020)  # the drive counts from 0 again
    assert travel.update(-5) == pytest.approx(0.015)
    assert (travel.referenced, travel.losses) == (True, 1)  # what it rolled meanwhile is unknown
    travel.reset_reference()
    travel.reset_reference()
    assert travel.losses == 2


@pytest.mark.parametrize(("step", "taken"), [(20, True), (21, False), (-20, True), (-21, False), (2**31 - 1, False)])
def test_a_step_beyond_what_the_wheel_can_do_is_dropped(step: int, taken: bool) -> None:
    travel = wheel(100, 100 + step)
    assert travel.referenced is taken
    assert travel.travel_m == pytest.approx({True: step * MM, False: 0.0}[taken])


def test_missed_cycles_allow_a_longer_step() -> None:
    travel = wheel(0)
    assert travel.update(60, cycles=3) == pytest.approx(0.060)
    assert travel.update(121, cycles=3) == pytest.approx(0.060)
    assert not travel.referenced


def test_one_wild_sample_costs_nothing_when_the_next_one_comes_back() -> None:
    travel = wheel(0, 10, 70_000, 30, 40)
    assert travel.travel_m == pytest.approx(0.040)
    assert (travel.referenced, travel.losses) == (True, 0)


@pytest.mark.parametrize("jump", [21, 41, 50, 61, -61, 1_000_000, 2**31 - 1])
def test_a_counter_that_has_moved_for_good_becomes_the_new_reference_at_the_third_sample(jump: int) -> None:
    travel = wheel(0, 10, 10 + jump)
    assert travel.update(10 + jump) == pytest.approx(0.010)
    assert not travel.referenced
    assert travel.update(10 + jump + 5) == pytest.approx(0.010)
    assert travel.referenced
    assert travel.losses == 1
    assert travel.update(10 + jump + 10) == pytest.approx(0.015)


COUNTER = 400
"""A counter of so many counts, seen at 15 counts a cycle: a jump is accepted at its third sample."""


@pytest.mark.parametrize(
    ("counts", "wraps_by"),
    [
        (range(0, 2 * COUNTER - 30, 15), 0),  # one jump may be anything
        (range(0, 2 * COUNTER + 60, 15), 355),
        (range(0, -2 * COUNTER - 60, -15), 355),
        ((*range(0, 450, 15), *range(450, 0, -15)), 0),  # there and back over the place where it wraps
    ],
)
def test_two_jumps_by_the_same_way_are_those_of_a_counter_that_wraps(counts: Iterable[int], wraps_by: int) -> None:
    travel = wheel(*(count % COUNTER for count in counts))
    assert travel.wraps_by == pytest.approx(wraps_by, abs=10)
    travel.forget_jumps()
    assert travel.wraps_by == 0


@pytest.mark.parametrize(("jumps", "wraps"), [((200, 200), True), ((200, 260), True), ((200, 265), False)])
def test_jumps_are_alike_within_what_the_wheel_can_have_done_meanwhile(jumps: tuple[int, int], wraps: bool) -> None:
    first, both = jumps[0], sum(jumps)
    assert bool(wheel(0, *(first,) * 4, *(both,) * 3).wraps_by) is wraps


@pytest.mark.parametrize(("jump", "wraps"), [(120, False), (121, True)])
def test_jumps_that_are_hardly_any_are_no_wrap(jump: int, wraps: bool) -> None:
    assert bool(wheel(0, *(jump,) * 4, *(2 * jump,) * 3).wraps_by) is wraps


def test_a_jump_of_another_life_of_the_drive_counts_no_more() -> None:
    travel = wheel(0, *(200,) * 4)
    travel.reset_reference()
    for raw in (0, *(200,) * 3):
        travel.update(raw)
    assert (travel.losses, travel.wraps_by) == (3, 0)


@pytest.mark.parametrize(("cycles", "travel_m", "losses"), [(10, 0.020, 1), (11, 0.010, 2), (6000, 0.010, 2)])
def test_a_place_that_a_counter_jumped_to_is_not_believed_over_a_silence(
    cycles: int, travel_m: float, losses: int
) -> None:
    """Another drive with this node id may have told it, and was the only one that spoke."""
    travel = wheel(0, 10, 500, 500, 500)
    assert travel.update(510, cycles) == pytest.approx(travel_m)
    assert (travel.losses, travel.referenced) == (losses, True)
    assert travel.update(515) == pytest.approx(travel_m + 0.005)


def test_a_place_that_it_rolled_to_is_believed_over_a_silence() -> None:
    travel = wheel(0, 10)
    assert travel.update(500, 60) == pytest.approx(0.500)
    assert travel.losses == 0
    doubted = wheel(0, 10, 500, 500, 500)
    doubted.reset_reference()  # its drive was booted anew
    doubted.update(0)
    assert doubted.update(490, 60) == pytest.approx(0.500)


def test_samples_that_are_all_over_the_place_never_become_a_reference() -> None:
    travel = wheel(0, *(sign * k * 1_000_000 for k in range(1, 40) for sign in (1, -1)))
    assert travel.travel_m == 0.0
    assert (travel.referenced, travel.losses) == (False, 0)


@property_of_all
@given(st.lists(st.integers(I32_MIN, I32_MAX), max_size=30))
def test_whatever_the_bus_says_no_cycle_adds_more_travel_than_the_wheel_can_do(samples: list[int]) -> None:
    travel, cycles_since_taken = WheelTravel(MM, 20), 0
    travel.update(0)
    for sample in samples:
        before = travel.travel_m
        cycles_since_taken += 1
        travel.update(sample)
        assert abs(travel.travel_m - before) <= 20 * MM * cycles_since_taken + 1e-12
        cycles_since_taken *= not travel.referenced


@pytest.mark.parametrize("max_step", [0, -1, 2**31, math.nan])
def test_a_greatest_step_that_cannot_tell_a_jump_from_a_wrap_is_refused(max_step: float) -> None:
    with pytest.raises(ValueError, match="max_step_counts"):
        WheelTravel(MM, max_step)


@pytest.mark.parametrize("scale", [0.0, math.nan, math.inf])
def test_a_count_that_is_no_length_is_refused(scale: float) -> None:
    with pytest.raises(ValueError, match="metres_per_count"):
        WheelTravel(scale, 20)


def test_two_samples_of_one_cycle_are_a_mistake_of_the_caller() -> None:
    with pytest.raises(ValueError, match="at least one cycle"):
        wheel(0).update(1, cycles=0)
