"""A base that drives steadily until something fails: how long and how far it goes on, by the plant's ground truth."""

from __future__ import annotations

import math
import traceback
from dataclasses import dataclass
from random import Random

from canbase_campaign.forked import in_a_copy
from canbase_campaign.robots import DrawnRobot, rolls_out
from canbase_campaign.scenario import Start
from canbase_campaign.twins import GOAL, JOYSTICK, SPEED_MPS, Twin
from canbase_campaign.world import World
from canbase_config.stopping import jerk_adds_s, longest_ramp_s, max_wheel_mps
from canbase_runtime.driver_state import DriverState
from canbase_velocity.decision import Action
from canbase_velocity.twist import ZERO, Twist
from canbase_watchdog.watchdog import State as WatchdogState

CRUISES_S, LONGEST_S, RESTS_S, LOOK_S = 1.5, 8.0, 0.6, 0.002
"""Until the base drives steadily; longer than a stop of the sample; a base that stood this long has stopped; looks."""
REACTS_S, LEAST_ROLL_MPS2 = 3.0, 0.05
"""Until the last layer has acted; a base without power that loses less speed than this does not stop."""
STEADY_S = 0.5
"""The base drives at its speed for so long at least, before something fails."""
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
    speed_mps: float = 0.0
    """Of the base when the failure began."""
    cause: str = ""
    """Which part reported first that it stops the base, and why; empty: none did."""
    acts_s: float = math.inf
    """Until that report [s]; infinity: none."""


class RunError(RuntimeError):
    """A run ended with an exception, or its process died."""


class Cruise:
    """A world whose base drives steadily. The joystick orders `ordered`, for ever; None: it publishes nothing."""

    def __init__(
        self, by: str, speed_mps: float = SPEED_MPS, drawn: DrawnRobot | None = None, turn_radps: float = 0.0
    ) -> None:
        """`drawn`: None: the sample robot. `turn_radps`: of the joystick. Raises RuntimeError: its drives cannot be
        enabled."""
        start = Start(drawn)
        self.world, self.around = start.world, start.around
        self.around.cruise_mps = speed_mps
        self.ordered: Twist | None = Twist(speed_mps, turn_radps) if by == JOYSTICK else None
        if by == GOAL:
            self.world.action.send_goal(self._goal_m(speed_mps), speed_mps)
        self._push()
        limits = self.world.robot.limits
        turns_s = abs(turn_radps) / limits.angular_acceleration_radps2
        speeds_up_s = max(abs(speed_mps) / limits.acceleration_mps2, turns_s) + jerk_adds_s(limits)
        self.world.clock.run_until(self.world.clock.now_s + max(CRUISES_S, speeds_up_s + STEADY_S))

    def _goal_m(self, speed_mps: float) -> float:
        """Far enough for every failure, or as far as robot.yaml lets a goal be."""
        return min(self.world.robot.action.max_distance_m, max(GOAL_M, 4.0 * speed_mps))

    def _push(self) -> None:
        if self.ordered is not None:
            self.world.topics.publish("cmd_vel_joy", self.ordered)
        self.world.clock.after(JOYSTICK_S, self._push)

    def fork(self, twin: Twin, seed: int) -> Run:
        """One run in a copy of this process: the base goes on driving here. RunError: it raised, with its traceback."""
        run = in_a_copy(lambda: self._run_or_error(twin, seed)) or "the process of the run died"
        if not isinstance(run, Run):
            raise RunError(str(run))
        return run

    def _run_or_error(self, twin: Twin, seed: int) -> Run | str:
        try:
            return self.run(twin, seed)
        except Exception:  # noqa: BLE001 - whatever it is: that nothing raises is one of the properties
            return traceback.format_exc(limit=-4)

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
        self._longest_s, self._cause, self._acts_at = longest_stop_s(world.drawn), "", math.inf
        self.begin()

    def begin(self) -> None:
        """What is measured begins now; the fastest wheel and the power are watched since this was made."""
        base = self._world.drives.bench.base
        self._began = self._moved_at = self._world.clock.now_s
        self._from_m, self._from_mps = (base.x_m, base.y_m), abs(base.v_mps)

    def look_for(self, seconds: float) -> None:
        """Let time pass."""
        end = self._world.clock.now_s + seconds
        while self._world.clock.now_s < end - LOOK_S / 2.0:
            self._look()

    def until_it_rests(self) -> None:
        """Until it has been standing for a while, or for longer than any stop takes."""
        while self._world.clock.now_s < min(self._moved_at + RESTS_S, self._began + self._longest_s):
            self._look()

    def _look(self) -> None:
        clock, drives = self._world.clock, self._world.drives.bench
        clock.run_until(clock.now_s + LOOK_S)
        rim_mps = max(abs(drives.base.v_left_mps), abs(drives.base.v_right_mps))
        self._peak_mps = max(self._peak_mps, rim_mps)
        self._cause = self._cause or _cause(self._world)
        self._acts_at = min(self._acts_at, clock.now_s if self._cause else math.inf)
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
        power_off_s = self._power_off_at - self._began
        acts_s = self._acts_at - self._began
        return Run(time_s, distance_m, power_off_s, self._peak_mps, self._from_mps, self._cause, acts_s)


def longest_stop_s(drawn: DrawnRobot) -> float:
    """No stop of this robot takes longer: two ramps and a roll without power, or LONGEST_S."""
    robot = drawn.robot
    rolls_s = max_wheel_mps(robot) / max(rolls_out(drawn)[0], LEAST_ROLL_MPS2)
    return max(LONGEST_S, REACTS_S + 2.0 * longest_ramp_s(robot) + rolls_s)


def _cause(world: World) -> str:
    """What stops the base now, as the part that does it reports it; of two the one that takes the power."""
    watchdog, driver, decision = world.watchdog, world.driver, world.velocity.decision
    if watchdog.running and watchdog.core.status.state is WatchdogState.TRIPPED:
        return f"watchdog: {watchdog.core.status.verdict.cause.name.lower().replace('_', ' ')}"
    if driver.running and driver.core.state is not DriverState.ENABLED:
        return f"driver: {driver.core.finding.cause.value}"
    if world.velocity.running and decision is not None and decision.action is Action.STOP:
        return f"safety filter: {decision.cause.value}"
    return ""
