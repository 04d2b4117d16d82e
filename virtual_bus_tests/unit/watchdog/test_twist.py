"""The base against the orders of its wheels, every 1/64 s: lag 1/8 s, slowest ramp 0.5 m/s², track 0.5 m.

ordered    both wheels 0.25 m/s: straight on
measured   left 0.125, right 0.25: a curve, 0.25 rad/s       trips after 0.25 s, and the smoothing
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from canbase_watchdog.frames import DriveState
from canbase_watchdog.twist import Reach, SlowWheels, TwistWatch
from canbase_watchdog.view import Axis, BusView
from support.watchdog_story import config

HZ = 64.0
CONFIG = replace(
    config(),
    control_hz=HZ,
    track_m=0.5,
    drive_lag_s=0.125,
    slowest_ramp_mps2=0.5,
    twist_tolerance_mps=0.01,
    twist_tolerance_share=0.0,
    twist_s=0.25,
)
BIT = replace(CONFIG.drives[0], mps_per_bit=0.0), replace(CONFIG.drives[1], mps_per_bit=0.0)


class Base:
    """Two wheels on the table, enabled; `start` closes what may have been ordered before."""

    def __init__(self, start: bool = True, **changes: Any) -> None:
        self.config = replace(CONFIG, drives=BIT, **changes)
        self.watch = TwistWatch(self.config, 0.0)
        self.n = 0
        if start:
            self.cycle((0.0, 0.0), state=DriveState.SWITCHED_ON)

    def cycle(
        self,
        ordered: tuple[float, float],
        measured: tuple[float, float] | None = None,
        state: DriveState = DriveState.OPERATION_ENABLED,
        cycles: int = 1,
    ) -> str:
        """One SYNC with setpoints and velocities of left and right; the base does as ordered unless told otherwise."""
        self.n += cycles
        axes = [
            Axis(drive, state=state, setpoint_mps=setpoint, velocity_mps=velocity)
            for drive, setpoint, velocity in zip(self.config.drives, ordered, measured or ordered, strict=False)
        ]
        return self.watch.check_motion(BusView(tuple(axes), (), sync_at=self.n / HZ), self.n / HZ)

    def trips_after(self, ordered: tuple[float, float], measured: tuple[float, float], most: int = 200) -> int | None:
        """So many SYNCs; None: it does not."""
        return next((n for n in range(1, most) if self.cycle(ordered, measured)), None)


def straight(speed: float = 0.25, **changes: Any) -> Base:
    base = Base(**changes)
    for _ in range(64):
        base.cycle((speed, speed))
    return base


@pytest.mark.parametrize(
    ("measured", "trips"),
    [
        ((0.25, 0.25), False),
        ((0.0, 0.0), False),  # slow together: no curve, and each wheel has its own bound
        ((0.125, 0.25), True),
        ((0.25, 0.125), True),
        ((0.25, 0.25 - 0.0199), False),  # 2 × 0.01 m/s between the wheels
        ((0.25, 0.25 - 0.0201), True),
        ((0.25 - 0.0201, 0.25), True),
        ((0.2599, 0.2599), False),
        ((0.2601, 0.2601), True),
        ((-0.0099, -0.0099), False),
        ((-0.0101, -0.0101), True),
    ],
)
def test_straight_on(measured: tuple[float, float], trips: bool) -> None:
    assert (straight().trips_after((0.25, 0.25), measured) is not None) is trips
    mirrored = (-measured[0], -measured[1])
    assert (straight(-0.25).trips_after((-0.25, -0.25), mirrored) is not None) is trips


def test_a_curve_that_nobody_ordered_trips_after_its_time() -> None:
    assert straight().trips_after((0.25, 0.25), (0.125, 0.25)) == 16
    assert straight(twist_s=0.5).trips_after((0.25, 0.25), (0.125, 0.25)) == 32


def test_however_long_it_was_outside_as_long_inside_as_it_takes_to_trip_makes_up_for_it() -> None:
    base = straight()
    for _ in range(640):
        base.cycle((0.25, 0.25), (0.125, 0.25))
    for _ in range(24):  # 0.25 s, and the smoothing
        base.cycle((0.25, 0.25))
    assert base.trips_after((0.25, 0.25), (0.125, 0.25)) == 16


def test_from_a_stand_each_cycle_counts() -> None:
    assert Base().trips_after((0.0, 0.0), (0.0, 0.25)) == 16
    assert Base().trips_after((0.0, 0.0), (0.25, 0.25)) == 16


def test_of_a_turn_in_place_both_wheels_have_their_share() -> None:
    base = Base()
    for _ in range(64):
        base.cycle((-0.25, 0.25))
    assert base.trips_after((-0.25, 0.25), (-0.125, 0.25)) is not None  # 0.0625 m/s ahead
    assert straight(0.0).trips_after((0.0, 0.0), (-0.05, 0.05)) is not None


def test_the_share_is_that_of_the_fastest_wheel() -> None:
    assert straight(twist_tolerance_share=0.25).trips_after((0.25, 0.25), (0.25, 0.106)) is None  # 2 × (0.01 + 0.0625)
    assert straight(twist_tolerance_share=0.25).trips_after((0.25, 0.25), (0.25, 0.104)) is not None
    base = straight(-0.25, twist_tolerance_share=0.25)
    assert base.trips_after((-0.25, -0.25), (-0.25, -0.106)) is None


@pytest.mark.parametrize(("ahead_mps", "trips"), [(0.144, False), (0.146, True)])
def test_in_a_turn_in_place_the_wheels_are_the_fastest_though_the_base_goes_nowhere(
    ahead_mps: float, trips: bool
) -> None:
    base = Base(twist_tolerance_share=0.25)  # 0.01 + 25 % of 0.25 m/s
    for _ in range(64):
        base.cycle((-0.25, 0.25))
    assert (base.trips_after((-0.25, 0.25), (ahead_mps - 0.25, 0.25)) is not None) is trips


def test_one_bit_of_the_velocity_is_no_curve() -> None:
    coarse = tuple(replace(drive, mps_per_bit=-0.0625) for drive in BIT)
    base = straight()
    base.watch = TwistWatch(replace(base.config, drives=coarse), base.n / HZ)
    base.cycle((0.0, 0.0), state=DriveState.SWITCHED_ON)
    assert base.trips_after((0.25, 0.25), (0.25, 0.106)) is None
    assert base.trips_after((0.25, 0.25), (0.25, 0.104)) is not None


def test_the_wheel_that_is_farthest_from_its_setpoint_is_named() -> None:
    base = straight()
    why = ""
    while not why:
        why = base.cycle((0.25, 0.25), (0.125, 0.24))
    assert why.startswith("0.2")
    assert "rad/s together, allowed" in why
    assert why.endswith("; wheel_1_0 is ordered 0.250 m/s and turns at 0.125 m/s")


def test_a_moment_is_forgotten_as_fast_as_it_came() -> None:
    base = straight()
    for _ in range(20):
        assert base.trips_after((0.25, 0.25), (0.0, 0.25), 6) is None
        assert base.trips_after((0.25, 0.25), (0.25, 0.25), 30) is None


def test_a_wheel_that_is_slow_more_than_half_of_the_time_adds_up() -> None:
    base = straight()
    bad = [base.cycle((0.25, 0.25), (0.0 if n % 8 < 5 else 0.25, 0.25)) for n in range(200)]
    assert any(bad)


def test_noise_of_both_wheels_is_no_curve() -> None:
    base = straight()
    noise = [(0.03, -0.03), (-0.03, 0.03)]
    assert not any(base.cycle((0.25, 0.25), (0.25 + noise[n % 2][0], 0.25 + noise[n % 2][1])) for n in range(500))


def test_a_twist_that_was_ordered_may_go_on_for_the_lag_and_falls_with_the_slowest_ramp() -> None:
    base = Base(twist_s=0.01)
    for _ in range(64):
        base.cycle((0.0, 0.5))  # 1 rad/s, 0.25 m/s
    speed, n = 0.5, 0
    while speed > 0.0:
        n += 1
        speed = 0.5 - max(0.0, 0.5 * (n / HZ - 0.125))
        assert base.cycle((0.0, 0.0), (0.0, speed)) == ""
    assert base.trips_after((0.0, 0.0), (0.0, 0.1)) is not None


# order | for 8 cycles | falls: 0.25 m/s² and 1 rad/s², 0.1 m/s below it is forgiven: 0.4 s are 25.6 cycles
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("wheels", [(0.5, 0.5), (-0.25, 0.25)])
def test_a_base_that_goes_on_after_its_order_is_outside_when_the_slowest_ramp_has_ended_so_much(
    wheels: tuple[float, float], sign: int
) -> None:
    going = sign * wheels[0], sign * wheels[1]
    base = Base(twist_s=0.01, twist_tolerance_mps=0.1)
    for _ in range(64):
        base.cycle(going)
    assert base.trips_after((0.0, 0.0), going) == 1 + 8 + 26


# ramps of the drives: 0.5 m/s² upward; 0.2 m/s apart, they reach 1 m/s after 2.4 and 2 s
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_from_a_turn_to_fast_straight_on_slow_wheels_keep_their_distance_until_the_first_is_there(sign: float) -> None:
    base, wheels = straight(0.0, twist_tolerance_mps=0.02), SlowWheels(0.5, 2.0)
    for _ in range(64):
        base.cycle((-0.1 * sign, 0.1 * sign), wheels.follow((-0.1 * sign, 0.1 * sign), 1.0 / HZ))
    for _ in range(200):
        assert base.cycle((1.0, 1.0), wheels.follow((1.0, 1.0), 1.0 / HZ)) == ""
    assert wheels.speeds == (1.0, 1.0)


def test_wheels_that_brake_faster_than_they_start_are_elsewhere_at_a_new_order_and_that_is_allowed() -> None:
    """The right wheel turns round: down with 2 m/s² and up with 0.5 m/s². With 0.5 m/s² both ways it would be
    elsewhere when the next order comes, and so would the way to it."""
    base, wheels = straight(0.0, deceleration_mps2=2.0, twist_tolerance_mps=0.02), SlowWheels(0.5, 2.0)
    for ordered in ((-1.0, 1.0), (0.5, 0.0), (1.0, 1.0)):
        for _ in range(128):
            assert base.cycle(ordered, wheels.follow(ordered, 1.0 / HZ)) == ""


def test_a_base_that_turns_on_when_wheels_on_the_slowest_ramp_are_there_trips() -> None:
    base = straight(0.0, twist_s=0.05)
    for _ in range(64):
        base.cycle((-0.1, 0.1))
    assert base.trips_after((1.0, 1.0), (0.8, 1.0), 128) is None  # 0.9 m/s at 0.5 m/s² are 115 cycles, and the lag
    assert base.trips_after((1.0, 1.0), (0.8, 1.0), 64) is not None


@pytest.mark.parametrize(
    ("speeds", "setpoint_mps", "after"),
    [
        ((0.0, 0.0), 1.0, (0.05, 0.05)),
        ((0.98, -0.5), 1.0, (1.0, -0.3)),  # the right one turns round: downward first
        ((1.0, 0.1), 0.0, (0.8, 0.0)),
        ((-1.0, 0.5), -0.5, (-0.8, 0.3)),
        ((-0.5, 0.4), -1.0, (-0.55, 0.2)),
        ((0.3, 0.3), 0.3, (0.3, 0.3)),
    ],
)
def test_slow_wheels(speeds: tuple[float, float], setpoint_mps: float, after: tuple[float, float]) -> None:
    """A tenth of a second with 0.5 m/s² upward and 2 m/s² downward."""
    wheels = SlowWheels(0.5, 2.0)
    wheels.speeds = speeds
    assert wheels.follow((setpoint_mps, setpoint_mps), 0.1) == pytest.approx(after)


def test_after_a_gap_the_smoothed_speed_is_the_measured_one_and_not_beyond_it() -> None:
    base = straight(twist_s=0.01)
    assert base.cycle((0.25, 0.25), (0.25, 0.25 - 0.0199), cycles=6) == ""
    assert base.cycle((0.25, 0.25), (0.25, 0.25 - 0.0201), cycles=6) != ""


def test_looking_twice_at_one_sync_is_looking_once() -> None:
    base = straight()
    assert base.trips_after((0.25, 0.25), (0.125, 0.25), 16) is None
    axes = tuple(Axis(d, state=DriveState.OPERATION_ENABLED, velocity_mps=9.0) for d in BIT)
    same = BusView(axes, (), sync_at=base.n / HZ)
    assert [base.watch.check_motion(same, base.n / HZ + n) for n in range(9)] == [""] * 9
    assert base.cycle((0.25, 0.25), (0.125, 0.25)) != ""


def test_while_a_drive_is_not_enabled_nothing_is_judged_and_all_begins_anew() -> None:
    base = straight()
    assert base.trips_after((0.25, 0.25), (0.125, 0.25), 15) is None
    assert base.cycle((0.25, 0.25), (9.0, -9.0), state=DriveState.QUICK_STOP_ACTIVE) == ""
    assert base.trips_after((0.25, 0.25), (0.125, 0.25), 15) is None


def test_before_the_start_anything_within_the_limits_may_have_been_ordered() -> None:
    assert Base(start=False).trips_after((0.0, 0.0), (0.0, 1.0), 17) is None
    assert Base(start=False).trips_after((0.0, 0.0), (-1.0, 0.9), 17) is None
    assert Base(start=False).trips_after((0.0, 0.0), (2.0, 2.0), 30) is not None
    assert Base(start=False).trips_after((0.0, 0.0), (-1.1, 1.1), 30) is not None


def said(speeds: tuple[float, ...]) -> list[str]:
    """40 cycles of left, right, left, …, all ordered 0.25 m/s; the speeds are measured."""
    drives = tuple(replace(BIT[n % 2], joint=f"wheel_{n}") for n in range(len(speeds)))
    watch = TwistWatch(replace(CONFIG, drives=drives), 0.0)
    axes = [
        Axis(drive, state=DriveState.OPERATION_ENABLED, setpoint_mps=0.25, velocity_mps=speed)
        for drive, speed in zip(drives, speeds, strict=True)
    ]
    off = tuple(replace(axis, state=DriveState.SWITCHED_ON) for axis in axes)
    watch.check_motion(BusView(off, (), sync_at=0.0), 0.0)
    return [watch.check_motion(BusView(tuple(axes), (), sync_at=n / HZ), n / HZ) for n in range(1, 40)]


@pytest.mark.parametrize("speeds", [(0.25, 0.25, 0.125), (0.25, 0.25, 0.25, 0.125)])
def test_each_wheel_of_a_side_is_looked_at(speeds: tuple[float, ...]) -> None:
    assert any(
        why.endswith(f"wheel_{len(speeds) - 1} is ordered 0.250 m/s and turns at 0.125 m/s") for why in said(speeds)
    )


def test_the_setpoint_of_a_side_is_the_mean_of_its_wheels() -> None:
    assert said((0.25, 0.25, 0.25)) == said((0.259, 0.259, 0.259, 0.259)) == [""] * 39
    assert any(said((0.261, 0.261, 0.261, 0.261)))


def test_a_base_of_one_side_has_no_twist() -> None:
    watch = TwistWatch(replace(CONFIG, drives=BIT[:1]), 0.0)
    axis = Axis(BIT[0], state=DriveState.OPERATION_ENABLED, velocity_mps=9.0)
    assert [watch.check_motion(BusView((axis,), (), sync_at=n / HZ), n / HZ) for n in range(1, 40)] == [""] * 39


def test_reach_is_what_was_ordered_within_the_lag_and_falls() -> None:
    reach = Reach(0.25, 1.0, 0.0)
    reach.order([0.5, 0.1], 1.0)
    reach.advance(1.0, 1.0)
    assert (reach.low, reach.high) == (0.0, 0.5)
    reach.order([-0.25], 1.0)
    reach.advance(0.25, 1.25)
    assert (reach.low, reach.high) == (0.25, 0.5)
    reach.advance(0.125, 1.375)
    assert (reach.low, reach.high) == (0.25, 0.375)
    reach.order([0.0], 1.375)
    reach.advance(1.0, 2.375)
    assert (reach.low, reach.high) == (0.0, 0.0)
