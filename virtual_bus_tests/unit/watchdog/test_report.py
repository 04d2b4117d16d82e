"""What the watchdog writes into its log."""

from __future__ import annotations

import logging
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from canbase_watchdog.bus_health import BusHealth
from canbase_watchdog.ladder import Step
from canbase_watchdog.report import Reporter
from canbase_watchdog.trip_cause import FINE, TripCause, Verdict
from canbase_watchdog.watchdog import Answer, State, Status

WATCHING = Status(State.WATCHING, FINE, Step.NONE, True, (0, Answer.NONE))
TRIPPED = replace(WATCHING, state=State.TRIPPED, settled=False, verdict=Verdict(TripCause.DRIVER_SILENT))
STANDS = replace(TRIPPED, settled=True)


def test_that_all_drives_stand_is_one_line_for_each_trip(caplog: pytest.LogCaptureFixture) -> None:
    """A driver that hangs and continues: its drives are lost and found again while it is tripped."""
    watchdog: Any = SimpleNamespace(status=WATCHING, dropped_frames=0, refused_leases={})
    reporter = Reporter(cast("Any", watchdog))
    with caplog.at_level(logging.WARNING):
        for at_s, status in enumerate((WATCHING, TRIPPED, STANDS, TRIPPED, STANDS, WATCHING, TRIPPED, STANDS)):
            watchdog.status = status
            reporter.tick(BusHealth(), float(at_s))
    assert [record.message for record in caplog.records].count("all drives at standstill") == 2
