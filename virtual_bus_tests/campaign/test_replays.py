"""Recorded stops of drawn scenarios come out the same in a replay; `python -m campaign.replays` does a hundred."""

from __future__ import annotations

import io
import math
from pathlib import Path

import pytest
from rich.console import Console

from campaign.replays import CANNOT, SAME, WATCHDOG, Outcome, in_a_copy, table

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]
SEEDS = range(14)
LEAST_TRIPS = 5


def test_each_trip_of_these_scenarios_comes_out_the_same_or_it_is_said_why_it_cannot(tmp_path: Path) -> None:
    outcomes = [outcome for seed in SEEDS for outcome in in_a_copy(seed, tmp_path)]
    assert [outcome for outcome in outcomes if outcome.result not in (SAME, CANNOT)] == []
    trips = [outcome for outcome in outcomes if outcome.part == WATCHDOG and outcome.result == SAME]
    assert len(trips) >= LEAST_TRIPS
    assert len({outcome.cause for outcome in trips}) >= 4
    assert list(tmp_path.iterdir()) == []


def test_the_table_counts_by_cause() -> None:
    console = Console(width=100, record=True, file=io.StringIO())
    lost = Outcome(1, (), "lease lost", SAME, "", -0.001)
    console.print(table([lost, lost, Outcome(2, (), "loop late", CANNOT, "", math.nan)]))
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in console.export_text().splitlines()]
    assert ["lease lost", "2", "0", "0"] in rows
    assert ["loop late", "0", "0", "1"] in rows
