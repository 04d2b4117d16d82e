"""Setpoints of both sides together: per SYNC, two in a row, and only those that came for it and count in the drive."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_watchdog.envelope import Bounds
from canbase_watchdog.frames import DriveState
from canbase_watchdog.left_right import LeftRightWatch
from canbase_watchdog.view import Axis, BusView
from support.watchdog_story import config

CONFIG = config()
ARC = Bounds(0.0, 0.4, 0.0, 1.0)
"""Track 0.4 m: the right wheel up to 0.6, the left one from -0.2 to 0.4 m/s. Tolerance 0.03 + 0.001 + 3 % of 0.6."""
TOLERANCE_MPS = 0.049
ENABLED = DriveState.OPERATION_ENABLED


def bus(left: float, right: float, sync_at: float, **changes: object) -> BusView:
    axes = [
        replace(Axis(drive, state=ENABLED, setpoint_mps=speed, setpoint_at=sync_at), **changes)  # type: ignore[arg-type]
        for drive, speed in zip(CONFIG.drives, (left, right), strict=True)
    ]
    return BusView(tuple(axes), (), sync_at=sync_at)


def twice(left: float, right: float, **changes: object) -> str:
    watch = LeftRightWatch(CONFIG)
    assert watch.check_setpoints(bus(left, right, 1.0, **changes), ARC) == ""
    return watch.check_setpoints(bus(left, right, 1.01, **changes), ARC)


@pytest.mark.parametrize(
    ("left", "right", "fits"),
    [
        (0.2, 0.6, True),
        (0.0, 0.0, True),
        (0.4, 0.4, True),
        (-0.2, 0.2, True),
        (0.4 + TOLERANCE_MPS - 1e-6, 0.4 + TOLERANCE_MPS - 1e-6, True),
        (0.4 + TOLERANCE_MPS + 1e-6, 0.4 + TOLERANCE_MPS + 1e-6, False),
        (-TOLERANCE_MPS - 1e-6, -TOLERANCE_MPS - 1e-6, False),
        (-TOLERANCE_MPS + 1e-6, 0.4 + TOLERANCE_MPS - 1e-6, True),  # 1 rad/s and its tolerance
        (-TOLERANCE_MPS - 1e-6, 0.4 + TOLERANCE_MPS + 1e-6, False),
        (-0.2, 0.6, False),  # each is allowed alone
        (0.2, 0.0, False),  # to the right
    ],
)
def test_what_goes_together(left: float, right: float, fits: bool) -> None:
    assert (twice(left, right) == "") is fits


def test_the_sentence_is_that_of_the_bounds() -> None:
    assert twice(-0.2, 0.6) == "2.000 rad/s together, allowed 0.000 to 1.000 rad/s"


def test_looking_twice_at_one_sync_is_looking_once() -> None:
    watch = LeftRightWatch(CONFIG)
    view = bus(-0.2, 0.6, 1.0)
    assert [watch.check_setpoints(view, ARC) for _ in range(5)] == [""] * 5


def test_one_bad_sync_between_good_ones_is_a_lost_frame() -> None:
    watch = LeftRightWatch(CONFIG)
    speeds = ((-0.2, 0.6), (0.2, 0.6)) * 3
    assert [watch.check_setpoints(bus(*speed, n / 100), ARC) for n, speed in enumerate(speeds)] == [""] * 6


def test_it_is_told_for_each_further_sync() -> None:
    watch = LeftRightWatch(CONFIG)
    assert [watch.check_setpoints(bus(-0.2, 0.6, n / 100), ARC) != "" for n in range(4)] == [False, True, True, True]


@pytest.mark.parametrize(
    "changes",
    [{"setpoint_at": 0.5}, {"state": DriveState.SWITCHED_ON}, {"state": DriveState.QUICK_STOP_ACTIVE}, {"state": None}],
)
def test_setpoints_that_are_old_or_without_effect_say_nothing(changes: dict[str, object]) -> None:
    assert twice(-0.2, 0.6, **changes) == ""


def test_one_axis_without_a_new_setpoint_is_enough_to_say_nothing() -> None:
    watch = LeftRightWatch(CONFIG)
    for n in range(3):
        view = bus(-0.2, 0.6, n / 100)
        left, right = view.axes
        stale = replace(view, axes=(left, replace(right, setpoint_at=-1.0)))
        assert watch.check_setpoints(stale, ARC) == ""


def test_a_sync_without_a_setpoint_shows_nothing_and_forgets_nothing() -> None:
    """An axis that gets its setpoint for every second SYNC only."""
    watch = LeftRightWatch(CONFIG)
    found = []
    for n in range(6):
        view = bus(-0.2, 0.6, n / 100)
        left, right = view.axes
        stale = replace(view, axes=(left, replace(right, setpoint_at=-1.0)))
        found.append(watch.check_setpoints(view if n % 2 == 0 else stale, ARC) != "")
    assert found == [False, False, True, False, True, False]


def test_drives_that_were_not_enabled_begin_anew() -> None:
    watch = LeftRightWatch(CONFIG)
    assert watch.check_setpoints(bus(-0.2, 0.6, 1.0), ARC) == ""
    assert watch.check_setpoints(bus(-0.2, 0.6, 1.01, state=DriveState.SWITCHED_ON), ARC) == ""
    assert watch.check_setpoints(bus(-0.2, 0.6, 1.02), ARC) == ""
    assert watch.check_setpoints(bus(-0.2, 0.6, 1.03), ARC) != ""


def test_every_wheel_of_one_side_goes_together_with_every_one_of_the_other() -> None:
    four = config((1, 0), (2, 0), (3, 0), (4, 0))  # left, right, left, right
    watch = LeftRightWatch(four)
    found = []
    for n in range(2):
        speeds = (0.2, 0.6, 0.2, -0.2)
        axes = [
            Axis(d, state=ENABLED, setpoint_mps=s, setpoint_at=n / 100)
            for d, s in zip(four.drives, speeds, strict=True)
        ]
        found.append(watch.check_setpoints(BusView(tuple(axes), (), sync_at=n / 100), ARC))
    assert found == ["", "-1.000 rad/s together, allowed 0.000 to 1.000 rad/s"]


def test_a_coarse_drive_widens_the_tolerance() -> None:
    coarse = replace(CONFIG, drives=(replace(CONFIG.drives[0], mps_per_bit=-0.021), CONFIG.drives[1]))
    watch = LeftRightWatch(coarse)
    beyond = 0.4 + TOLERANCE_MPS + 0.0199
    assert [watch.check_setpoints(bus(beyond, beyond, n / 100), ARC) for n in range(3)] == [""] * 3
    assert [watch.check_setpoints(bus(beyond + 2e-4, beyond + 2e-4, n / 100), ARC) != "" for n in range(3, 6)] == [
        False,
        True,
        True,
    ]
