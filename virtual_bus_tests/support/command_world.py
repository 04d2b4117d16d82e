"""A command of `canbase` before simulated drives in virtual time: all but the sockets of its bus and the clock."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest
from typer import testing
from typer.main import get_command
from typer.testing import CliRunner, Result

from canbase_cli.main import app
from canbase_commissioning.onbus import adopt_command, alone, bus_session, cable, init_command
from canbase_commissioning.session import Session
from canbase_config.bit_rate import BIT_RATES
from canbase_config.load import load_robot
from canbase_config.robot import Bus
from canbase_driver.cia301.frame import Frame
from canbase_sim.faults import apply
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.world.bench import Bench, BenchParameters, Truth
from canbase_sim.world.rated_wire import RatedWire, Sent
from support.bus_tool import write_robot
from support.udp_port import free_udp_port

_command = cache(get_command)
"""The tree of all commands is built once: it takes longer than most of them here."""
TURN_S = 0.002
"""As a session has it on a real bus."""


def canbase(*words: str) -> Result:
    """A canbase command, run to its end without a terminal."""
    return CliRunner().invoke(app, list(words), env={"COLUMNS": "200"}, catch_exceptions=False)


class CommandWorld:
    """The drives of `config`, just booted, and the clock. Each turn of a command lets TURN_S pass."""

    def __init__(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, *, factory_fresh: bool = False, **drives: Any
    ) -> None:
        """`drives`: keys for both drives in robot.yaml."""
        self.config = write_robot(folder, free_udp_port(), **drives)
        self.now_s, robot = 100.0, load_robot(self.config).robot
        self.bench = Bench(robot, self.now_s, parameters=BenchParameters(factory_fresh=factory_fresh))
        self._wire, self._bitrate = RatedWire(self.bench, BIT_RATES), robot.bus.bitrate
        self.said: list[Frame] = []
        """The frames of the commands."""
        self.others: list[Callable[[float], list[Frame]]] = []
        """Other programs, at the bit rate of robot.yaml: they are called each turn for their frames."""
        self.errors = 0
        """Error frames that the commands have seen."""
        monkeypatch.setattr(testing, "_get_command", _command)
        monkeypatch.setattr(bus_session, "BusSession", partial(Line, self))
        for module in (adopt_command, alone, cable, init_command):
            monkeypatch.setattr(module, "time", self)
        self.sleep(0.5)

    def canbase(self, *words: str) -> Result:
        """A command about this robot."""
        return canbase(*words, "--config", str(self.config))

    def monotonic(self) -> float:
        """In the place of `time.monotonic` [s]."""
        return self.now_s

    def sleep(self, seconds: float) -> None:
        """In the place of `time.sleep`: the drives go on."""
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.turn(None)

    def suffer(self, node_id: int, fault: str, **arguments: object) -> None:
        """Make a drive suffer."""
        apply(self.bench.nodes, node_id, fault, self.now_s, arguments)

    def repeat(self, cob_id: int, data: bytes, period_s: float) -> None:
        """Another program sends this frame, from now on."""
        sent_s = [self.now_s]

        def program(now_s: float) -> list[Frame]:
            if now_s - sent_s[-1] < period_s:
                return []
            sent_s.append(now_s)
            return [Frame(cob_id, data)]

        self.others.append(program)

    @property
    def truth(self) -> Truth:
        """What the wheels really do."""
        return self.bench.truth(self.now_s)

    def turn(self, session: Session | None, bitrate: int | None = None) -> None:
        """One turn, of a session at this bit rate [bit/s]."""
        self.now_s = round(self.now_s + TURN_S, 6)
        rate = bitrate or self._bitrate
        sent = session.tick(self.now_s) if session else []
        self.said += sent
        foreign = [frame for other in self.others for frame in other(self.now_s)]
        seen: list[Sent] = []
        for at, frame in [*((rate, frame) for frame in sent), *((self._bitrate, frame) for frame in foreign)]:
            seen += self._wire.on_frame(BenchFrame(frame.cob_id, frame.data, remote=frame.remote), at, self.now_s)
        heard = foreign if rate == self._bitrate else []
        for at, answer, is_error in [*seen, *self._wire.tick(self.now_s)]:
            if at == rate:
                self.errors += is_error
                heard += [] if is_error else [Frame(answer.cob_id, answer.data)]
        if session is not None:
            for frame in heard:
                session.on_frame(frame, self.now_s)


class Line:
    """In the place of `BusSession`."""

    problem, send_errors = "", 0

    def __init__(self, world: CommandWorld, bus: Bus) -> None:
        self._world, self._bitrate, self._errors = world, bus.bitrate, world.errors

    def __enter__(self) -> Line:
        return self

    def __exit__(self, *error: object) -> None:
        """Nothing is open."""

    @property
    def error_frames(self) -> int:
        """Since it was opened."""
        return self._world.errors - self._errors

    def run(self, session: Session) -> None:
        """Until the session is done."""
        while not session.done:
            self.turn(session)

    def turn(self, session: Session) -> None:
        """One turn of the world."""
        self._world.turn(session, self._bitrate)
