"""A base that drives steadily until something fails: how long and how far it goes on, by the plant's ground truth."""

from __future__ import annotations

import math
import os
import pickle
from dataclasses import dataclass
from random import Random

from canbase_campaign.robots import DrawnRobot, campaign_robot
from canbase_campaign.scenario import Start
from canbase_campaign.twins import GOAL, JOYSTICK, SPEED_MPS, Twin
from canbase_campaign.world import World
from canbase_config.robot import Rates
from canbase_sim.plant.base import PlantParameters
from canbase_velocity.twist import ZERO, Twist

CRUISES_S, LONGEST_S, RESTS_S, LOOK_S = 1.5, 8.0, 0.6, 0.002
"""Until the base drives steadily; longer than any stop; a base that stood this long has stopped; period of looks."""
GOAL_M, JOYSTICK_S = 4.5, 0.02
PHASE_S = 0.1
"""The failure comes up to so much later: SYNCs, leases and heartbeats are anywhere in their periods then."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run. `time_s`: from the failure until the lasting standstill of the base, infinity: it never came.

    `power_off_s`: until no motor had power, infinity: some always had. `peak_mps`: of the fastest rim.
    """

    time_s: float
    distance_m: float
    power_off_s: float
    peak_mps: float


class Cruise:
    """A world whose base drives steadily. The joystick orders `ordered`, for ever; None: it publishes nothing."""

    def __init__(self, by: str, speed_mps: float = SPEED_MPS, rates: str = "standard") -> None:
        """`rates`: a profile of rates in robot.yaml."""
        robot = campaign_robot().model_copy(update={"rates": Rates.model_validate({"profile": rates})})
        start = Start(DrawnRobot(0, robot, PlantParameters()))
        self.world, self.around = start.world, start.around
        self.ordered: Twist | None = Twist(speed_mps, 0.0) if by == JOYSTICK else None
        if by == GOAL:
            self.world.action.send_goal(GOAL_M, speed_mps)
        self._push()
        self.world.clock.run_until(self.world.clock.now_s + CRUISES_S)

    def _push(self) -> None:
        if self.ordered is not None:
            self.world.topics.publish("cmd_vel_joy", self.ordered)
        self.world.clock.after(JOYSTICK_S, self._push)

    def fork(self, twin: Twin, seed: int) -> Run:
        """One run in a copy of this process: the base goes on driving here."""
        reader, writer = os.pipe()
        pid = os.fork()
        if pid == 0:
            try:
                os.write(writer, pickle.dumps(self.run(twin, seed)))
            finally:
                os._exit(0)
        os.close(writer)
        with os.fdopen(reader, "rb") as pipe:
            told = pipe.read()
        os.waitpid(pid, 0)
        run = pickle.loads(told)
        assert isinstance(run, Run)
        return run

    def run(self, twin: Twin, seed: int) -> Run:
        """One run in this very world, which is spent then."""
        world, clock, random = self.world, self.world.clock, Random(f"{twin.key} {seed}")
        world.random.seed(seed)
        clock.run_until(clock.now_s + random.uniform(0.0, PHASE_S))
        watch = _Watch(self.world)
        twin.begin(world, self.around, random)
        if twin.then_zero_s:
            watch.look_for(twin.then_zero_s)
            self.ordered = ZERO
            watch.begin()
        watch.until_it_rests()
        return watch.run


class _Watch:
    """Looks at the ground truth, from now on."""

    def __init__(self, world: World) -> None:
        self._world, self._peak_mps, self._power_off_at = world, 0.0, math.inf
        self.begin()

    def begin(self) -> None:
        """What is measured begins now; the fastest wheel and the power are watched since this was made."""
        base = self._world.drives.bench.base
        self._began = self._moved_at = self._world.clock.now_s
        self._from_m = (base.x_m, base.y_m)

    def look_for(self, seconds: float) -> None:
        """Let time pass."""
        end = self._world.clock.now_s + seconds
        while self._world.clock.now_s < end - LOOK_S / 2.0:
            self._look()

    def until_it_rests(self) -> None:
        """Until it has been standing for a while, or LONGEST_S."""
        while self._world.clock.now_s < min(self._moved_at + RESTS_S, self._began + LONGEST_S):
            self._look()

    def _look(self) -> None:
        clock, drives = self._world.clock, self._world.drives.bench
        clock.run_until(clock.now_s + LOOK_S)
        rim_mps = max(abs(drives.base.v_left_mps), abs(drives.base.v_right_mps))
        self._peak_mps = max(self._peak_mps, rim_mps)
        if rim_mps > self._world.robot.base.standstill_mps:
            self._moved_at = clock.now_s
        if any(axis.motor.powered for node in drives.nodes.values() for axis in node.axes):
            self._power_off_at = math.inf
        else:
            self._power_off_at = min(self._power_off_at, clock.now_s)

    @property
    def run(self) -> Run:
        """What was seen."""
        base = self._world.drives.bench.base
        stood = self._world.clock.now_s >= self._moved_at + RESTS_S - LOOK_S
        distance_m = math.dist(self._from_m, (base.x_m, base.y_m))
        time_s = self._moved_at - self._began if stood else math.inf
        return Run(time_s, distance_m, self._power_off_at - self._began, self._peak_mps)
