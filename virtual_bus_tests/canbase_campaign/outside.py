"""The world around the base: joystick, navigation, the client of the action, the operator, scanner, stop button."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from canbase_campaign.planned import GoalRequest, Plan, Segment
from canbase_campaign.scanner import Scanner
from canbase_campaign.wall_place import SPEEDING_UP_MPS, far_enough_m
from canbase_campaign.world import World
from canbase_config.robot import Robot
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_velocity.clearance import NOWHERE, Points
from canbase_velocity.twist import Twist

NAN = Twist(math.nan, 0.3)
BEAMS = 360
PERIOD_S, ROOM = 0.1, 2.5
"""Scanner and stop button publish so often, or more often where robot.yaml misses them sooner."""


class Outside:
    """Carries out a plan. `resets`: the outcome of each reset that was requested."""

    def __init__(self, world: World, around: Surroundings, plan: Plan, start: float) -> None:
        self._world, self._start = world, start
        self._topics = {name: source.topic for name, source in world.robot.mux.sources.items()}
        self.resets: list[RequestOutcome] = []
        self.asked_at = -math.inf
        """When the operator last requested one."""
        around.reset = self.reset
        clock = world.clock
        for segment in plan.segments:
            clock.at(start + segment.start_s, self._send, segment)
        for goal in plan.goals:
            clock.at(start + goal.start_s, self._ask, goal)
        for at_s in plan.resets_s:
            clock.at(start + at_s, self.reset)

    def reset(self) -> None:
        """The operator requests a reset, whatever the state."""
        self._world.note("operator asks for a reset")
        self.asked_at = self._world.clock.now_s
        self._world.velocity.reset()
        self._world.driver.reset(self.resets)

    def _ask(self, goal: GoalRequest) -> None:
        self._world.note(f"client asks for {goal.distance_m:+.3f} m")
        self._world.action.send_goal(goal.distance_m, goal.speed_mps)
        if goal.cancel_after_s is not None:
            self._world.clock.after(goal.cancel_after_s, self._world.action.cancel)

    def _send(self, segment: Segment) -> None:
        elapsed_s = self._world.clock.now_s - self._start - segment.start_s
        if elapsed_s >= segment.duration_s:
            return
        self._world.topics.publish(self._topics[segment.source], self._twist(segment, elapsed_s))
        self._world.clock.after(1.0 / segment.rate_hz, self._send, segment)

    def _twist(self, segment: Segment, elapsed_s: float) -> Twist:
        whole = Twist(segment.linear_mps, segment.angular_radps)
        if segment.kind == "weave":
            return whole.scaled(math.cos(6.0 * elapsed_s))
        if segment.kind == "burst":
            return whole.scaled(self._world.random.uniform(-1.0, 1.0))
        if segment.kind == "nan":
            return NAN
        return Twist(0.0, 0.0) if segment.kind == "zero" else whole


def publishes_s(robot: Robot) -> tuple[float, float]:
    """Periods of scanner and stop button [s]: PERIOD_S, or what leaves their timeouts room for a lost message."""
    safety = robot.safety
    return min(PERIOD_S, safety.scan.timeout_s / ROOM), min(PERIOD_S, safety.estop.timeout_s / ROOM)


class Surroundings:
    """Scanner and stop button. `wall_m`: free way ahead and behind at the time of `put_wall`; None: nothing there."""

    def __init__(self, world: World, has_scanner: bool = True) -> None:
        """`has_scanner`: of a robot without one nothing is known about walls."""
        self._world = world
        self.scan_s, self.button_s = publishes_s(world.robot)
        self.pressed = False
        self.scans, self.speaks = has_scanner, True
        """The scanner sends, the stop button sends."""
        self.cruise_mps = 0.0
        """The base drives at it when one failure is to stop it."""
        self.scanner: Scanner | None = None
        """Its readings go the whole way into the filter; None: places do."""
        self.wall_m: float | None = None
        self.wall_at = -math.inf
        """When it came."""
        self.room_mps = math.inf
        """Up to this speed there is room before it, where the scanner shows an old world; infinity: it does not."""
        self._wall_from_m = self._wall_from_rad = 0.0
        self.reset: Callable[[], None] = lambda: None
        """The operator requests a reset; set by the part that plays the operator."""
        self._scan()
        self._speak()

    def look_closely(self) -> None:
        """The scanner sends readings from now on."""
        footprint = self._world.robot.safety.footprint
        self.scanner = Scanner(footprint.front_m, footprint.rear_m)

    def put_wall(self, margin_m: float) -> None:
        """A wall appears in both directions of travel, where the base can still stop before it."""
        base, lies = self._world.drives.bench.base, self.scanner is not None and bool(self.scanner.lies)
        self.wall_at = self._world.clock.now_s
        self.wall_m = far_enough_m(self._world.robot, base.v_mps, self.scan_s, lies=lies) + margin_m
        self.room_mps = abs(base.v_mps) + SPEEDING_UP_MPS if lies else math.inf
        self._wall_from_m, self._wall_from_rad = base.travel_m, base.turned_rad

    def take_wall(self) -> None:
        """The wall is gone."""
        self.wall_m = None

    @property
    def turned_rad(self) -> float:
        """How far the base is turned away from the wall that was put."""
        return abs(self._world.drives.bench.base.turned_rad - self._wall_from_rad)

    @property
    def free_m(self) -> tuple[float, float]:
        """Free way ahead and behind now [m]."""
        if self.wall_m is None:
            return math.inf, math.inf
        gone_m = self._world.drives.bench.base.travel_m - self._wall_from_m
        return self.wall_m - gone_m, self.wall_m + gone_m

    def _seen(self) -> Points:
        """Each wall as two neighbouring beams see it; a wall that the base has run into stays at its edge."""
        if self.wall_m is None:
            return Points(NOWHERE, np.empty(0, dtype=np.intp), BEAMS)
        footprint, (ahead_m, behind_m) = self._world.robot.safety.footprint, self.free_m
        ahead_x_m, behind_x_m = footprint.front_m + max(0.0, ahead_m), -footprint.rear_m - max(0.0, behind_m)
        places = [(ahead_x_m, -0.02), (ahead_x_m, 0.02), (behind_x_m, 0.02), (behind_x_m, -0.02)]
        return Points(np.array(places), np.array((0, 1, BEAMS // 2, BEAMS // 2 + 1)), BEAMS)

    def press(self, pressed: bool) -> None:
        """The emergency stop is pressed or released; that is published at once."""
        self.pressed = pressed
        self._tell()

    def _tell(self) -> None:
        if self.speaks:
            self._world.topics.publish("estop_state", self.pressed)

    def _scan(self) -> None:
        if self.scans:
            self._world.topics.publish(
                "scan",
                self._seen() if self.scanner is None else self.scanner.scan(*self.free_m, self._world.clock.now_s),
            )
        self._world.clock.after(self.scan_s, self._scan)

    def _speak(self) -> None:
        self._tell()
        self._world.clock.after(self.button_s, self._speak)
