"""Stops in virtual time: the rows of docs/stop_times.md, a few runs each; and what a lost encoder may do at most."""

from __future__ import annotations

import math

import pytest

from campaign.stops import cells, measured, quantile
from canbase_campaign.cruise import Cruise, Run, longest_stop_s
from canbase_campaign.twins import DELIVERY, JOYSTICK, LIES, MEASURED, STOPS, Twin, drive
from exit_matrix.stop_table import VIRTUAL

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]
RUNS = 20


def test_an_encoder_lost_at_0_3_mps_takes_the_power_within_0_35_s_and_the_wheel_stays_below_1_5_mps() -> None:
    lost, cruise = Twin("encoder", "lost", drive("encoder_lost"), JOYSTICK, lies=True), Cruise(JOYSTICK, 0.3)
    runs = [cruise.fork(lost, seed) for seed in range(RUNS)]
    assert max(run.power_off_s for run in runs) <= 0.35
    assert max(run.peak_mps for run in runs) <= 1.5
    assert max(run.time_s for run in runs) < 3.0


def test_every_failure_stops_the_base() -> None:
    for twin, runs in measured(1, 2):
        assert math.isfinite(runs[0].time_s), twin


def test_what_does_not_fail_goes_on() -> None:
    """The measurement would report a base that does not stop."""
    nothing = Twin("nothing", "happens", lambda world, around, random: None, JOYSTICK)
    cruise = Cruise(JOYSTICK)
    run = cruise.fork(nothing, 1)
    assert (run.time_s, run.power_off_s) == (math.inf, math.inf)
    assert run.distance_m == pytest.approx(longest_stop_s(cruise.world.drawn) * 0.4, rel=0.05)
    assert run.cause == ""


def test_the_same_seed_gives_the_same_run() -> None:
    cruise = Cruise(JOYSTICK)
    assert cruise.fork(LIES[0], 3) == cruise.fork(LIES[0], 3) != cruise.fork(LIES[0], 4)


def test_each_row_has_its_name_once() -> None:
    assert len({twin.key for twin in MEASURED}) == len(STOPS) + len(LIES) + len(DELIVERY) == len(MEASURED)


@pytest.mark.parametrize(("share", "value"), [(0.5, 50), (0.99, 99), (1.0, 100), (0.0, 1)])
def test_a_quantile_is_the_least_value_that_so_many_do_not_exceed(share: float, value: int) -> None:
    assert quantile(range(1, 101), share) == value


def test_a_row_has_times_and_distances_and_of_a_lie_power_and_peak_as_well() -> None:
    runs = [Run(0.5, 0.1, 0.2, 0.4), Run(math.inf, 0.3, math.inf, 0.9)]
    stop, lie = (Twin("a", "b", drive("blocked"), lies=lies) for lies in (False, True))
    spread = ("2", "0.50 s, 100 mm", "never, 300 mm", "never, 300 mm")
    assert tuple(cells(stop, runs)[name] for name in VIRTUAL) == (*spread, "–", "–")
    assert tuple(cells(lie, runs)[name] for name in VIRTUAL) == (*spread, "never", "0.90 m/s")
