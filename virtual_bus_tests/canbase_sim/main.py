"""`canbase serve sim`: the simulated drives of a robot.yaml in real time, until SIGINT or SIGTERM.

Ctrl-C and `ros2 launch` interrupt all parts of a robot at once. Drives that vanish while the driver brings the base to
standstill are a failure of the drives, which is latched for the next start: after SIGINT they stay as long as they
receive SYNC. launch sends another one to each part, on a slow computer seconds after that of the terminal.
"""

from __future__ import annotations

import logging
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
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

IN_USE_S = 1.0
"""A driver sends SYNC more often than once in this time [s]."""


def run(robot: Robot, control: str | None = None, *, quiet: bool = False, factory_fresh: bool = False) -> int:
    """Simulate the drives of `robot` on its bus, with the control socket at `control` (default `control_path(robot)`).

    `quiet`: warnings alone are logged. `factory_fresh`: every drive has node id 1 and 125 kbit/s.
    Returns the exit code: 0 after a signal, 1 when the bus or the control socket cannot be used.
    """
    logging.basicConfig(
        level=logging.WARNING if quiet else logging.INFO,
        format="%(created).6f %(levelname)s canbase.sim: %(message)s",
        stream=sys.stderr,
    )
    logging.getLogger("canopen").setLevel(logging.WARNING)  # it logs every SDO
    path = Path(control) if control else control_path(robot)
    with _stop_signals() as signals:
        try:
            _simulate(robot, path, signals, BenchParameters(factory_fresh=factory_fresh))
        except (can.CanError, OSError) as error:
            log.error("CAN bus %s %s: %s; check `bus` in robot.yaml", robot.bus.interface, robot.bus.channel, error)
            return 1
        except ControlError as error:
            log.error("%s", error)
            return 1
    return 0


def _simulate(robot: Robot, path: Path, signals: list[int], parameters: BenchParameters) -> None:
    with closing(RatedBus(robot.bus)) as bus:
        now_s = time.monotonic()
        bench = Bench(robot, now_s, parameters=parameters)
        trace = Trace(bench, now_s)
        with closing(ControlServer(path, bench, trace)) as server:
            log.info("drives %s on %s %s", sorted(bench.nodes), robot.bus.interface, robot.bus.channel)
            loop = Loop(bus, robot.bus.bitrate, bench, trace, server)
            told = False

            def over() -> bool:
                nonlocal told
                ends = is_over(signals, time.monotonic() - loop.sync_at_s)
                if signals and not ends and not told:
                    told = True
                    log.info("the driver still uses these drives: they end after it (Ctrl-\\ or SIGTERM: at once)")
                return ends

            loop.run(over)


def is_over(signals: Sequence[int], silent_s: float) -> bool:
    """`signals`: those that came; `silent_s`: since the last SYNC [s]. SIGINT lets the driver end first."""
    return bool(signals) and (silent_s > IN_USE_S or set(signals) != {signal.SIGINT})


@contextmanager
def _stop_signals() -> Iterator[list[int]]:
    """The numbers of the signals that came; afterwards they do again what they did before."""
    received: list[int] = []

    def on_signal(number: int, frame: FrameType | None) -> None:
        received.append(number)

    ends = (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM)
    before = {number: signal.signal(number, on_signal) for number in ends}
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
