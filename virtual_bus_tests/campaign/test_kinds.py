"""Each kind of drive without its masters: the rows of docs/stop_times.md, two runs each."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from campaign.kinds import COMMAND, FAILURES, GOES_ON, MASTERS_ARE_GONE, TABLE, Row, cells, measured
from canbase_campaign.cruise import Run
from canbase_sim.personality import PERSONALITIES
from support.marked_page import section

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]
PAGE = Path(__file__).parents[2] / "docs" / "stop_times.md"
HEARTBEAT_S = 0.3
BRAKING_S = 0.26
"""From 0.4 m/s with 2 m/s²: 0.2 s, and the lag of drive and plant."""


@pytest.mark.parametrize("kind", sorted(PERSONALITIES))
def test_a_kind_stops_without_its_masters_as_it_is_described_or_goes_on(kind: str) -> None:
    row = measured(kind, runs=2)
    assert row.problem == ""
    alone_s = PERSONALITIES[kind].alone_s(HEARTBEAT_S)
    for twin, runs in row.runs:
        if twin.what in MASTERS_ARE_GONE:
            assert all((run.time_s < alone_s + BRAKING_S) == math.isfinite(alone_s) for run in runs), twin
        else:
            assert all(run.time_s < 0.95 for run in runs), twin  # the driver's ramp, where the drive goes on


def test_a_guarded_drive_stands_within_half_a_second() -> None:
    row = measured("technosoft", runs=3)
    assert row.by.startswith("node guarding")
    times = [run.time_s for twin, runs in row.runs if twin.what in MASTERS_ARE_GONE for run in runs]
    assert max(times) < 0.5


def test_a_drive_that_goes_on_though_its_boot_says_otherwise_is_a_problem() -> None:
    stands, goes_on = Run(0.4, 0.1, 0.4, 0.4), Run(math.inf, 2.0, math.inf, 0.4)
    runs = tuple((twin, (stands, goes_on if twin.what == "cable" else stands)) for twin in FAILURES)
    row = Row("mine", "heartbeat", runs)
    assert row.problem == "mine: heartbeat, and it goes on: cable"
    assert cells(row)["cable cut"] == GOES_ON
    assert cells(row)["driver dies"] == "0.40, 0.40 s"
    assert Row("mine", "", runs).problem == ""


def test_the_page_has_each_kind() -> None:
    rows = TABLE.rows(section(PAGE.read_text(encoding="utf-8"), COMMAND))
    assert sorted(kind for kind, _ in rows) == sorted(PERSONALITIES)
