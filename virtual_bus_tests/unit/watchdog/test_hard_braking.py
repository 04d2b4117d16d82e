"""Whether the base has to brake hard: the first lease with the flag begins it, and zero setpoints without it end it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from canbase_watchdog.hard_braking import HardBraking
from canbase_watchdog.lease import BRAKES_HARD, Lease
from canbase_watchdog.view import Axis
from support.plausibility_wheel import CONFIG, Wheel
from support.watchdog_story import config

LEFT, RIGHT = (Axis(drive) for drive in config().drives)
GENTLE, HARD = Lease(1, 1, 0.3, 0.0, 0), Lease(2, 2, 0.0, 0.0, BRAKES_HARD)


def braking(*leases: Lease) -> HardBraking:
    """These leases, a second apart, the first one at 10 s."""
    hard = HardBraking()
    for number, lease in enumerate(leases):
        hard.on_lease(lease, 10.0 + number)
    return hard


@pytest.mark.parametrize(
    ("leases", "since"),
    [
        ((), math.inf),
        ((GENTLE,), math.inf),
        ((HARD,), 10.0),
        ((GENTLE, HARD), 11.0),
        ((HARD, HARD, HARD), 10.0),
        ((HARD, GENTLE), 10.0),
        ((HARD, GENTLE, HARD), 10.0),
    ],
)
def test_it_holds_from_the_first_lease_with_the_flag_on(leases: tuple[Lease, ...], since: float) -> None:
    hard = braking(*leases)
    assert (hard.since, hard.holds) == (since, since < math.inf)


@pytest.mark.parametrize("flagged", [True, False])
@pytest.mark.parametrize(
    ("left", "right", "at_rest"),
    [
        ((0.0, 0.0), (0.0, 0.0), True),
        ((0.001, 0.0), (0.0, 0.0), False),
        ((0.0, 0.001), (0.0, 0.0), False),
        ((0.0, 0.0), (-0.001, 0.0), False),
        ((0.0, 0.0), (0.0, -0.001), False),
    ],
)
def test_it_ends_once_no_setpoint_is_left_and_the_flag_is_gone(
    left: tuple[float, float], right: tuple[float, float], at_rest: bool, flagged: bool
) -> None:
    """Per wheel: the setpoint that was received last, and the one that a SYNC made effective [m/s]."""
    hard = braking(HARD) if flagged else braking(HARD, GENTLE)
    wheels = zip((LEFT, RIGHT), (left, right), strict=True)
    hard.end_at_zero_setpoints(
        [replace(axis, target_mps=target, setpoint_mps=setpoint) for axis, (target, setpoint) in wheels]
    )
    assert hard.holds is (flagged or not at_rest)


def test_ended_it_begins_again_with_the_next_flag() -> None:
    hard = braking(HARD, GENTLE)
    hard.end_at_zero_setpoints([LEFT, RIGHT])
    hard.on_lease(HARD, 20.0)
    assert hard.since == 20.0


# 0.4 m/s, then zero: for drive_lag_s (0.1 s) any speed of before, then 1 m/s² or, under "brakes hard", 2 m/s²
@pytest.mark.parametrize(("hard", "left_mps"), [(True, 0.2), (False, 0.3)])
def test_the_motion_falls_with_the_deceleration_that_is_due(hard: bool, left_mps: float) -> None:
    wheel = Wheel(emergency_deceleration_mps2=2.0 * CONFIG.deceleration_mps2)
    wheel.samples(10, 0.4, 0.4)
    wheel.watch.brake(True)
    wheel.watch.brake(hard)
    wheel.samples(10, 0.0, 0.0)
    assert wheel.samples(10, 0.0, 0.0).high_mps == pytest.approx(left_mps, abs=0.021)
