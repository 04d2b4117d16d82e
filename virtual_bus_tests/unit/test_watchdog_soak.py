"""Ordinary driving does not trip: a minute of it here, hours by `python -m unit.watchdog_soak HOURS`."""

from __future__ import annotations

import pytest

from canbase_watchdog.policy import Cause
from unit.watchdog_soak import Soak, drive

MINUTES_EACH = 0.25


@pytest.mark.parametrize("seed", range(1, 5))
def test_a_minute_of_ordinary_driving_does_not_trip(seed: int) -> None:
    told: list[str] = []
    trips, way_m = drive(MINUTES_EACH * 60.0, seed, told.append)
    assert (told, trips) == ([], 0)
    assert way_m > 0.5


def test_it_would_be_told() -> None:
    """The same base with a drive that does not listen any more."""
    soak = Soak(1)
    assert not soak.run(20.0)
    soak.bench.nodes[1].axes[0].faults.ignores_setpoints = True
    assert soak.run(20.0)
    assert soak.verdict.cause is Cause.MOTION_OUTSIDE
