"""Trips of the real watchdog process, and the file of its inputs: a new watchdog does the same at the same tick."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from canbase_recording.replay_file import read_trip
from canbase_recording.replay_trip import Replayed, replay_trip
from canbase_watchdog.trip_cause import TripCause
from support.watchdog_story import FAULT
from support.watched_process import Watched, watched_process

pytestmark = pytest.mark.bus

WRITTEN_S = 8.0


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[Watched]:
    with watched_process(tmp_path) as it:
        yield it


def boots(watched: Watched) -> None:
    """The boot-up message of a drive, from somebody else on the bus."""
    with can.Bus(**watched.config.bus_arguments) as bus:
        bus.send(can.Message(arbitration_id=0x701, data=b"\0", is_extended_id=False))


def hangs(watched: Watched) -> None:
    watched.process.send_signal(signal.SIGSTOP)
    time.sleep(0.2)
    watched.process.send_signal(signal.SIGCONT)


def killed(watched: Watched) -> None:
    watched.process.kill()
    watched.process.communicate()
    watched.start()


def torn(watched: Watched) -> None:
    record = next(Path(watched.state["XDG_STATE_HOME"]).rglob("watchdog.latch"))
    watched.process.kill()
    watched.process.communicate()
    record.write_bytes(b"torn")
    watched.start()


FAILURES: dict[TripCause, Callable[[Watched], object]] = {
    TripCause.LEASE_LOST: lambda watched: setattr(watched.robot, "filter", False),
    TripCause.DRIVE_DOWN: lambda watched: watched.robot.drives[0].words.update({0: FAULT}),
    TripCause.DRIVE_RESTARTED: boots,
    TripCause.LOOP_LATE: hangs,
    TripCause.ENDED: lambda watched: watched.end(signal.SIGTERM),
    TripCause.POWER_AT_END: killed,
    TripCause.RECORD_UNUSABLE: torn,
}
"""What happens at 0.3 m/s, by the cause that the watchdog reports. Others are replayed in virtual time:
unit/recording/test_replay_trip.py."""


def replayed(watched: Watched) -> Replayed:
    """The last life in the file of the last trip, which is written once the drives stand."""
    folder, end = Path(watched.state["XDG_STATE_HOME"]) / "canbase", time.monotonic() + WRITTEN_S
    while not (files := sorted(folder.glob("watchdog_robot_*.jsonl"))):
        assert time.monotonic() < end, f"no file in {folder}"
        time.sleep(0.05)
    return replay_trip(read_trip(files[-1]))[-1]


# 0.3 m/s ── something fails ── the watchdog trips ── its inputs into a new one: the same cause in the same tick
@pytest.mark.parametrize("cause", FAILURES, ids=lambda cause: cause.name.lower())
def test_a_recorded_trip_comes_out_the_same(watched: Watched, cause: TripCause) -> None:
    watched.robot.drive_at(300)
    FAILURES[cause](watched)
    life = replayed(watched)
    assert life.life.trip is not None
    assert life.life.trip.cause is cause, life.life.trip
    assert life.trip == life.life.trip
    assert (life.agrees, life.late_s, life.starts) == (True, 0.0, 0)
