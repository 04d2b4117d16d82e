"""One goal from its acceptance to its outcome: DRIVING → STOPPING → ENDED. Knows no ROS and reads no clock.

Rules. Every ending passes through STOPPING: zero is commanded; the goal ends once the base is known to stand. A goal
that comes to stand short of its goal goes on. `causes.py`: why a goal ends; `standstill.py`: does the base stand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

from canbase_action_server.causes import ARRIVED, Situation, cause_while_driving, cause_while_stopping
from canbase_action_server.inputs import Inputs, Odometry
from canbase_action_server.motion import STOP, BaseTwist, Motion
from canbase_action_server.motion_limits import standstill_limits
from canbase_action_server.outcome import ErrorCode, GoalOutcome
from canbase_action_server.standstill import Standstill, StandstillVerdict
from canbase_action_server.state_topics import States
from canbase_config.robot import Robot

STOPPED_PATIENCE_S = 0.3
"""The filter stops at once; the goal gives up when it still does after this, not for one bad scan."""
PROGRESS_M = 0.001
"""Less than this farther than ever before is not progress."""


class GoalPhase(Enum):
    """Where the goal is."""

    DRIVING = "driving"
    STOPPING = "stopping"
    ENDED = "ended"


TRANSITIONS = {
    (GoalPhase.DRIVING, GoalPhase.STOPPING): "the distance is driven, or a cause ends the goal",
    (GoalPhase.STOPPING, GoalPhase.DRIVING): "at standstill short of the goal, and nothing else ended it",
    (GoalPhase.STOPPING, GoalPhase.ENDED): "at standstill, or the time for it is over",
}


@dataclass(frozen=True, slots=True)
class Feedback:
    """What the client reads on the way; of a turn, the way of the wheels on their circle."""

    traveled_m: float
    remaining_m: float


@dataclass(frozen=True, slots=True)
class CycleResult:
    """The result of one control cycle."""

    twist: BaseTwist
    feedback: Feedback | None = None
    end: GoalOutcome | None = None


class GoalRun:
    """A goal that owns the base. `tick` once per control cycle until it gives an end."""

    def __init__(
        self, robot: Robot, motion: Motion, start: Odometry, now_s: float, time_allowance_s: float = math.inf
    ) -> None:
        """`motion` begins at `start`. `time_allowance_s`: the client's own limit of the overall time."""
        self._robot = robot
        self._motion = motion
        self._own_source = robot.mux.action_source
        overall_s = robot.action.overall_factor * self._motion.ideal_s + robot.action.overall_extra_s
        self._overall_s = min(overall_s, time_allowance_s)
        self._started = self._ticked_at = now_s
        self._gap_s = 0.0
        self._phase = GoalPhase.DRIVING
        self._cause = ARRIVED
        self._standstill: Standstill | None = None
        self._last_odometry = start
        self._jumped = False
        self._pose_resets: int | None = None
        """As the driver had counted them when the goal began."""
        self._pose_was_reset = False
        self._stopped_since: float | None = None
        self._best_remaining_m = self._motion.remaining_m
        self._progress_time = now_s
        self._next_feedback = now_s

    @property
    def phase(self) -> GoalPhase:
        """Where the goal is now."""
        return self._phase

    @property
    def traveled_m(self) -> float:
        """Along the way, signed [m]."""
        return self._motion.traveled_m

    def tick(self, inputs: Inputs, now_s: float) -> CycleResult:
        """The order of this cycle, the feedback, and whether the goal has ended. RuntimeError after the end."""
        if self._phase is GoalPhase.ENDED:
            raise RuntimeError("the goal has ended: it orders nothing any more")
        self._gap_s, self._ticked_at = now_s - self._ticked_at, now_s
        states = States.at(self._robot, inputs, now_s)
        self._observe(states, now_s)
        situation = self._situation(inputs, states, now_s)
        order = self._drive(situation) if self._phase is GoalPhase.DRIVING else self._stop(situation)
        return replace(order, feedback=self._feedback(now_s))

    def _observe(self, states: States, now_s: float) -> None:
        odometry, safety, driver = states.odometry, states.safety, states.driver
        if driver is not None:
            at_start = self._pose_resets = driver.pose_resets if self._pose_resets is None else self._pose_resets
            self._pose_was_reset = self._pose_was_reset or driver.pose_resets != at_start
        if odometry and odometry.received > self._last_odometry.received:
            known = not (self._pose_was_reset or self._jumped)  # else the pose is not about this motion any more
            self._jumped = self._jumped or (known and not self._motion.observe(odometry))
            self._last_odometry = odometry
        if self._best_remaining_m - self._motion.remaining_m >= PROGRESS_M:
            self._best_remaining_m, self._progress_time = self._motion.remaining_m, now_s
        since = now_s if self._stopped_since is None else self._stopped_since
        self._stopped_since = since if safety is not None and safety.stops else None

    def _situation(self, inputs: Inputs, states: States, now_s: float) -> Situation:
        action = self._robot.action
        return Situation(
            robot=self._robot,
            inputs=inputs,
            states=states,
            now_s=now_s,
            own_source=self._own_source,
            gap_s=self._gap_s,
            odometry_jumped=self._jumped,
            pose_was_reset=self._pose_was_reset,
            off_course=self._motion.strayed(action.lateral_tolerance_m, action.heading_tolerance_rad),
            stopped_s=0.0 if self._stopped_since is None else now_s - self._stopped_since,
            stopped_patience_s=STOPPED_PATIENCE_S,
            no_progress_s=now_s - self._progress_time,
            progress_timeout_s=action.progress_timeout_s,
            running_s=now_s - self._started,
            overall_timeout_s=self._overall_s,
        )

    def _drive(self, situation: Situation) -> CycleResult:
        now_s, cause = situation.now_s, cause_while_driving(situation)
        if cause and cause.code is ErrorCode.NO_PROGRESS and self._near_enough():
            cause = ARRIVED
        twist = None if cause else self._motion.order(now_s)
        if twist is not None:
            return CycleResult(twist)
        self._cause = cause or ARRIVED
        self._go(GoalPhase.STOPPING)
        limits = standstill_limits(self._robot, self._motion.deceleration_mps2)
        self._standstill = Standstill(limits, now_s, self._motion.speed_mps(self._last_odometry))
        return CycleResult(self._motion.stop(now_s))

    def _stop(self, situation: Situation) -> CycleResult:
        now_s = situation.now_s
        self._motion.stop(now_s)
        self._cause = cause_while_stopping(situation, self._cause) or self._cause
        verdict = self._standstill.judge(situation.inputs, now_s) if self._standstill else StandstillVerdict.WAIT
        if self._cause.hands_over:
            verdict = StandstillVerdict.HANDED_OVER
        if verdict is StandstillVerdict.WAIT:
            return CycleResult(STOP)
        if self._stands_short(verdict):
            self._go(GoalPhase.DRIVING)
            self._progress_time = now_s
            return CycleResult(STOP)
        self._go(GoalPhase.ENDED)
        return CycleResult(STOP, end=self._outcome(verdict))

    def _near_enough(self) -> bool:
        return abs(self._motion.remaining_m) <= self._robot.action.tolerance_m

    def _stands_short(self, verdict: StandstillVerdict) -> bool:
        wanted = self._cause.code is ErrorCode.OK and verdict is StandstillVerdict.STANDS
        return wanted and self._motion.remaining_m > self._robot.action.tolerance_m

    def _outcome(self, verdict: StandstillVerdict) -> GoalOutcome:
        motion, cause = self._motion, self._cause
        if verdict is StandstillVerdict.STILL_MOVES and cause.code.leaves_the_base_standing:
            cause = replace(cause, code=ErrorCode.DRIVE_FAULT, message=self._unconfirmed())
        elif cause.code is ErrorCode.OK and motion.overshoot_m > self._robot.action.tolerance_m:
            message = "the base rolled past the goal: too fast for its load or the slope, or the computer was late"
            cause = replace(cause, code=ErrorCode.OVERSHOOT, message=message)
        elif verdict is not StandstillVerdict.STANDS:
            cause = replace(cause, message=f"{cause.message}; the base {verdict.value}")
        went = motion.report()
        text = f"{cause.message}; {went}" if cause.message else f"{went}; at standstill"
        return GoalOutcome(
            cause.code, motion.traveled_m, max(0.0, motion.overshoot_m), text, verdict is StandstillVerdict.STANDS
        )

    def _unconfirmed(self) -> str:
        odometry, limit_mps = self._last_odometry, self._robot.base.standstill_mps
        shown = f"{odometry.linear_mps:.3f} m/s, {odometry.angular_radps:.3f} rad/s (base.standstill_mps {limit_mps:g})"
        return f"ordered to stop, but standstill is not confirmed in time: odom has {shown}; use the emergency stop"

    def _feedback(self, now_s: float) -> Feedback | None:
        if now_s < self._next_feedback:
            return None
        self._next_feedback = now_s + 1.0 / self._robot.action.feedback_hz
        return Feedback(self._motion.traveled_m, self._motion.remaining_m)

    def _go(self, phase: GoalPhase) -> None:
        if (self._phase, phase) not in TRANSITIONS:
            raise RuntimeError(f"a goal cannot go from {self._phase.value} to {phase.value}")
        self._phase = phase
