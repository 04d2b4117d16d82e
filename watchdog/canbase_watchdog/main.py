"""Command line of the watchdog process: `python -m canbase_watchdog --config-json JSON`."""

from __future__ import annotations

import argparse
import dataclasses
import logging
import os
import signal
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import FrameType

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog import frames, latch_file, realtime
from canbase_watchdog import single_instance as sole
from canbase_watchdog.bus_port import BusError, BusPort
from canbase_watchdog.input_ring import InputRing
from canbase_watchdog.latch_file import Keeper
from canbase_watchdog.lease_socket import LeaseSocket, LeaseSocketError
from canbase_watchdog.log import Lines, formatter, never_wait
from canbase_watchdog.loop import BusDeadError, Loop
from canbase_watchdog.relay import Relay, RelayError
from canbase_watchdog.sd_notify import notify
from canbase_watchdog.trip_recorder import TripRecorder, folder_of
from canbase_watchdog.watchdog import Watchdog

LISTEN_S = 0.16
"""Three periods of a watchdog's state frame."""
WRITE_S = 1.0
"""For the record at the end."""

_log = logging.getLogger("canbase.watchdog")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM. Exit code 0: by a signal; 1: bus, socket or relay failed; 2: bad configuration."""
    never_wait(os.environ)
    handler = Lines()
    handler.setFormatter(formatter(os.environ, os.fstat(2)))
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    parser = argparse.ArgumentParser(prog="canbase_watchdog", description="the independent watchdog of a canbase robot")
    parser.add_argument("--config-json", required=True, help="WatchdogConfig.to_json() of the robot")
    text = parser.parse_args(arguments).config_json
    try:
        config = WatchdogConfig.from_json(text)
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        _log.error("--config-json is no watchdog configuration: %s. Use what WatchdogConfig.to_json() writes.", error)
        return 2
    try:
        return _serve(config)
    except (BusError, LeaseSocketError, BusDeadError, RelayError, sole.TakenError) as error:
        _log.error("%s", error)
        return 1


def _serve(config: WatchdogConfig) -> int:
    asked: list[int] = []

    def on_signal(number: int, _: FrameType | None) -> None:
        asked.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    uid = os.getuid() if config.lease_uid is None else config.lease_uid
    config = dataclasses.replace(config, lease_uid=uid)
    with ExitStack() as stack:
        stack.enter_context(sole.take(config.bus_arguments))
        record = latch_file.path_of(os.environ, Path.home(), config.robot)
        stack.enter_context(sole.take_record(record))
        bus = stack.enter_context(BusPort(config.bus_arguments))
        _listen_for_another(bus)
        leases = stack.enter_context(LeaseSocket(config.lease_socket, uid))
        relay = stack.enter_context(Relay(config.relay)) if config.relay else None
        keeper = Keeper(record, config.robot)
        started_s = time.monotonic()
        watchdog = Watchdog(config, started_s, keeper.past)
        inputs = InputRing(config.recording_s, started_s)
        recorder = TripRecorder(inputs, config, keeper.past, folder_of(config, os.environ, Path.home()))
        try:
            _guard(Loop(watchdog, bus, leases, relay, keeper, inputs, recorder), keeper, recorder, asked)
        except BaseException:
            for frame in watchdog.quick_stops():
                bus.send(frame)
            raise
        finally:
            keeper.finish(WRITE_S)
            recorder.finish(WRITE_S, time.monotonic())
    _log.info("ended by %s", signal.Signals(asked[0]).name)
    return 0


def _listen_for_another(bus: BusPort) -> None:
    """A watchdog on another computer: its frames come before the first frame of this one. Raises sole.TakenError."""
    end = time.monotonic() + LISTEN_S
    while (left_s := end - time.monotonic()) > 0.0:
        bus.wait(left_s)
        received = bus.receive(time.monotonic())
        if any(cob_id in (frames.STATE, frames.WATCHDOG_HEARTBEAT) for cob_id, _, _ in received):
            raise sole.TakenError(
                f"another watchdog is on the bus: its heartbeat or state frame came within {LISTEN_S} s. "
                "Only one may run; end it first, on the computer that it runs on"
            )


def _guard(loop: Loop, keeper: Keeper, recorder: TripRecorder, asked: list[int]) -> None:
    complaint = realtime.prepare()
    if complaint is not None:
        _log.warning("%s", complaint)
    keeper.start()  # with the priority of this thread: one below it that holds Python's lock would hold this one up
    recorder.start()
    notify("READY=1")
    loop.run(lambda: bool(asked))
    notify("STOPPING=1")
