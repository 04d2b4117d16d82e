"""The file of a trip's inputs, and the thread that writes it: after the drives stand, slowly, bounded in number.

Nothing depends on it: what cannot be written is logged once, and a defect in here ends this thread alone.
"""

from __future__ import annotations

import itertools
import logging
import queue
import re
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from canbase_base.latch_record import Found
from canbase_base.own_folder import replaced
from canbase_base.small_thread import SmallThread
from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog import input_ring
from canbase_watchdog.input_ring import Cut, InputRing, Trip, TripWatch
from canbase_watchdog.watchdog import Watchdog

WAITING = 4
LINES_AT_ONCE = 20
PAUSE_S = 0.001
"""A pause after this many lines: the loop never waits for the interpreter longer than they take, 0.2 ms."""
SUFFIX = ".jsonl"

_log = logging.getLogger("canbase.watchdog")


def folder_of(config: WatchdogConfig, environment: Mapping[str, str], home: Path) -> Path:
    """`black_box.folder`, else the first folder that systemd gives (StateDirectory=), else the user's state folder."""
    if config.recording_folder:
        return Path(config.recording_folder)
    given = environment.get("STATE_DIRECTORY", "").partition(":")[0]
    return Path(given or Path(environment.get("XDG_STATE_HOME") or home / ".local" / "state") / "canbase")


class TripRecorder(SmallThread):
    """Has a file written for each trip of this life."""

    def __init__(self, ring: InputRing, config: WatchdogConfig, past: Found | None, folder: Path) -> None:
        """`past`: what the watchdog was made with."""
        super().__init__(name="inputs", daemon=True)
        self._ring, self._config, self._past = ring, config, past
        self._folder = folder
        self._watch = TripWatch(ring, past)
        self._jobs: queue.Queue[tuple[Trip, Cut, float] | None] = queue.Queue(WAITING)
        self._problem = ""

    def record_due_trip(self, watchdog: Watchdog, now_s: float) -> None:
        """After each tick: a trip whose file is due goes to the writer. Never waits."""
        trip = self._watch.due_trip(watchdog, now_s)
        if trip is not None:
            self._hand_over(trip, now_s)

    def finish(self, timeout_s: float, now_s: float) -> None:
        """Write what waits, also a trip that is not over, for at most this long [s], and end."""
        if self._watch.open is not None:
            self._hand_over(self._watch.open, now_s)
        try:
            self._jobs.put(None, timeout=timeout_s)
        except queue.Full:
            return
        if self.is_alive():
            self.join(timeout_s)

    def run(self) -> None:
        """The thread's body."""
        while (job := self._jobs.get()) is not None:
            self._attempt(*job)

    def _hand_over(self, trip: Trip, now_s: float) -> None:
        try:
            self._jobs.put_nowait((trip, self._ring.cut(now_s), time.time() - now_s))
        except queue.Full:
            _log.warning("the inputs of a trip are not recorded: %d trips wait to be written", WAITING)

    def _attempt(self, trip: Trip, inputs: Cut, wall_offset_s: float) -> None:
        try:
            self._write(trip, inputs, wall_offset_s)
            problem = ""
        except OSError as error:
            problem = f"the inputs of a trip cannot be written to {self._folder}: {error.strerror or error}"
        if problem and problem != self._problem:
            _log.warning("%s. Check the folder (black_box.folder) and the disk", problem)
        self._problem = problem

    def _write(self, trip: Trip, inputs: Cut, wall_offset_s: float) -> None:
        """A reader finds only whole files."""
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        path = self._folder / f"{self._prefix}{_stamp(trip.at_s + wall_offset_s)}_{_plain(trip.name)}{SUFFIX}"
        first = input_ring.head(self._config, self._past, trip, wall_offset_s)
        with replaced(path) as file:
            file.writelines(piece.encode() for piece in _slowly(input_ring.lines(first, inputs)))
        for old in sorted(self._folder.glob(f"{self._prefix}*{SUFFIX}"))[: -self._config.recordings]:
            old.unlink(missing_ok=True)

    @property
    def _prefix(self) -> str:
        return f"watchdog_{self._config.robot}_"


def _stamp(wall_s: float) -> str:
    return f"{time.strftime('%Y%m%dT%H%M%S', time.gmtime(wall_s))}.{int(wall_s * 1000.0) % 1000:03d}Z"


def _plain(text: str) -> str:
    return re.sub("[^a-z0-9]+", "_", text.lower())


def _slowly(pieces: Iterator[str]) -> Iterator[str]:
    """The same, many in one, with a pause after each."""
    while chunk := "".join(itertools.islice(pieces, LINES_AT_ONCE)):
        yield chunk
        time.sleep(PAUSE_S)
