"""Why a goal ends: one row per cause, in the order of precedence.

Rules. Several rows hold at once: the first in the table wins, because it explains those below it (a tripped watchdog
disables the drives, which ends odometry, which ends progress). While the base is being stopped, the rows marked
`while_stopping` go on counting, and one that stands above the cause so far replaces it: a stop that goes wrong must not
be reported as a success. A row returns its sentence, or None while it does not hold.
A state that is too old is missing: no row reads it, and the row of its topic ends the goal (`state_topics.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from canbase_action_server.inputs import Inputs
from canbase_action_server.outcome import ErrorCode
from canbase_action_server.state_topics import DRIVER, MUX, ODOMETRY, SAFETY, States, StateTopic
from canbase_config.robot import Robot
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import SCAN_LOST, StopCause, because
from canbase_runtime.watchdog_view import WatchdogView

CLIENT_SILENT = "no keepalive from the client (action.require_client_lease): it ended, hangs, or sends none"


@dataclass(frozen=True, slots=True)
class Situation:
    """What the rows look at: the inputs, the limits of time, and what the goal itself has measured."""

    robot: Robot
    inputs: Inputs
    states: States
    """What counts of the inputs now."""
    now_s: float
    own_source: str
    gap_s: float
    """Since the control cycle before this one."""
    odometry_jumped: bool
    pose_was_reset: bool
    off_course: str
    """How far the base is beside its line or turned away from it, if that is too far; else empty."""
    stopped_s: float
    """For how long the filter has been stopping this motion, for whatever cause; 0: it does not."""
    stopped_patience_s: float
    no_progress_s: float
    progress_timeout_s: float
    running_s: float
    overall_timeout_s: float


@dataclass(frozen=True, slots=True)
class EndCause:
    """A row that holds."""

    code: ErrorCode
    message: str
    place: int
    """In the table."""

    @property
    def hands_over(self) -> bool:
        """Another source has the base, and moves it: standstill is not waited for."""
        return self.place < len(TABLE) and TABLE[self.place].test is _taken_over


def _estop(s: Situation) -> str | None:
    safety = s.states.safety
    if safety is None or not (safety.estop or safety.cause.is_estop):
        return None
    return f"emergency stop: {safety.detail}; release it, reset, and send a new goal"


def _watchdog(s: Situation) -> str | None:
    driver = s.states.driver
    if driver is None or driver.watchdog is WatchdogView.OK:
        return None
    return f"watchdog {driver.watchdog.value}{because(driver.watchdog_cause)}; find the cause, then reset"


def _drive_fault(s: Situation) -> str | None:
    driver = s.states.driver
    if driver is None or driver.state is DriverState.ENABLED:
        return None
    return f"motor_driver is {driver.state.word}{because(driver.cause)}: {driver.detail}"


def _odometry_lost(s: Situation) -> str | None:
    second = ODOMETRY.second_sender(s.inputs, s.now_s)
    if second is not None:
        return second
    if s.pose_was_reset:
        return "the pose of the odometry was reset during the goal, or missed some travel; send a new goal"
    if s.odometry_jumped:
        return "odometry jumped farther than the base can move: it was reset, or another node publishes odom"
    timeout_s = ODOMETRY.timeout_s(s.robot)
    if s.gap_s > timeout_s:  # what arrives now may look fresh: the base was driven without it
        return (
            f"the action server itself did not run for {s.gap_s:.2f} s and saw no odometry; is the computer overloaded?"
        )
    if s.states.odometry is not None:
        return None
    age_s = s.inputs.odometry.age_s(s.now_s)
    return f"no odometry for {age_s:.2f} s (timeout {timeout_s} s); {_why_no_odometry(s, timeout_s)}"


def _why_no_odometry(s: Situation, timeout_s: float) -> str:
    """A hung driver stops publishing on both topics at once; its status is published less often than odometry."""
    if s.inputs.odometry.age_s(s.now_s) - s.inputs.driver.age_s(s.now_s) > timeout_s / 2.0:
        return "motor_driver still reports its status: check the feedback of the drives with `canbase doctor`"
    return "motor_driver hangs, has ended, or its messages do not arrive: check with `canbase doctor`"


def _taken_over(s: Situation) -> str | None:
    mux = s.states.mux
    if mux is None or mux.active in ("", s.own_source):
        return None
    return f"{mux.active} has taken over: its priority is higher, and the base follows it"


def _off_course(s: Situation) -> str | None:
    return s.off_course or None


def _lost(topic: StateTopic) -> Callable[[Situation], str | None]:
    def test(s: Situation) -> str | None:
        silence = topic.silence(s.robot, s.inputs, s.now_s)
        return silence and f"{silence} The server does not know {topic.unknown}; check with `canbase doctor`"

    return test


def _scan_lost(s: Situation) -> str | None:
    safety = s.states.safety
    if safety is None or safety.cause not in SCAN_LOST:
        return None
    return f"laser scan lost: {safety.detail}; is the scanner running?"


def _blocked(s: Situation) -> str | None:
    mux, safety = s.states.mux, s.states.safety
    if mux is not None and mux.held_back:
        return f"velocity_mux holds {s.own_source} back: {mux.held_back}; unlock it and send a new goal"
    if s.stopped_s < s.stopped_patience_s or safety is None:
        return None
    if safety.cause is not StopCause.OBSTACLE:
        return f"the safety filter stops the base ({safety.cause.value}): {safety.detail}"
    return f"obstacle in the path: {safety.detail}; remove it and send a new goal for the remaining distance"


def _canceled(s: Situation) -> str | None:
    return "canceled by request" if s.inputs.cancel_requested else None


def _preempted(s: Situation) -> str | None:
    return "replaced by a newer goal (action.goal_policy: preempt)" if s.inputs.preempted else None


def _client_lost(s: Situation) -> str | None:
    return CLIENT_SILENT if s.inputs.client_lost else None


def _shutdown(s: Situation) -> str | None:
    return "the action server is shutting down" if s.inputs.shutdown else None


def _no_progress(s: Situation) -> str | None:
    if s.no_progress_s <= s.progress_timeout_s:
        return None
    return (
        f"no progress for {s.no_progress_s:.1f} s, although motion is ordered; is it stuck, or its speed limited to 0?"
    )


def _timeout(s: Situation) -> str | None:
    if s.running_s <= s.overall_timeout_s:
        return None
    return f"not finished after {s.running_s:.1f} s (overall timeout {s.overall_timeout_s:.1f} s)"


@dataclass(frozen=True, slots=True)
class Row:
    """One cause: its code, its test, and whether it counts while the base is being stopped."""

    code: ErrorCode
    test: Callable[[Situation], str | None]
    while_stopping: bool


TABLE: tuple[Row, ...] = (
    Row(ErrorCode.ESTOP, _estop, while_stopping=True),
    Row(ErrorCode.WATCHDOG, _watchdog, while_stopping=True),
    Row(ErrorCode.DRIVE_FAULT, _drive_fault, while_stopping=True),
    Row(ErrorCode.ODOMETRY_LOST, _odometry_lost, while_stopping=True),
    Row(ErrorCode.TAKEN_OVER, _taken_over, while_stopping=True),
    Row(ErrorCode.DRIVE_FAULT, _off_course, while_stopping=True),
    Row(DRIVER.code, _lost(DRIVER), while_stopping=True),
    Row(SAFETY.code, _lost(SAFETY), while_stopping=True),
    Row(MUX.code, _lost(MUX), while_stopping=True),
    Row(ErrorCode.SCAN_LOST, _scan_lost, while_stopping=False),
    Row(ErrorCode.BLOCKED, _blocked, while_stopping=False),
    Row(ErrorCode.CANCELED, _canceled, while_stopping=True),
    Row(ErrorCode.PREEMPTED, _preempted, while_stopping=False),
    Row(ErrorCode.CLIENT_LOST, _client_lost, while_stopping=False),
    Row(ErrorCode.SHUTDOWN, _shutdown, while_stopping=True),
    Row(ErrorCode.NO_PROGRESS, _no_progress, while_stopping=False),
    Row(ErrorCode.TIMEOUT, _timeout, while_stopping=False),
)
ALL = tuple(enumerate(TABLE))
ARRIVED = EndCause(ErrorCode.OK, "", place=len(TABLE))
"""No row holds: the distance is driven. Every row stands above it."""


def cause_while_driving(situation: Situation) -> EndCause | None:
    """The first row that holds."""
    return _first(ALL, situation)


def cause_while_stopping(situation: Situation, so_far: EndCause) -> EndCause | None:
    """The first row that holds, counts while stopping, and stands above `so_far`."""
    return _first(tuple((place, row) for place, row in ALL[: so_far.place] if row.while_stopping), situation)


def _first(rows: Sequence[tuple[int, Row]], situation: Situation) -> EndCause | None:
    for place, row in rows:
        message = row.test(situation)
        if message is not None:
            return EndCause(row.code, message, place)
    return None
