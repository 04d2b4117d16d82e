"""The goal that has the base, if any: runs it, and ends it exactly once.

Who may take it, and when, is decided in `goal_queue.py`. After `fail` the goal only stops, and ends with INTERNAL.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from canbase_action_server.goal import CycleResult, GoalPhase, GoalRun
from canbase_action_server.goal_request import Request
from canbase_action_server.inputs import Inputs
from canbase_action_server.motion import STOP
from canbase_action_server.motion_limits import standstill_limits
from canbase_action_server.outcome import ErrorCode, GoalOutcome
from canbase_action_server.standstill import Standstill, StandstillVerdict
from canbase_action_server.state_topics import ODOMETRY
from canbase_config.robot import Robot

FAREWELL_S = 0.2
"""After the end of a goal the server orders zero for this long. Then the source publishes nothing: others may drive."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A defect of the server during a goal, and the stop that follows, without `GoalRun`, which may be at fault."""

    error: Exception
    standstill: Standstill


class ActiveGoal:
    """The base and the goal that has it."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._goal: GoalRun | None = None
        self._failure: Failure | None = None
        self._began = 0.0
        self._silent_from = -1.0

    @property
    def busy(self) -> bool:
        """A goal owns the base."""
        return self._goal is not None

    @property
    def phase(self) -> GoalPhase:
        """Of the goal that owns the base; ENDED when there is none."""
        return self._goal.phase if self._goal else GoalPhase.ENDED

    def start(self, request: Request, inputs: Inputs, now_s: float) -> None:
        """The base now belongs to this goal. RuntimeError when it has an owner, or its odometry is lost."""
        start = inputs.odometry.within(ODOMETRY.timeout_s(self._robot), now_s)
        if self.busy or start is None:
            raise RuntimeError("a goal took a base that is not free, or whose odometry is lost")
        motion = request.motion(self._robot, start)
        self._goal = GoalRun(self._robot, motion, start, now_s, request.terms.time_allowance_s)
        self._began = now_s

    def tick(self, inputs: Inputs, now_s: float) -> CycleResult | None:
        """One control cycle. None: nothing is ordered, the source publishes nothing."""
        if self._goal is None:
            return CycleResult(STOP) if now_s < self._silent_from else None
        if self._failure is None:
            order = self._goal.tick(inputs, now_s)
        else:
            order = self._end_failed(self._failure, self._goal.traveled_m, inputs, now_s)
        if order.end is None:
            return order
        self._release(now_s)
        return replace(order, end=self._timed(order.end, now_s))

    def fail(self, error: Exception, now_s: float) -> None:
        """Something in the server broke: from now on the goal only stops. The first failure stays."""
        if self._goal is not None and self._failure is None:
            limits = self._robot.limits
            stop = standstill_limits(self._robot, limits.deceleration_mps2)
            self._failure = Failure(error, Standstill(stop, now_s, limits.linear_mps))

    def give_up(self, code: ErrorCode, message: str, now_s: float) -> CycleResult | None:
        """Ends the goal at once, standing or not, because the process has no more time. None: there was no goal."""
        if self._goal is None:
            return None
        traveled_m = self._goal.traveled_m
        self._release(now_s)
        return CycleResult(STOP, end=self._timed(GoalOutcome(code, traveled_m, 0.0, message), now_s))

    def _timed(self, end: GoalOutcome, now_s: float) -> GoalOutcome:
        return replace(end, duration_s=now_s - self._began)

    def _end_failed(self, failure: Failure, traveled_m: float, inputs: Inputs, now_s: float) -> CycleResult:
        verdict = failure.standstill.judge(inputs, now_s)
        if verdict is StandstillVerdict.WAIT:
            return CycleResult(STOP)
        message = f"defect in the action server ({failure.error!r}), see its log; the base {verdict.value}"
        return CycleResult(STOP, end=GoalOutcome(ErrorCode.INTERNAL, traveled_m, 0.0, message))

    def _release(self, now_s: float) -> None:
        self._goal = None
        self._silent_from = now_s + FAREWELL_S
