"""What the page `Now` shows, from the last messages of the robot: plain values for the browser. No ROS, no clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

from canbase_driver.cia402 import DriveState
from canbase_runtime.driver_state import DriverState, driver_state
from canbase_runtime.last_message import NOT_RECEIVED, LastMessage
from canbase_runtime.source_standing import SourceStanding, lock_standing, source_standing
from canbase_runtime.stop_cause import StopCause, stop_cause
from canbase_runtime.watchdog_view import WatchdogView, watchdog_view

RUNGS: Final = (
    "none", "quick stop", "pre-operational", "disable voltage", "heartbeat withheld", "reset node",
)  # fmt: skip
"""DriverStatus.watchdog_rung in words."""
FILTER_WORDS: Final = ("passes", "limits", "slows", "stops")
"""SafetyState.action in words."""
FAST: Final = ("odom", "cmd_vel_mux", "cmd_vel", "joints")
"""Topics whose numbers are plotted."""


class Level(Enum):
    """How a part of the chain stands."""

    GOOD = "good"
    IDLE = "idle"
    """Nothing is wrong, and nothing is commanded."""
    WARN = "warn"
    BAD = "bad"
    """It stops the robot, or it is silent."""


@dataclass(frozen=True, slots=True)
class Part:
    """One part of the chain, and its sentence."""

    name: str
    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class Robot:
    """The last messages. mux: MuxState, safety: SafetyState, driver: DriverStatus, odom: Odometry, joints: JointState,
    selected and ordered: TwistStamped of cmd_vel_mux and cmd_vel."""

    mux: LastMessage = NOT_RECEIVED
    safety: LastMessage = NOT_RECEIVED
    driver: LastMessage = NOT_RECEIVED
    odom: LastMessage = NOT_RECEIVED
    joints: LastMessage = NOT_RECEIVED
    selected: LastMessage = NOT_RECEIVED
    ordered: LastMessage = NOT_RECEIVED


def chain(robot: Robot) -> tuple[Part, ...]:
    """Source, mux, filter, driver, watchdog, drives: the path of a command."""
    return (
        _source(robot.mux),
        _mux(robot.mux),
        _filter(robot.safety),
        _driver(robot.driver),
        _watchdog(robot.driver),
        _drives(robot.driver),
    )


def headline(robot: Robot) -> Part:
    """The state of the robot: of its driver, of another part that stops it or needs a look, and who drives."""
    source, *others = chain(robot)
    driver = next(part for part in others if part.name == "motor_driver")
    heard = others if robot.driver.fresh else others[:2]  # the driver reports of watchdog and drives
    levels = (Level.BAD, Level.WARN) if driver.level is Level.GOOD else (Level.BAD,)
    trouble = [part for level in levels for part in heard if part.level is level and part is not driver][:1]
    told = [
        _state(driver, robot.driver),
        *(f"{part.name}: {part.text}" for part in trouble),
        *([source.text] if robot.mux.fresh else []),
    ]
    level = max((part.level for part in (driver, *trouble, source)), key=list(Level).index)
    return Part("robot", Level.GOOD if level is Level.IDLE else level, " · ".join(told))


def waits_for_reset(robot: Robot) -> bool:
    """Whether a reset is what ends the stop."""
    return any(last.fresh and "reset" in last.message.clears_on for last in (robot.driver, robot.safety))


def header_values(robot: Robot) -> dict[str, Any]:
    """The state in the header of every page."""
    state = headline(robot)
    return {"level": state.level.value, "text": state.text, "waits_for_reset": waits_for_reset(robot)}


def _silent(name: str, last: LastMessage) -> Part:
    return Part(name, Level.BAD, last.silence)


def _source(last: LastMessage) -> Part:
    name = "source"
    if not last.fresh:
        return Part(name, Level.BAD, "unknown: reported by velocity_mux, which publishes nothing")
    active = next((source for source in last.message.sources if source.active), None)
    if active is None:
        return Part(name, Level.IDLE, "no active source")
    if source_standing(active.standing) is SourceStanding.FOLLOWED:
        return Part(name, Level.GOOD, f"{active.name} drives")
    return Part(name, Level.BAD, f"{active.name} is not followed: {active.reason}")


def still_sentence(driver: LastMessage) -> str:
    """Why no order moves the wheels, by motor_driver/status; empty: they follow."""
    part = _driver(driver)
    return "" if part.level is Level.GOOD else f"the robot does not move: {_state(part, driver)}"


def _state(part: Part, driver: LastMessage) -> str:
    return part.text if driver.fresh else f"{part.name}: {part.text}"


def held_sentence(last: LastMessage, source: str) -> str:
    """What becomes of the orders of hold-to-drive, whose source has this name: by velocity_mux/state."""
    if not last.fresh:
        return f"not followed: velocity_mux: {last.silence}"
    state = next((each for each in last.message.sources if each.name == source), None)
    if state is None:
        return f"velocity_mux has no source {source}: it runs with another robot.yaml"
    if state.active and source_standing(state.standing) is SourceStanding.FOLLOWED:
        return "drives"
    return f"not followed: {state.reason}"


def _mux(last: LastMessage) -> Part:
    name = "velocity_mux"
    if not last.fresh:
        return _silent(name, last)
    state = last.message
    for stranger in state.foreign:
        return Part(name, Level.BAD, f"{stranger.node} publishes on {stranger.topic}: {stranger.problem}")
    for lock in state.locks:
        if lock.holds:
            return Part(name, Level.BAD, f"lock {lock.name}: {lock_standing(lock.standing).word} {lock.reason}".strip())
    return Part(name, Level.GOOD, "ready") if state.ready else Part(name, Level.WARN, state.not_ready)


def _filter(last: LastMessage) -> Part:
    name = "safety_filter"
    if not last.fresh:
        return _silent(name, last)
    state = last.message
    if stop_cause(state.cause) is StopCause.NONE:
        return Part(name, Level.GOOD, _word(FILTER_WORDS, state.action))
    text = _with_end(f"{_word(FILTER_WORDS, state.action)}: {state.detail or state.cause}", state.clears_on)
    return Part(name, Level.WARN if state.action < len(FILTER_WORDS) - 1 else Level.BAD, text)


def _driver(last: LastMessage) -> Part:
    name = "motor_driver"
    if not last.fresh:
        return _silent(name, last)
    status = last.message
    state = driver_state(status.state)
    if state is DriverState.ENABLED:
        return Part(name, Level.GOOD, "enabled, at standstill" if status.standstill else "enabled, moves")
    cause = f"{status.cause} ({status.detail})" if status.detail else status.cause
    text = _with_end(f"{state.word}: {cause}", status.clears_on)
    return Part(name, Level.BAD if state in (DriverState.LATCHED, DriverState.OFFLINE) else Level.WARN, text)


def _watchdog(last: LastMessage) -> Part:
    name = "watchdog"
    if not last.fresh:
        return Part(name, Level.BAD, "unknown: reported by motor_driver, which publishes nothing")
    status = last.message
    view = watchdog_view(status.watchdog)
    if view is WatchdogView.OK:
        return Part(name, Level.GOOD, "ok")
    tripped = f"tripped: {status.watchdog_cause}; its ladder: {_word(RUNGS, status.watchdog_rung)}"
    return Part(name, Level.BAD, tripped if view is WatchdogView.TRIPPED else status.watchdog)


def _drives(last: LastMessage) -> Part:
    name = "drives"
    if not last.fresh:
        return Part(name, Level.BAD, "unknown: reported by motor_driver, which publishes nothing")
    drives = last.message.drives
    for drive in drives:
        if drive.error_code:
            return Part(name, Level.BAD, f"{drive.joint}: {drive.error_code:04X}h {drive.error_text}")
        if drive.boot_problem:
            return Part(name, Level.BAD, f"{drive.joint}: {drive.boot_problem}")
    for drive in drives:
        if drive.health:
            return Part(name, Level.WARN, f"{drive.joint}: {drive.health}")
        if drive.state != DriveState.OPERATION_ENABLED.value:
            return Part(name, Level.WARN, f"{drive.joint}: {drive.state}")
    return Part(name, Level.GOOD, f"{len(drives)} enabled")


def _word(words: tuple[str, ...], number: int) -> str:
    """A number that this canbase does not know has no word."""
    return words[number] if number < len(words) else f"unknown ({number})"


def _with_end(text: str, clears_on: str) -> str:
    return f"{text}; ends with: {clears_on}" if clears_on else text


def slow_values(robot: Robot) -> dict[str, Any]:
    """Chain, sources, drives and ages: what a person reads. Shown a few times a second."""
    return {
        "chain": [{"name": part.name, "level": part.level.value, "text": part.text} for part in chain(robot)],
        "sources": _source_rows(robot.mux),
        "drives": _drive_rows(robot.driver),
        "free": _clearances(robot.safety),
        "bus": _bus(robot.driver),
    }


def _source_rows(last: LastMessage) -> list[list[str]]:
    if not last.fresh:
        return []
    state = last.message
    rows = [
        [
            str(source.priority),
            source.name,
            seconds(source.age_s),
            "drives" if source_standing(source.standing) is SourceStanding.FOLLOWED else source.reason,
        ]
        for source in state.sources
    ]
    return rows + [[str(lock.priority), f"lock {lock.name}", seconds(lock.age_s), lock.reason or "free"]
                   for lock in state.locks]  # fmt: skip


def _drive_rows(last: LastMessage) -> list[list[str]]:
    if not last.fresh:
        return []
    return [
        [
            drive.joint,
            drive.state,
            number(drive.target_radps, "rad/s"),
            number(drive.velocity_radps, "rad/s"),
            number(drive.current_a, "A"),
            number(100.0 * drive.torque_share, "%"),
            number(drive.voltage_v, "V"),
            number(drive.temperature_c, "°C"),
            seconds(drive.feedback_age_s),
            f"{drive.error_code:04X}h {drive.error_text}" if drive.error_code else drive.health,
        ]
        for drive in last.message.drives
    ]


def _clearances(last: LastMessage) -> str:
    if not last.fresh:
        return "unknown"
    state = last.message
    return f"free ahead {_metres(state.clearance_ahead_m)}, behind {_metres(state.clearance_behind_m)}"


def _bus(last: LastMessage) -> str:
    """What the driver reports of the bus; the load is worked out from robot.yaml by whoever shows this."""
    if not last.fresh:
        return "unknown"
    status = last.message
    problem = status.bus_problem or "works"
    return f"{problem}; {status.send_errors} frames not sent, {status.frames_dropped} not understood"


def fast_values(robot: Robot, now_s: float, bounds: tuple[float, float, float, float]) -> dict[str, Any]:
    """The numbers of the plots at `now_s` [s]; None where nothing fresh was received. `bounds`: linear low and high,
    angular low and high, that the leases allow."""
    measured = robot.odom.message.twist.twist if robot.odom.fresh else None
    return {
        "t": round(now_s, 3),
        "linear": [
            _of(robot.selected, lambda twist: twist.twist.linear.x),
            _of(robot.ordered, lambda twist: twist.twist.linear.x),
            None if measured is None else rounded(measured.linear.x),
            rounded(bounds[0]),
            rounded(bounds[1]),
        ],
        "angular": [
            _of(robot.selected, lambda twist: twist.twist.angular.z),
            _of(robot.ordered, lambda twist: twist.twist.angular.z),
            None if measured is None else rounded(measured.angular.z),
            rounded(bounds[2]),
            rounded(bounds[3]),
        ],
        "wheels": _wheels(robot),
    }


def _wheels(robot: Robot) -> list[list[float | None]]:
    """Of each wheel the target and the measured speed [rad/s]."""
    if not robot.driver.fresh:
        return []
    joints = robot.joints.message
    now = dict(zip(joints.name, joints.velocity, strict=False)) if robot.joints.fresh else {}
    return [
        [rounded(drive.target_radps), rounded(now.get(drive.joint, drive.velocity_radps))]
        for drive in robot.driver.message.drives
    ]


def _of(last: LastMessage, value: Any) -> float | None:
    return rounded(value(last.message)) if last.fresh else None


def rounded(value: float) -> float | None:
    """For a plot; None for what is no number."""
    return round(value, 4) if math.isfinite(value) else None


def seconds(value: float) -> str:
    """An age."""
    return "–" if math.isnan(value) else f"{value:.2f} s"


def number(value: float, unit: str) -> str:
    """A measured value, or a dash where the drive does not measure it."""
    return "–" if math.isnan(value) else f"{value:.2f} {unit}"


def _metres(value: float) -> str:
    if math.isnan(value):
        return "unknown"
    return "all" if math.isinf(value) else f"{value:.2f} m"
