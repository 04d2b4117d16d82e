"""Which goals are accepted, which of them owns the base, and which wait: the goal policy, over goals of every action.

Rules.
1. `refusal` and `admit` are called one after the other, without another call in between: so no two goals can both find
   the base free.
2. A goal that is admitted waits. `tick` gives the base to the one that has waited longest, as soon as the base is free.
3. `reject`: no goal is admitted while one waits or runs. `queue`: up to `queue_length` wait. `preempt`: a new goal
   ends all others with PREEMPTED: those that wait at once, the running one when the base stands. Then it has the base.
4. A goal that waits starts only after an end that left the base at standstill at its target. Any other end, such as
   an emergency stop, is theirs too: nothing starts to move by itself when the cause has gone, or from a wrong place.
5. With `require_client_lease` a goal begins once a lease of its client arrived after its acceptance. It ends with
   CLIENT_LOST when no lease arrived for `client_lease_s`.
6. Each goal that was admitted ends exactly once.
7. A goal with `terms.release_s` waits for so long until a program releases the base and the base is at standstill: the
   last commands of Nav2's controller are still fresh then. It does not wait for anything else that speaks against it.
8. A goal with `terms.reports_invalid` and invalid numbers is admitted at any time, ends at once with INVALID_GOAL, and
   preempts nobody.
9. A goal that waits reports feedback too, at `WAITING_FEEDBACK_HZ`: so a client without feedback has no living server.
10. A goal that waits ends when a topic that it depends on is lost (`state_topics.py`), with the code of that topic.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from canbase_action_server.active_goal import ActiveGoal
from canbase_action_server.along_track import BasePose
from canbase_action_server.causes import CLIENT_SILENT
from canbase_action_server.goal import CycleResult, Feedback, GoalPhase
from canbase_action_server.goal_request import Request
from canbase_action_server.inputs import Inputs, Odometry
from canbase_action_server.motion import STOP, BaseTwist
from canbase_action_server.outcome import ErrorCode, GoalOutcome
from canbase_action_server.preconditions import commanding_program, is_moving, state_reason
from canbase_action_server.state_topics import STATE_TOPICS, States, without_contested
from canbase_config.robot import Robot
from canbase_runtime.received import NEVER, Received

WAITING_FEEDBACK_HZ = 1.0
"""Like the slowest `action.feedback_hz`; a hundred goals may wait."""
NOWHERE = Odometry(0.0, BasePose(0.0, 0.0, 0.0), 0.0, 0.0)
"""The length of a goal does not depend on where it begins."""


@dataclass(frozen=True, slots=True)
class End:
    """The end of the goal `key`."""

    key: str
    outcome: GoalOutcome


@dataclass(frozen=True, slots=True)
class Against:
    """Why a goal that waits does not start any more."""

    code: ErrorCode
    message: str


@dataclass(frozen=True, slots=True)
class Cycle:
    """The result of one control cycle."""

    twist: BaseTwist | None = None
    """The order for the base; None: nothing is ordered, the source publishes nothing."""
    began: str | None = None
    """Key of the goal that owns the base from now on."""
    feedback: tuple[tuple[str, Feedback], ...] = ()
    """With the key of its goal."""
    ends: tuple[End, ...] = ()


@dataclass(slots=True)
class Admitted:
    """A goal that waits or runs."""

    key: str
    request: Request
    admitted: float
    lease: Received[bool] = NEVER
    """The last sign of life of its client; the first one says that it knows that the goal was accepted."""
    canceled: bool = False
    preempted: bool = False
    invalid: str | None = None
    """Why its numbers are invalid; None: they are good."""
    next_feedback: float = 0.0
    """When it next reports that it waits."""


class GoalQueue:
    """All goals of the server. `key` is any name that no other goal ever had, such as its UUID."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._owner = ActiveGoal(robot)
        self._running: Admitted | None = None
        self._waiting: deque[Admitted] = deque()
        self._failed = False

    @property
    def busy(self) -> bool:
        """A goal runs or waits."""
        return self._running is not None or bool(self._waiting)

    @property
    def running(self) -> str | None:
        """Key of the goal that owns the base."""
        return self._running.key if self._running else None

    @property
    def phase(self) -> GoalPhase:
        """Of the goal that owns the base; ENDED when there is none."""
        return self._owner.phase

    def refusal(self, request: Request, inputs: Inputs, now_s: float) -> str | None:
        """Why a goal with these numbers is rejected; None: it may be admitted."""
        terms, invalid = request.terms, request.range_reason(self._robot)
        if invalid is not None:
            return None if terms.reports_invalid else invalid
        inputs = without_contested(inputs, now_s)
        return self._no_place() or state_reason(self._robot, inputs, now_s, terms.release_s > 0.0)

    def admit(self, key: str, request: Request, now_s: float) -> None:
        """From now on the goal waits for the base. RuntimeError when its numbers are out of range or there is no place.

        `refusal` has judged the state of the robot. The answer to the client can take 0.1 s (DDS waits for a client
        that it does not know yet): a message that became too old meanwhile ends the goal, and is no defect.
        """
        invalid = request.range_reason(self._robot)
        reported = request.terms.reports_invalid and invalid is not None
        reason = None if reported else invalid or self._no_place()
        if reason is not None or key in (goal.key for goal in self._goals()):
            raise RuntimeError(f"goal {key} was admitted, but it is known already, or refused: {reason}")
        if self._robot.action.goal_policy == "preempt" and not reported:
            for goal in self._goals():
                goal.preempted = True
        self._waiting.append(Admitted(key, request, now_s, invalid=invalid))

    def cancel(self, key: str) -> bool:
        """A client wants the goal to end. False: no such goal runs or waits."""
        matching = [goal for goal in self._goals() if goal.key == key]
        for goal in matching:
            goal.canceled = True
        return bool(matching)

    def keepalive(self, key: str, now_s: float) -> None:
        """The client of this goal lives. Nothing happens when no such goal runs or waits."""
        for goal in self._goals():
            if goal.key == key:
                goal.lease = Received(True, now_s)

    def tick(self, inputs: Inputs, now_s: float) -> Cycle:
        """One control cycle."""
        inputs = without_contested(inputs, now_s)
        ends = self._drop(inputs, now_s)
        began = self._begin(inputs, now_s)
        waiting = self._waiting_feedback(now_s)
        running = self._running
        if running is not None:
            lost = self._client_lost(running, now_s)
            inputs = replace(inputs, cancel_requested=running.canceled, preempted=running.preempted, client_lost=lost)
        order = self._owner.tick(inputs, now_s)
        if order is None:
            return Cycle(began=began, feedback=waiting, ends=ends)
        if running is None:
            return Cycle(order.twist, began, waiting, ends)
        feedback = ((running.key, order.feedback),) if order.feedback else ()
        return Cycle(order.twist, began, feedback + waiting, ends + self._ended(order))

    def fail(self, error: Exception, now_s: float) -> None:
        """Something in the server broke: the running goal only stops, all end with INTERNAL."""
        self._failed = True
        self._owner.fail(error, now_s)

    def give_up(self, code: ErrorCode, message: str, now_s: float) -> Cycle:
        """Ends all goals at once, the base standing or not, because the process has no more time."""
        order = self._owner.give_up(code, message, now_s)
        return Cycle(STOP, ends=(self._ended(order) if order else ()) + self._flush(Against(code, message)))

    def _goals(self) -> tuple[Admitted, ...]:
        return (*((self._running,) if self._running else ()), *self._waiting)

    def _no_place(self) -> str | None:
        action = self._robot.action
        if action.goal_policy == "reject" and self.busy:
            return "busy: another goal owns the base; wait for its result, or cancel it"
        if action.goal_policy == "queue" and len(self._waiting) >= action.queue_length:
            return f"busy: {len(self._waiting)} goals wait already (action.queue_length)"
        return None

    def _client_lost(self, goal: Admitted, now_s: float) -> bool:
        action, silent_s = self._robot.action, min(goal.lease.age_s(now_s), now_s - goal.admitted)
        return action.require_client_lease and silent_s > action.client_lease_s

    def _drop(self, inputs: Inputs, now_s: float) -> tuple[End, ...]:
        """The ends of those that shall not wait any longer."""
        causes = [(goal, self._against_waiting(goal, inputs, now_s)) for goal in self._waiting]
        self._waiting = deque(goal for goal, cause in causes if cause is None)
        return tuple(End(goal.key, _not_started(cause)) for goal, cause in causes if cause is not None)

    def _against_waiting(self, goal: Admitted, inputs: Inputs, now_s: float) -> Against | None:
        if self._failed:
            return Against(ErrorCode.INTERNAL, "defect in the action server, see its log")
        if goal.invalid is not None:
            return Against(ErrorCode.INVALID_GOAL, goal.invalid)
        if goal.canceled:
            return Against(ErrorCode.CANCELED, "canceled by request")
        if goal.preempted:
            return Against(ErrorCode.PREEMPTED, "replaced by a newer goal")
        if self._client_lost(goal, now_s):
            return Against(ErrorCode.CLIENT_LOST, CLIENT_SILENT)
        if inputs.shutdown:
            return Against(ErrorCode.SHUTDOWN, "the action server is shutting down")
        return self._lost(inputs, now_s)

    def _lost(self, inputs: Inputs, now_s: float) -> Against | None:
        silences = ((topic.code, topic.silence(self._robot, inputs, now_s)) for topic in STATE_TOPICS)
        return next((Against(code, silence) for code, silence in silences if silence is not None), None)

    def _begin(self, inputs: Inputs, now_s: float) -> str | None:
        if self._owner.busy or not self._waiting:
            return None
        goal = self._waiting[0]
        if self._robot.action.require_client_lease and goal.lease.never:
            return None
        if self._waits_for_release(goal, inputs, now_s):
            return None
        self._owner.start(goal.request, inputs, now_s)
        self._running = self._waiting.popleft()
        return goal.key

    def _waits_for_release(self, goal: Admitted, inputs: Inputs, now_s: float) -> bool:
        states = States.at(self._robot, inputs, now_s)
        held = commanding_program(self._robot, states) or is_moving(self._robot, states)
        if not held or now_s - goal.admitted >= goal.request.terms.release_s:
            return False
        return state_reason(self._robot, inputs, now_s, waits_for_program=True) is None

    def _waiting_feedback(self, now_s: float) -> tuple[tuple[str, Feedback], ...]:
        """Of the goals that wait and are due: nothing traveled, everything remains."""
        due = [goal for goal in self._waiting if now_s >= goal.next_feedback]
        for goal in due:
            goal.next_feedback = now_s + 1.0 / WAITING_FEEDBACK_HZ
        return tuple((goal.key, Feedback(0.0, self._whole_way_m(goal.request))) for goal in due)

    def _whole_way_m(self, request: Request) -> float:
        return request.motion(self._robot, NOWHERE).remaining_m

    def _ended(self, order: CycleResult) -> tuple[End, ...]:
        """The end of the running goal, if this is one, and of those that may not follow it."""
        if self._running is None or order.end is None:
            return ()
        end, self._running = End(self._running.key, order.end), None
        if order.end.code.leaves_the_base_standing:
            return (end,)
        return (end, *self._flush(Against(order.end.code, f"the goal before it ended with {order.end.code.name}")))

    def _flush(self, cause: Against) -> tuple[End, ...]:
        ends = tuple(End(goal.key, _not_started(cause)) for goal in self._waiting)
        self._waiting.clear()
        return ends


def _not_started(cause: Against) -> GoalOutcome:
    return GoalOutcome(cause.code, 0.0, 0.0, f"{cause.message}; it never started")
