"""What `canbase up` prints about the start of the robot: READY once, and before that once why it is not. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_runtime.driver_state import DriverState

NOT_READY_S = 15.0
"""[s] After this time `canbase up` reports why the robot is not ready. A boot with real drives takes a few seconds."""


@dataclass(frozen=True, slots=True)
class Seen:
    """The state of the robot's topics; `state` None: no motor_driver/status received yet."""

    state: DriverState | None = None
    detail: str = ""
    hears_command: bool = False
    """The driver receives cmd_vel: before that a goal would be rejected."""
    has_odometry: bool = False
    has_server: bool = False


def missing(seen: Seen) -> str | None:
    """The first thing that keeps a goal from being accepted; None: the robot is ready."""
    if seen.state is None:
        return "no message on motor_driver/status yet"
    if seen.state is not DriverState.ENABLED:
        return f"motor_driver is {seen.state.word}: {seen.detail}"
    if not seen.hears_command:
        return "motor_driver receives no cmd_vel yet"
    if not seen.has_odometry:
        return "no message on odom yet"
    return None if seen.has_server else "no action server drive_distance yet"


@dataclass(slots=True)
class Teller:
    """Which line is due, from one look to the next."""

    namespace: str
    began_s: float
    has_reported: bool = False
    """NOT READY was printed: it is printed once."""

    def line(self, seen: Seen, now_s: float) -> str | None:
        """A line to print now, if any. The robot is ready when `missing` is None."""
        why = missing(seen)
        if why is None:
            return f"READY after {now_s - self.began_s:.0f} s{self._next('canbase drive 0.5', 'canbase monitor')}"
        latched = seen.state is DriverState.LATCHED
        if self.has_reported or not (latched or now_s - self.began_s > NOT_READY_S):
            return None
        self.has_reported = True
        return f"NOT READY: {why}{self._next('canbase doctor', *(['canbase reset'] if latched else []))}"

    def _next(self, *commands: str) -> str:
        where = f" --namespace {self.namespace}" if self.namespace else ""
        return "; in another terminal: " + ", ".join(f"`{command}{where}`" for command in commands)
