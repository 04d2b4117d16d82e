"""`python -m canbase_watchdog.post_stop FILE`: stop frames from a separate process, after driver or watchdog has ended.

Needs the bus and nothing else that runs: no driver, no watchdog, no ROS, no robot.yaml. FILE is what `canbase serve
driver`
and `canbase serve watchdog` leave at their start (--stop-file). systemd calls it by ExecStopPost, after SIGKILL too.

Without a --stop-file, driver and watchdog start it themselves with FILE `-`: it reads their pipe, which ends when they
end, however they end. So the stop frames do not depend on who started them.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from canbase_base.frame_socket import BusError
from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog import frames
from canbase_watchdog.bus_port import BusPort
from canbase_watchdog.frames import Frame

QUICK_STOPS = 3
"""A bus under load may lose one; more than three in a row is a bus that takes none."""
PERIOD_S = 0.01
LIMIT_S = 2
"""An adapter that blocks must not hold up the unit's restart: then the process is ended by SIGALRM."""
PIPE = "-"
"""FILE that stands for standard input."""


def plan(config: WatchdogConfig) -> list[list[Frame]]:
    """Frames to send, round by round, PERIOD_S apart: quick stop thrice, then NMT pre-operational (CiA 301).

    The quick stop goes first, for it needs the PDO that pre-operational switches off; a drive keeps to its ramp after.
    """
    nodes = [drive.node_id for drive in config.drives]
    node_ids = list(dict.fromkeys(nodes))
    layouts = {drive.node_id: drive.layout for drive in config.drives}
    stops = [frames.quick_stop(node_id, nodes.count(node_id), layouts[node_id]) for node_id in node_ids]
    return [*([stops] * QUICK_STOPS), [frames.pre_operational(node_id) for node_id in node_ids]]


def send(rounds: Sequence[Sequence[Frame]], bus: BusPort, sleep: Callable[[float], None]) -> bool:
    """Send all of it, once. False: the bus did not take every frame."""
    for frames_of_round in rounds:
        for frame in frames_of_round:
            bus.send(frame)
        sleep(PERIOD_S)
    return bus.health.send_errors == 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code 0: the bus took all frames; 1: it did not, or cannot be opened; 2: FILE cannot be read."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    if len(given) != 1:
        print("usage: python -m canbase_watchdog.post_stop FILE", file=sys.stderr)
        return 2
    try:
        config = WatchdogConfig.from_json(_content(given[0]))
    except (OSError, TypeError, ValueError, KeyError, AttributeError) as error:
        print(
            f"{given[0]} does not describe what to stop: {error}. The driver writes it at its start.", file=sys.stderr
        )
        return 2
    return _stop(config, quiet=given[0] == PIPE)  # at a terminal an orderly end is over by then


def _content(file: str) -> str:
    """The whole of FILE, from then on within LIMIT_S. A pipe is whole when its writer has ended; until then no signal
    that ends the writer in an orderly way ends this process: its stop may still fail."""
    if file == PIPE:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        content = sys.stdin.read()
        signal.alarm(LIMIT_S)
        return content
    signal.alarm(LIMIT_S)
    return Path(file).read_text(encoding="utf-8")


def _stop(config: WatchdogConfig, *, quiet: bool) -> int:
    try:
        with BusPort(config.bus_arguments) as bus:
            taken = send(plan(config), bus, time.sleep)
    except BusError as error:
        print(error, file=sys.stderr)
        return 1
    if not taken:
        print("the bus did not take all stop frames", file=sys.stderr)
    elif not quiet:
        print("stop frames sent", file=sys.stderr)
    return 0 if taken else 1


if __name__ == "__main__":
    sys.exit(main())
