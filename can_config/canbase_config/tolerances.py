"""How much the watchdog may forgive on this robot, as one table: beyond it a failure would stay unseen.

`canbase config check` refuses a file by it, and docs/configuration.md shows it. Pure.

- A tolerance of a speed is at most a quarter of the robot's speed, and its share at most a quarter as well: a wheel
  that turns without an order, or one and a half times as fast as ordered, is found long before it is at full speed.
- A time is at most that of the longest ordinary stop: what is found late costs no more than a second stop would.
- A default always passes, so that limits may be lowered: what it hides is slow, 0.05 m/s, or short, 0.5 s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from canbase_config.reserves import at
from canbase_config.section import MisfitError
from canbase_config.stopping import ramp, slowest_ramp_mps2

if TYPE_CHECKING:
    from canbase_config.robot import Robot

QUARTER: Final = 0.25
PRINTED: Final = 0.005
"""A bound is printed with three digits, and that number passes: the rounding is up to this share."""


@dataclass(frozen=True, slots=True)
class Bound:
    """One key that must not forgive more than others allow.

    `hides`: what would not be found. `rule`: the formula of the bound, for people. `others`: the keys in the formula.
    `formula`: the same, computed, in the unit of the key. `is_least`: a smaller value is what forgives more.
    """

    key: str
    hides: str
    rule: str
    others: tuple[str, ...]
    formula: Callable[[Robot], float]
    is_least: bool = False

    @property
    def word(self) -> str:
        """Of the bound: `least` or `most`."""
        return "least" if self.is_least else "most"

    def given(self, robot: Robot) -> float | None:
        """The value in the file, or its default; None: other keys give it."""
        section, name = self.key.split(".")
        value = getattr(getattr(robot, section), name)
        return None if value is None else float(value)

    def bound(self, robot: Robot) -> float:
        """The formula, or the default where that forgives more."""
        section, name = self.key.split(".")
        default = type(getattr(robot, section)).model_fields[name].default
        forgives = min if self.is_least else max
        return self.formula(robot) if default is None else forgives(float(default), self.formula(robot))

    def holds(self, robot: Robot) -> bool:
        """Whether the value is within its bound."""
        given, bound = self.given(robot), self.bound(robot)
        if given is None:
            return True
        return given >= bound * (1.0 - PRINTED) if self.is_least else given <= bound * (1.0 + PRINTED)


def _linear_mps(robot: Robot) -> float:
    return robot.limits.linear_mps


def _turning_mps(robot: Robot) -> float:
    return robot.limits.angular_radps * robot.base.track_m / 2.0


def _stop_s(robot: Robot) -> float:
    return ramp(robot.limits, robot.limits.linear_mps, robot.limits.angular_radps).time_s


_LINEAR: Final = ("limits.linear_mps",)
_TURN: Final = ("limits.linear_mps", "limits.angular_radps", "base.track_m")
_RAMP: Final = ("limits.deceleration_mps2", "limits.angular_deceleration_radps2", "limits.jerk_mps3")


def _speed(key: str, hides: str) -> Bound:
    return Bound(key, hides, "limits.linear_mps / 4", _LINEAR, lambda robot: QUARTER * _linear_mps(robot))


def _time(key: str, hides: str) -> Bound:
    return Bound(key, hides, "the longest ordinary stop, by the ramps of limits", _RAMP, _stop_s)


BOUNDS: Final = (
    _speed("watchdog.target_tolerance_mps", "a setpoint without a lease"),
    _speed("watchdog.motion_tolerance_mps", "a wheel that turns without a setpoint"),
    Bound(
        "watchdog.twist_tolerance_mps",
        "a base that turns, or drives, where that is not ordered",
        "the lesser of limits.linear_mps and limits.angular_radps × base.track_m / 2, / 4",
        _TURN,
        lambda robot: QUARTER * min(_linear_mps(robot), _turning_mps(robot)),
    ),
    Bound(
        "base.standstill_mps",
        "a wheel that turns where standstill is expected",
        "limits.linear_mps / 16",
        _LINEAR,
        lambda robot: QUARTER * QUARTER * _linear_mps(robot),
    ),
    Bound(
        "watchdog.motion_missing_m",
        "a dead encoder below a quarter of the speed, where this travel takes longer than motion_missing_s",
        "limits.linear_mps × watchdog.motion_missing_s / 4",
        ("limits.linear_mps", "watchdog.motion_missing_s"),
        lambda robot: QUARTER * _linear_mps(robot) * robot.watchdog.motion_missing_s,
    ),
    Bound(
        "watchdog.jolt_mps2",
        "an encoder that is lost at speed: its velocity drops by a quarter of the speed from one sample to the next",
        "limits.linear_mps × rates.control_hz / 4",
        ("limits.linear_mps", "rates.control_hz"),
        lambda robot: QUARTER * _linear_mps(robot) * robot.rates.control_hz,
    ),
    Bound(
        "watchdog.slowest_ramp_mps2",
        "a wheel that is slower than its setpoints",
        "a sixteenth of the lesser of limits.acceleration_mps2 and limits.angular_acceleration_radps2 × base.track_m "
        "/ 2, which is a quarter of the default",
        ("limits.acceleration_mps2", "limits.angular_acceleration_radps2", "base.track_m"),
        lambda robot: QUARTER * slowest_ramp_mps2(robot),
        is_least=True,
    ),
    Bound(
        "watchdog.stand_impulse_s",
        "a drive that pushes a wheel with a dead encoder, until it has a quarter of the speed",
        "limits.linear_mps / limits.acceleration_mps2 / 4",
        ("limits.linear_mps", "limits.acceleration_mps2"),
        lambda robot: QUARTER * _linear_mps(robot) / robot.limits.acceleration_mps2,
    ),
    _time("watchdog.latency_s", "a driver that follows an order that another one has replaced"),
    _time("watchdog.drive_lag_s", "a wheel that keeps the speed of an older setpoint"),
    _time("watchdog.motion_missing_s", "a dead encoder, or a motor without current"),
    _time("watchdog.stand_answer_s", "a drive that keeps its power at standstill"),
    _time("watchdog.slow_wheel_s", "a wheel that is slower than its setpoints"),
    _time("watchdog.twist_s", "a base that does not turn as ordered"),
    Bound(
        "watchdog.bus_failed_s",
        "a failed bus, until the drives stop by themselves",
        "timeouts.drive_heartbeat_s",
        ("timeouts.drive_heartbeat_s",),
        lambda robot: robot.timeouts.drive_heartbeat_s,
    ),
)

BY_RANGE: Final = {
    "watchdog.target_tolerance_share": "a share of the speed itself; its range ends below a quarter",
    "watchdog.motion_tolerance_share": "a share of the speed itself; its range ends at a quarter",
    "watchdog.twist_tolerance_share": "a share of the speed itself; its range ends at a quarter",
    "watchdog.slow_wheel_share": "its range ends at a half: a wheel with less than a quarter of its order is found",
    "watchdog.overspeed_factor": "a multiple of the speed itself; its range ends at one and a half",
    "watchdog.travel_tolerance_m": "its range ends at a quarter of the travel within which it is forgotten, 0.25 m",
    "watchdog.feedback_samples": "its range ends at 0.1 s at 100 Hz, as long as timeouts.feedback_s by default",
    "watchdog.loop_late_s": "at most two thirds of timeouts.drive_heartbeat_s, a row of the table of reserves",
    "watchdog.stand_proof": "one of two words; none has a warning",
    "watchdog.relay": "a GPIO line, no tolerance",
}
"""Every other key of the section, and what bounds it. A test finds the keys in the model."""


def check(robot: Robot) -> None:
    """Raises MisfitError for the first row that does not hold, with the bound and the values that it comes from."""
    for row in BOUNDS:
        if not row.holds(robot):
            places = [tuple(key.split(".")) for key in (row.key, *row.others)]
            raise MisfitError(_sentence(row, robot), *places)


def _sentence(row: Bound, robot: Robot) -> str:
    sources = ", ".join(f"{key} {at(robot, tuple(key.split('.'))):g}" for key in row.others)
    bound = f"at {row.word} {row.bound(robot):.3g} ({row.rule}; {sources})"
    return f"{row.key} ({row.given(robot):g}) hides {row.hides}: {bound}"
