"""A commissioning session before the simulated drives, in virtual time, and frames of others in between."""

from __future__ import annotations

from collections.abc import Callable

from canbase_commissioning.session import Session
from canbase_config.robot import Robot
from canbase_driver.cia301.frame import Frame
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.world.bench import Bench, BenchParameters
from support.sim_rig import robot as small_robot


class SessionWorld:
    """Drives that have just been switched on, and the clock. `said`: the frames of the session, with their times."""

    def __init__(
        self, robot: Robot | None = None, drives: Robot | None = None, parameters: BenchParameters | None = None
    ) -> None:
        """`drives`: the real ones, where they differ from `robot`."""
        self.robot = robot or small_robot()
        self.now_s = 100.0
        self.bench = Bench(drives or self.robot, self.now_s, parameters=parameters)
        self.said: list[tuple[float, Frame]] = []
        self.others: list[Callable[[float], list[Frame]]] = []
        """Other programs on the bus: they are called each turn for their frames."""
        self.wait(0.5)

    def wait(self, seconds: float) -> None:
        """Let time pass without a session."""
        end = self.now_s + seconds
        while self.now_s < end:
            self.turn(None)

    def run(self, session: Session, limit_s: float = 60.0) -> float:
        """Until the session is done; how long it took [s]. Fails after `limit_s`."""
        start = self.now_s
        while not session.done:
            assert self.now_s - start < limit_s, "the session does not end"
            self.turn(session)
        return self.now_s - start

    def turn(self, session: Session | None) -> None:
        """2 ms."""
        self.now_s = round(self.now_s + 0.002, 6)
        sent = session.tick(self.now_s) if session else []
        self.said += [(self.now_s, frame) for frame in sent]
        foreign = [frame for other in self.others for frame in other(self.now_s)]
        for frame in [*sent, *foreign]:
            self.bench.on_frame(BenchFrame(frame.cob_id, frame.data, remote=frame.remote), self.now_s)
        for heard in [*foreign, *(Frame(f.cob_id, f.data) for f in self.bench.tick(self.now_s))]:
            if session is not None:
                session.on_frame(heard, self.now_s)
