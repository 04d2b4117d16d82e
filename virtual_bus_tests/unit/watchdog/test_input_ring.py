"""What the watchdog's loop notes of its inputs, and when the file of a trip is due."""

from __future__ import annotations

import json
import math

import pytest

from canbase_base.latch_record import Defect, Found, Mark, Record
from canbase_watchdog.input_ring import (
    FRAME,
    LATEST_S,
    MAX_INPUTS,
    START,
    TICK,
    VERDICT,
    InputRing,
    Trip,
    TripWatch,
    head,
    lines,
)
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import Watchdog
from support.watchdog_story import FakeDrive, Story, config


def test_the_last_seconds_are_cut_out_in_the_order_of_the_calls() -> None:
    ring = InputRing(2.0, 0.0)
    for tenth in range(50):
        ring.note((TICK, tenth / 10, math.inf, 0))
    ring.note((FRAME, 4.88, 0x181, b"\x27"))
    kept = list(ring.cut(5.0))
    assert [each[1] for each in kept[:2]] == [3.0, 3.1]
    assert kept[-1] == (FRAME, 4.88, 0x181, b"\x27")


def test_a_life_that_began_in_the_last_seconds_says_so() -> None:
    ring = InputRing(2.0, 4.0)
    ring.note((TICK, 4.005, math.inf, 0))
    assert next(iter(ring.cut(5.0))) == (START, 4.0)
    assert next(iter(ring.cut(6.001))) == (TICK, 4.005, math.inf, 0)


def test_a_flooded_bus_does_not_make_it_longer() -> None:
    ring = InputRing(10.0, 0.0)
    for number in range(MAX_INPUTS + 5):
        ring.note((FRAME, 1.0, 0x181, number.to_bytes(4, "little")))
    kept = list(ring.cut(1.0))
    assert (len(kept), kept[0][3]) == (MAX_INPUTS, (5).to_bytes(4, "little"))


def test_each_line_is_json_and_infinity_is_null() -> None:
    first = head(config(), Found(Record(Mark.CLEAR)), Trip(1.0, 1, "lease_lost", 0, "no lease"), 1.79e9)
    told = [json.loads(line) for line in lines(first, [(TICK, 1.0, math.inf, 3), (FRAME, 1.0, 0x181, b"\x27\x02")])]
    assert told[1:] == [["tick", 1.0, None, 3], ["frame", 1.0, 0x181, "2702"]]
    assert (told[0]["part"], told[0]["trip"]["name"], told[0]["past"]["record"]["mark"]) == (
        "watchdog",
        "lease_lost",
        0,
    )


class Watched:
    """A story whose watchdog is looked at after each tick, as its loop does it."""

    def __init__(self, *drives: FakeDrive) -> None:
        self.story, self.ring = Story(*drives), InputRing(10.0, 0.0)
        self.watch = TripWatch(self.ring, None)
        self.due: list[tuple[float, Trip]] = []
        self.story.on_step = self._look

    def _look(self) -> None:
        trip = self.watch.due_trip(self.story.watchdog, self.story.t)
        if trip is not None:
            self.due.append((self.story.t, trip))

    @property
    def causes(self) -> list[int]:
        return [each[2] for each in self.ring.cut(self.story.t) if each[0] == VERDICT]


# 0.3 m/s ── 1.0 s leases end ── 1.25 s trip ── drives at standstill: due ── reset
def test_a_file_is_due_once_all_drives_stand() -> None:
    watched = Watched()
    watched.story.drive_at(300)
    watched.story.filter = False
    watched.story.run(0.3)
    assert watched.watch.open is not None
    assert (watched.watch.open.name, watched.due) == ("lease_lost", [])
    watched.story.run(1.5)
    ((at_s, trip),) = watched.due
    assert trip.cause == TripCause.LEASE_LOST
    assert trip.at_s == pytest.approx(1.25, abs=0.02)
    assert trip.at_s + 0.2 < at_s < trip.at_s + 1.0
    assert watched.watch.open is None
    assert watched.causes == [0, TripCause.LEASE_LOST]


# a drive that takes no stop ── due 3 s after the trip all the same
def test_a_drive_that_does_not_stop_does_not_hold_the_file_up() -> None:
    watched = Watched(
        FakeDrive(1, hears_pdo=True, hears_quick_stop=False, hears_sdo=False, hears_nmt=False, brakes=False)
    )
    watched.story.drive_at(300, 0.5)
    watched.story.drives[0].speed[0] = 300.0
    watched.story.filter = False
    watched.story.run(4.5)
    ((at_s, trip),) = watched.due
    assert at_s == pytest.approx(trip.at_s + LATEST_S, abs=0.01)


@pytest.mark.parametrize(
    ("past", "is_new"),
    [
        (Found(Record(Mark.LATCHED, int(TripCause.LEASE_LOST), "", "no lease")), False),
        (Found(Record(Mark.LIVE)), True),
        (Found(defect=Defect.GARBAGE), True),
    ],
)
def test_a_trip_that_a_restart_found_on_disk_is_not_recorded_again(past: Found, is_new: bool) -> None:
    """A power cut, or a record that cannot be read, is a stop of its own."""
    ring = InputRing(10.0, 0.0)
    watch = TripWatch(ring, past)
    watchdog = Watchdog(config(), 0.0, past)
    assert (watch.due_trip(watchdog, 0.005) is not None) == is_new
    assert [each[0] for each in ring.cut(0.005)] == [START, VERDICT]
