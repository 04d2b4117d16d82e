"""Command line of the watchdog process: `python -m canbase_watchdog --config-json JSON`.

A bus that cannot be opened, or takes no frames, is opened again every RETRY_S, for as long as it takes. Meanwhile the
process sends nothing, so no drive gets power: the driver needs its state frame.
"""

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

from canbase_base import single_instance as sole
from canbase_base.frame_socket import BusError
from canbase_base.latch_folder import SUFFIX, latch_folder
from canbase_base.output import never_wait
from canbase_base.sd_notify import notify
from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.lease_socket import LeaseSocketError
from canbase_watchdog.life import RecordError, live
from canbase_watchdog.log import Lines, formatter
from canbase_watchdog.loop import BusDeadError
from canbase_watchdog.relay import RelayError
from canbase_watchdog.report import ALIVE_PERIOD_S

RETRY_S = 1.0
WORKED_S = 3.0
"""A life that was longer had a bus: its loss is reported, also where the reason is that of the last loss."""

_log = logging.getLogger("canbase.watchdog")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM. Exit code 0: by a signal; 1: socket, relay or record failed, or another watchdog is
    there; 2: bad configuration."""
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
    except (LeaseSocketError, RelayError, RecordError, sole.TakenError) as error:
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
        stack.enter_context(sole.take("watchdog", sole.bus_name(config.bus_arguments)))
        record = latch_folder(os.environ, Path.home(), config.robot) / f"watchdog{SUFFIX}"
        stack.enter_context(sole.hold_record(record))
        _live_until_signal(config, record, asked)
    _log.info("ended by %s", signal.Signals(asked[0]).name)
    return 0


def _live_until_signal(config: WatchdogConfig, record: Path, asked: list[int]) -> None:
    """One after the other, until a signal is in `asked`. Another watchdog on the bus is an error at the start alone:
    what was cut off may have got another one meanwhile, and takes its place again when that one has ended."""
    problem = ""
    while not asked:
        began_s = time.monotonic()
        try:
            live(config, record, asked, after_loss=bool(problem))
        except (BusError, BusDeadError, sole.TakenError) as error:
            if isinstance(error, sole.TakenError) and not problem:
                raise
            if str(error) != problem or time.monotonic() > began_s + WORKED_S:
                _log.warning("%s Trying again every %.0f s; meanwhile no drive gets power", error, RETRY_S)
            problem = str(error)
            _wait(problem, asked)


def _wait(problem: str, asked: list[int]) -> None:
    """For RETRY_S. The process is ready: it does all that it can without a bus, and nothing depends on more."""
    notify(f"READY=1\nSTATUS=no bus, trying again: {problem}")
    end_s = time.monotonic() + RETRY_S
    while not asked and time.monotonic() < end_s:
        notify("WATCHDOG=1")
        time.sleep(ALIVE_PERIOD_S)
