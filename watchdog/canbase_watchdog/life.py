"""One life of the watchdog: from the opening of its bus to the request to end, or until the bus takes no frames.

Each life begins as a new process does: it listens, then it judges by the record on disk, so that a trip and power that
nobody saw off are latched. Nothing of what the bus showed before is taken for true.
"""

from __future__ import annotations

import logging
import os
import time
from contextlib import ExitStack
from pathlib import Path

from canbase_base.latch_file import LatchFile, LatchKeeper
from canbase_base.sd_notify import notify
from canbase_base.single_instance import TakenError
from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog import frames, realtime
from canbase_watchdog.bus_port import BusPort
from canbase_watchdog.input_ring import InputRing
from canbase_watchdog.lease_socket import LeaseSocket
from canbase_watchdog.loop import BusDeadError, Loop
from canbase_watchdog.relay import Relay
from canbase_watchdog.trip_recorder import TripRecorder, folder_of
from canbase_watchdog.watchdog import State, Watchdog

LISTEN_S = 0.16
"""Three periods of a watchdog's state frame."""
WRITE_S = 1.0
"""For the record at the end."""

_log = logging.getLogger("canbase.watchdog")


class RecordError(Exception):
    """The record of this life is not on disk: no other life may begin with what is there."""


def live(config: WatchdogConfig, record: Path, asked: list[int], *, after_loss: bool) -> None:
    """Until a signal is in `asked`. Raises BusError: the bus cannot be opened, or BusDeadError: it takes no frames; the
    next life may begin. Raises TakenError, LeaseSocketError, RelayError, RecordError.

    `record`: the file of the latched stop. `after_loss`: the bus was lost, or could not be opened, before. It counts as
    failed until it takes a frame, and what is latched is stopped at once: it may have turned unseen.
    """
    with ExitStack() as stack:
        bus = stack.enter_context(BusPort(config.bus_arguments, after_loss=after_loss))
        _listen_for_another(bus)
        uid = os.getuid() if config.lease_uid is None else config.lease_uid
        leases = stack.enter_context(LeaseSocket(config.lease_socket, uid))
        relay = stack.enter_context(Relay(config.relay)) if config.relay else None
        keeper = LatchKeeper(LatchFile(record.parent, "watchdog", config.robot, must_last=not config.is_virtual))
        started_s = time.monotonic()
        watchdog = Watchdog(config, started_s, keeper.found, loopback=config.hears_itself)
        if after_loss and watchdog.status.state is State.TRIPPED:
            _quick_stop(watchdog, bus)
        inputs = InputRing(config.recording_s, started_s)
        recorder = TripRecorder(inputs, config, keeper.found, folder_of(config, os.environ, Path.home()))
        loop = Loop(watchdog, bus, leases, relay, keeper, inputs, recorder)
        lost = False
        try:
            _guard(loop, keeper, recorder, asked, quiet=after_loss)
        except BaseException as error:
            lost = isinstance(error, BusDeadError)
            _quick_stop(watchdog, bus)
            raise
        finally:
            _finish(keeper, recorder, lost=lost)


def _listen_for_another(bus: BusPort) -> None:
    """A watchdog on another computer: its frames come before the first frame of this one. Raises TakenError."""
    end = time.monotonic() + LISTEN_S
    while (left_s := end - time.monotonic()) > 0.0:
        bus.wait(left_s)
        received = bus.receive(time.monotonic())
        if any(cob_id in (frames.STATE, frames.WATCHDOG_HEARTBEAT) for cob_id, _, _ in received):
            raise TakenError(
                f"another watchdog is on the bus: its heartbeat or state frame came within {LISTEN_S} s. "
                "Only one may run; end it first, on the computer that it runs on."
            )


def _guard(loop: Loop, keeper: LatchKeeper, recorder: TripRecorder, asked: list[int], *, quiet: bool) -> None:
    complaint = realtime.prepare()
    if complaint is not None and not quiet:
        _log.warning("%s", complaint)
    keeper.start()  # with the priority of this thread: one below it that holds Python's lock would hold this one up
    recorder.start()
    notify("READY=1")
    loop.run(lambda: bool(asked))
    notify("STOPPING=1")


def _quick_stop(watchdog: Watchdog, bus: BusPort) -> None:
    for frame in watchdog.quick_stops():
        bus.send(frame)


def _finish(keeper: LatchKeeper, recorder: TripRecorder, *, lost: bool) -> None:
    """`lost`: another life may follow. The recording is then written beside it; two writers of one record may not be,
    and a record that is older than the trip must not be believed."""
    kept = keeper.finish(WRITE_S)
    recorder.finish(0.0 if lost else WRITE_S, time.monotonic())
    if lost and not kept:
        raise RecordError(f"the record of the last trip is not on disk: {keeper.problem or 'the disk does not answer'}")
