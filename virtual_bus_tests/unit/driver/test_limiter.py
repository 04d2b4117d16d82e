"""The limits, as drives with times on them; numbers dense at the limits."""

import math
from itertools import pairwise, product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_driver.motion.kinematics import Twist2D, wheel_speeds
from canbase_driver.motion.limiter import LONGEST_RAMP_STEP_S, Limiter, MotionState
from support.limit_drives import DT_S, LIMITER, LIMITS, NO_JERK, TRACK_M, drive, linear, property_of_all, steps_until

# Speed limits


@pytest.mark.parametrize(
    ("target", "limited"),
    [
        (Twist2D(1.0, 0.0), Twist2D(1.0, 0.0)),
        (Twist2D(-1.0, 0.0), Twist2D(-1.0, 0.0)),
        (Twist2D(1.0 + 1e-9, 0.0), Twist2D(1.0, 0.0)),
        (Twist2D(-30.0, 0.0), Twist2D(-1.0, 0.0)),
        (Twist2D(0.0, 2.0), Twist2D(0.0, 2.0)),
        (Twist2D(0.0, -2.0 - 1e-9), Twist2D(0.0, -2.0)),
        (Twist2D(0.1, 4.0), Twist2D(0.05, 2.0)),  # half as fast on the same circle
        (Twist2D(0.8, 1.0), Twist2D(0.8, 1.0)),  # the outer wheel at 0.8 + 1.0 × 0.2 = 1.0 m/s
        (Twist2D(1.6, 2.0), Twist2D(0.8, 1.0)),
        (Twist2D(1.0, 2.0), Twist2D(1.0 / 1.4, 2.0 / 1.4)),  # within both, but the outer wheel would run at 1.4 m/s
        (Twist2D.ZERO, Twist2D.ZERO),
    ],
)
def test_a_fast_target_is_scaled_as_a_whole(target: Twist2D, limited: Twist2D) -> None:
    got = LIMITER.limit(target)
    assert (got.linear_mps, got.angular_radps) == pytest.approx((limited.linear_mps, limited.angular_radps), rel=1e-12)


def test_a_wheel_may_run_as_fast_as_straight_on_or_a_turn_in_place_needs() -> None:
    assert Limiter(LIMITS, 0.4).wheel_mps == 1.0
    assert Limiter(LIMITS, 1.0).wheel_mps == 1.0
    assert Limiter(LIMITS, 1.5).wheel_mps == 1.5
    assert Limiter(LIMITS, 1.5).limit(Twist2D(0.0, 2.0)) == Twist2D(0.0, 2.0)
    slow = Limiter(LIMITS.model_copy(update={"linear_mps": 0.5}), 1.5)
    assert slow.limit(Twist2D(1.4, 0.0)) == Twist2D(0.5, 0.0)  # the base, though the wheels may run at 1.5 m/s


@property_of_all
@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False))
def test_no_target_gets_beyond_a_speed_limit_or_onto_another_circle(linear_mps: float, angular_radps: float) -> None:
    got = LIMITER.limit(Twist2D(linear_mps, angular_radps))
    assert abs(got.linear_mps) <= 1.0
    assert abs(got.angular_radps) <= 2.0
    assert max(map(abs, wheel_speeds(got, TRACK_M))) <= LIMITER.wheel_mps * (1.0 + 1e-12)
    scale = max(abs(linear_mps), abs(angular_radps), 1.0)
    assert got.linear_mps * (angular_radps / scale) == pytest.approx(
        got.angular_radps * (linear_mps / scale), rel=1e-9, abs=1e-300
    )


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused_and_nothing_else_is_done(bad: float) -> None:
    for twist in (Twist2D(bad, 0.0), Twist2D(0.0, bad)):
        with pytest.raises(ValueError, match="must be finite"):
            LIMITER.limit(twist)
        with pytest.raises(ValueError, match="must be finite"):
            LIMITER.step(MotionState.AT_REST, twist, DT_S)
        with pytest.raises(ValueError, match="current motion"):
            LIMITER.step(MotionState(twist), Twist2D.ZERO, DT_S)
    with pytest.raises(ValueError, match="current motion"):
        LIMITER.step(MotionState(Twist2D.ZERO, bad), Twist2D.ZERO, DT_S)
    with pytest.raises(ValueError, match="time step"):
        LIMITER.step(MotionState.AT_REST, Twist2D.ZERO, bad)


# Time steps


def test_no_time_changes_nothing_and_time_does_not_run_backwards() -> None:
    state = MotionState(Twist2D(0.3, 0.1), 0.2)
    assert LIMITER.step(state, Twist2D(1.0, 0.0), 0.0) is state
    with pytest.raises(ValueError, match="not negative"):
        LIMITER.step(state, Twist2D.ZERO, -1e-9)


def test_a_cycle_that_comes_a_second_late_is_a_step_of_a_tenth() -> None:
    start = MotionState(Twist2D(0.2, 0.0))
    assert LIMITER.step(start, Twist2D(1.0, 0.0), 1.0) == LIMITER.step(start, Twist2D(1.0, 0.0), LONGEST_RAMP_STEP_S)


@property_of_all
@given(st.lists(st.floats(1e-4, 0.1), min_size=1, max_size=8))
def test_the_ramp_depends_on_the_time_and_not_on_how_it_was_cut(cuts_s: list[float]) -> None:
    irregular, regular = MotionState.AT_REST, MotionState.AT_REST
    for cut_s in cuts_s:
        irregular = LIMITER.step(irregular, Twist2D(0.9, 0.2), cut_s)
        for _ in range(10):
            regular = LIMITER.step(regular, Twist2D(0.9, 0.2), cut_s / 10.0)
    assert irregular.twist.linear_mps == pytest.approx(regular.twist.linear_mps, abs=1e-12)
    assert irregular.acceleration_mps2 == pytest.approx(regular.acceleration_mps2, abs=1e-9)


# Acceleration and deceleration


@pytest.mark.parametrize(
    ("start", "target", "seconds"),
    [
        (Twist2D.ZERO, Twist2D(1.0, 0.0), 2.0),  # 1.0 / 0.5
        (Twist2D.ZERO, Twist2D(-1.0, 0.0), 2.0),
        (Twist2D(1.0, 0.0), Twist2D.ZERO, 1.0),  # 1.0 / 1.0
        (Twist2D(-1.0, 0.0), Twist2D(-0.5, 0.0), 0.5),
        (Twist2D(-0.5, 0.0), Twist2D(-1.0, 0.0), 1.0),
        (Twist2D.ZERO, Twist2D(0.0, 2.0), 1.0),  # 2.0 / 2.0
        (Twist2D(0.0, -2.0), Twist2D.ZERO, 0.5),  # 2.0 / 4.0
        (Twist2D(0.0, 1.0), Twist2D(0.0, -1.0), 0.75),  # a turn brakes first: 1.0 / 4.0 + 1.0 / 2.0
        (Twist2D(0.5, 1.0), Twist2D(0.5, -1.0), 0.75),
        (Twist2D(0.1, 2.0), Twist2D(0.0, -2.0), 1.5),  # beside the brake too: 0.1 / 1.0 + 1.6 / 4.0 + 2.0 / 2.0
        (Twist2D(0.1, 0.5), Twist2D(0.2, -0.3), 0.4),  # not beside an acceleration: 0.8 / 2.0
        (Twist2D.ZERO, Twist2D(0.1, 1.0), 0.5),  # the turn is the slower one: 1.0 / 2.0 against 0.1 / 0.5
        (Twist2D(0.1, 2.0), Twist2D.ZERO, 0.5),  # 2.0 / 4.0 against 0.1 / 1.0
    ],
)
def test_how_long_a_ramp_takes(start: Twist2D, target: Twist2D, seconds: float) -> None:
    steps = round(seconds / DT_S)
    before = drive(NO_JERK, MotionState(start), target, seconds)[-2].twist
    assert before != target
    assert steps_until(NO_JERK, MotionState(start), target, steps + 10) in (steps, steps + 1)


def test_a_reversal_brakes_to_an_exact_zero_and_accelerates_from_there() -> None:
    speeds = linear(drive(LIMITER, MotionState(Twist2D(0.4, 0.2)), Twist2D(-0.4, 0.2), 2.0))
    zero = speeds.index(0.0)
    assert zero == 50  # 0.4 / 1.0 s and 1.0 / 10.0 s for the jerk
    assert speeds.index(-0.4) == zero + 85  # 0.4 / 0.5 s and 0.5 / 10.0 s
    assert all(speed > 0.0 for speed in speeds[:zero])
    assert all(speed < 0.0 for speed in speeds[zero + 1 :])
    assert speeds[-1] == -0.4


def test_a_reversal_goes_through_zero_where_the_straight_line_does() -> None:
    states = drive(LIMITER, MotionState(Twist2D(0.4, 0.2)), Twist2D(-0.2, 0.8), 2.0)
    at_zero = states[linear(states).index(0.0)].twist
    assert at_zero.angular_radps == pytest.approx(0.6)  # 0.2 + 0.6 × 0.4 / 0.6


def test_a_robot_that_brakes_gently_still_starts_briskly() -> None:
    gentle = {"deceleration_mps2": 0.25, "angular_deceleration_radps2": 1.0}
    limiter = Limiter(NO_JERK.limits.model_copy(update=gentle), TRACK_M)
    first = limiter.step(MotionState.AT_REST, Twist2D(0.5, 1.0), DT_S).twist
    assert (first.linear_mps, first.angular_radps) == pytest.approx((0.005, 0.01))  # 0.5 m/s² × 10 ms
    assert steps_until(limiter, MotionState.AT_REST, Twist2D(0.5, 0.0), 200) in (100, 101)
    assert steps_until(limiter, MotionState(Twist2D(0.5, 0.0)), Twist2D.ZERO, 300) in (200, 201)
    assert steps_until(limiter, MotionState.AT_REST, Twist2D(0.0, 1.0), 200) in (50, 51)
    assert steps_until(limiter, MotionState(Twist2D(0.0, 1.0)), Twist2D(0.0, -1.0), 300) in (
        150,
        151,
    )  # 1.0 s and 0.5 s


@pytest.mark.parametrize("share", [0.9, 0.99, 0.999, 1.0 - 1e-9, 1.0])
def test_a_ramp_that_ends_within_a_step_ends_at_the_target(share: float) -> None:
    turning, rolling = MotionState(Twist2D(0.0, 0.04 * share)), MotionState(Twist2D(0.02 * share, 0.0))
    assert LIMITER.step(turning, Twist2D.ZERO, DT_S) == MotionState.AT_REST  # 4.0 rad/s² × 10 ms
    assert LIMITER.step(rolling, Twist2D.ZERO, DT_S, emergency=True) == MotionState.AT_REST  # 2.0 m/s² × 10 ms


def test_braking_does_not_wait_for_a_turn_that_grows() -> None:
    states = drive(NO_JERK, MotionState(Twist2D(0.5, 0.0)), Twist2D(0.0, 2.0), 1.2)
    assert linear(states)[51] == 0.0  # 0.5 / 1.0 s, though the turn needs 2.0 / 2.0 s
    assert states[50].twist.angular_radps == pytest.approx(1.0, abs=0.03)
    assert states[-1].twist == Twist2D(0.0, 2.0)


def test_a_turn_that_reverses_waits_for_no_braking_with_its_jerk_limit() -> None:
    """A source that brakes by 2 mm/s each cycle: 1.0 rad/s are gone after 1.0 / 4.0 s, whatever the jerk limit does."""
    state, turns = MotionState(Twist2D(0.5, 1.0)), []
    for cycle in range(25):
        state = LIMITER.step(state, Twist2D(0.498 - 0.002 * cycle, -2.0), DT_S)
        turns.append(state.twist.angular_radps)
    assert turns == pytest.approx([1.0 - 0.04 * (cycle + 1) for cycle in range(25)], abs=1e-12)
    assert state.twist.linear_mps == pytest.approx(0.45, abs=0.003)


def test_a_stop_follows_the_circle_that_the_base_is_on() -> None:
    states = drive(LIMITER, MotionState(Twist2D(0.6, 0.9)), Twist2D.ZERO, 1.0)
    moving = [state.twist for state in states if state.twist != Twist2D.ZERO]
    assert len(moving) == 70
    assert [twist.angular_radps / twist.linear_mps for twist in moving] == pytest.approx([1.5] * 70, rel=1e-9)


# Jerk


def test_the_acceleration_grows_and_falls_by_the_jerk_limit() -> None:
    states = drive(LIMITER, MotionState.AT_REST, Twist2D(1.0, 0.0), 2.05)
    slopes = [state.acceleration_mps2 for state in states]
    assert slopes[:7] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.5])
    assert slopes[-7:] == pytest.approx([0.5, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0], abs=1e-6)
    assert states[-1] == MotionState(Twist2D(1.0, 0.0))


def test_a_stop_ordered_in_full_acceleration_brakes_from_the_next_cycle_on() -> None:
    speeding_up = drive(LIMITER, MotionState.AT_REST, Twist2D(1.0, 0.0), 1.0)[-1]
    assert speeding_up.acceleration_mps2 == pytest.approx(0.5)
    slower = LIMITER.step(speeding_up, Twist2D.ZERO, DT_S)
    assert slower.twist.linear_mps < speeding_up.twist.linear_mps
    assert slower.acceleration_mps2 == pytest.approx(-0.1)


def test_a_target_that_comes_too_near_for_the_jerk_limit_is_reached_and_not_passed() -> None:
    speeding_up = drive(LIMITER, MotionState.AT_REST, Twist2D(1.0, 0.0), 1.0)[-1]
    near = Twist2D(speeding_up.twist.linear_mps + 0.005, 0.0)  # the jerk limit alone would pass it by 7.5 mm/s
    speeds = linear(drive(LIMITER, speeding_up, near, 0.1))
    assert speeds == sorted(speeds)
    assert speeds.index(near.linear_mps) == 4  # 5 mm/s at 10 m/s³ take √(2 × 0.005 / 10) s = 32 ms


def test_an_acceleration_too_steep_for_what_is_left_drops_at_once_to_what_the_jerk_limit_takes_back() -> None:
    """At 0.5 m/s², 5 mm/s are left: √(2 × 10 × 0.005) = 0.316 m/s² is the steepest that 10 m/s³ ends in time."""
    steep = MotionState(Twist2D(0.5, 0.0), 0.5)
    after = LIMITER.step(steep, Twist2D(0.505, 0.0), 0.01)
    assert after.acceleration_mps2 == pytest.approx(math.sqrt(0.1) - 10.0 * 0.01)
    assert after.twist.linear_mps == pytest.approx(0.5 + math.sqrt(0.1) * 0.01 - 10.0 * 0.01**2 / 2.0)


def test_a_target_that_trembles_around_the_speed_is_followed_exactly() -> None:
    state = drive(LIMITER, MotionState.AT_REST, Twist2D(0.5, 0.0), 1.5)[-1]
    for _ in range(50):
        for speed_mps in (0.5 + 1e-6, 0.5 - 1e-6):
            state = LIMITER.step(state, Twist2D(speed_mps, 0.0), DT_S)
            assert state == MotionState(Twist2D(speed_mps, 0.0))


@property_of_all
@given(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.floats(2.0, 1000.0))
def test_from_a_steady_speed_the_acceleration_never_leaps(start_mps: float, angular_radps: float, jerk: float) -> None:
    limiter = Limiter(LIMITS.model_copy(update={"jerk_mps3": jerk}), TRACK_M)
    twist = limiter.limit(Twist2D(start_mps, angular_radps))
    ways = [drive(limiter, MotionState(twist), Twist2D.ZERO, 3.0), drive(limiter, MotionState.AT_REST, twist, 3.0)]
    for states in ways:
        leaps = [abs(after.acceleration_mps2 - before.acceleration_mps2) for before, after in pairwise(states)]
        assert max(leaps) <= jerk * DT_S * (1.0 + 1e-6) + 1e-6


# Emergency


@pytest.mark.parametrize(
    ("start", "steps"),
    [
        (Twist2D(1.0, 0.0), 50),  # 1.0 / 2.0 s
        (Twist2D(-1.0, 0.0), 50),
        (Twist2D(0.0, 2.0), 25),  # 2.0 / 4.0 s, shortened like the linear one by 1.0 / 2.0
        (Twist2D(0.5, 1.0), 25),
    ],
)
def test_an_emergency_stop_takes_its_own_deceleration_and_no_time_for_jerk(start: Twist2D, steps: int) -> None:
    speeding_up = MotionState(start, 0.5)
    assert steps_until(LIMITER, speeding_up, Twist2D.ZERO, 100, emergency=True) in (steps, steps + 1)


def test_an_emergency_stop_keeps_the_circle_and_ignores_the_target() -> None:
    start = MotionState(Twist2D(0.6, 0.9))
    states = drive(LIMITER, start, Twist2D(1.0, 0.0), 0.4, emergency=True)
    assert states == drive(LIMITER, start, Twist2D.ZERO, 0.4, emergency=True)
    assert states[10].twist.linear_mps == pytest.approx(0.4)
    assert states[10].twist.angular_radps == pytest.approx(0.6)
    assert states[-1] == MotionState.AT_REST


@pytest.mark.parametrize(
    ("speed_mps", "distance_mps"), list(product([0.0, 0.3, 1.0], [1e-300, 1e-15, 1e-9, 2e-9, 1e-6, 1e-3]))
)
def test_the_smallest_changes_arrive_exactly(speed_mps: float, distance_mps: float) -> None:
    target = Twist2D(speed_mps - distance_mps, 0.0)
    assert steps_until(LIMITER, MotionState(Twist2D(speed_mps, 0.0)), target, 10) <= 3


def test_an_emergency_stop_that_has_begun_goes_on_to_zero_whatever_is_requested_meanwhile() -> None:
    begun = LIMITER.step(MotionState(Twist2D(0.8, 0.4)), Twist2D(1.0, 0.0), DT_S, emergency=True)
    assert begun.emergency
    states = [begun, *drive(LIMITER, begun, Twist2D(1.0, 0.0), 0.6)]
    zero = next(at for at, state in enumerate(states) if state.twist == Twist2D.ZERO)
    once = drive(LIMITER, begun, Twist2D.ZERO, 0.6, emergency=True)
    assert states[1 : zero + 1] == once[:zero]
    assert states[zero] == MotionState.AT_REST
    assert states[zero + 1].twist.linear_mps > 0.0


def test_an_emergency_stop_from_the_smallest_speed_that_there_is_ends_at_once() -> None:
    slowest = MotionState(Twist2D(5e-324, 0.0))  # its ramp, half as long as an ordinary one, takes no time
    assert LIMITER.step(slowest, Twist2D.ZERO, DT_S, emergency=True) == MotionState.AT_REST
