"""`canbase serve sim`: the simulated drives of a robot.yaml in real time, until SIGINT or SIGTERM."""

from __future__ import annotations

import logging
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Event
from types import FrameType

import can

from canbase_config.robot import Robot
from canbase_sim.control import ControlError, control_path
from canbase_sim.control_server import ControlServer
from canbase_sim.loop import Loop
from canbase_sim.rated_bus import RatedBus
from canbase_sim.world.bench import Bench, BenchParameters
from canbase_sim.world.trace import Trace

log = logging.getLogger(__name__)


def run(robot: Robot, control: str | None = None, *, quiet: bool = False, factory_fresh: bool = False) -> int:
    """Simulate the drives of `robot` on its bus, with the control socket at `control` (default `control_path(robot)`).

    `quiet`: warnings alone are logged. `factory_fresh`: every drive has node id 1 and 125 kbit/s.
    Returns the exit code: 0 after SIGINT or SIGTERM, 1 when the bus or the control socket cannot be used.
    """
    logging.basicConfig(
        level=logging.WARNING if quiet else logging.INFO,
        format="%(asctime)s.%(msecs)03d %(levelname)s canbase.sim: %(message)s",
        datefmt="%Y-%m-%d %H:%M:%S",
        stream=sys.stderr,
    )
    logging.getLogger("canopen").setLevel(logging.WARNING)  # it logs every SDO
    path = Path(control) if control else control_path(robot)
    with _stop_signals() as stop:
        try:
            _simulate(robot, path, stop, BenchParameters(factory_fresh=factory_fresh))
        except (can.CanError, OSError) as error:
            log.error("CAN bus %s %s: %s; check `bus` in robot.yaml", robot.bus.interface, robot.bus.channel, error)
            return 1
        except ControlError as error:
            log.error("%s", error)
            return 1
    return 0


def _simulate(robot: Robot, path: Path, stop: Event, parameters: BenchParameters) -> None:
    with closing(RatedBus(robot.bus)) as bus:
        now_s = time.monotonic()
        bench = Bench(robot, now_s, parameters=parameters)
        trace = Trace(bench, now_s)
        with closing(ControlServer(path, bench, trace)) as server:
            log.info("drives %s on %s %s", sorted(bench.nodes), robot.bus.interface, robot.bus.channel)
            Loop(bus, robot.bus.bitrate, bench, trace, server).run(stop.is_set)


@contextmanager
def _stop_signals() -> Iterator[Event]:
    """An event that SIGINT and SIGTERM set; afterwards both do again what they did before."""
    stop = Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        stop.set()

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
