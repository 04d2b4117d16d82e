"""Keys of robot.yaml that depend on each other, as one table.

How long a timeout has to be for what it waits for, how fine an encoder for the tolerance that it is compared with, and
how large the footprint for the wheels.

`canbase config check` refuses a file by it, docs/configuration.md shows it, and the campaign draws robots at its edges.
Pure. A timeout allows for one lost message: two periods, plus the time by which a message may be late.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from canbase_config.section import MisfitError
from canbase_config.stopping import CYCLES_TO_SETPOINT
from canbase_config.units import m_per_count
from canbase_config.watchdog import HEARTBEATS_PER_TIMEOUT, STATE_PERIOD_S

if TYPE_CHECKING:
    from canbase_config.errors import Loc
    from canbase_config.robot import Robot

TOPIC_LATE_S: Final = 0.05
"""A message between two processes may be late by this, on a computer that does other things too [s]."""
GOAL_LATE_S: Final = 0.1
"""The same for the action server, whose priority is the lowest [s]."""
STATE_LATE_S: Final = 0.02
"""The same for a frame of the watchdog, beside the control cycle that reads it [s]."""
FEEDBACK_LATE_S: Final = 0.01
"""The same for what the driver's SYNC triggers, beside a cycle of the sender and one of the receiver [s]."""
COUNTS_PER_TRAVEL: Final = 4.0
"""Encoder and measured velocity differ by one increment at the begin and one at the end of a window, and by slip."""
COUNTS_OF_LIFE: Final = 8.0
"""Two increments are a sign of life, the first may be a whole one away, and a wheel lags its setpoint meanwhile."""
ACTION_TOPIC: Final = "cmd_vel_action"
ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Reserve:
    """One key that must not be less than others demand.

    `rule`: formula of the least value, for people. `least`: the same, computed [s or m]. `others`: the keys in the
    formula. `keys`: the places of `key` in a robot.yaml: one for each source of the mux where it is a key of a source.
    """

    key: str
    waits_for: str
    rule: str
    others: tuple[str, ...]
    least: Callable[[Robot], float]
    keys: Callable[[Robot], Iterable[Loc]]
    suffices: bool = True
    """False: a real robot needs more, by what the file does not have; the campaign does not draw its edge."""


def _action_sources(robot: Robot) -> Iterable[Loc]:
    for name, source in robot.mux.sources.items():
        if source.topic.removeprefix("/") == ACTION_TOPIC:
            yield "mux", "sources", name, "timeout_s"


def _row(key: str, waits_for: str, rule: str, others: tuple[str, ...], least: Callable[[Robot], float]) -> Reserve:
    return Reserve(key, waits_for, rule, others, least, lambda _robot: (tuple(key.split(".")),))


def _footprint(side: str, waits_for: str, rule: str, least: Callable[[Robot], float]) -> Reserve:
    """Of a base with one drive on each side: with more of them it skids, and turns by a wider track than it has."""
    loc, other = ("safety", "footprint", side), rule.partition(" ")[0]
    return Reserve(
        ".".join(loc), waits_for, rule, (other,), least, lambda robot: (loc,) * (len(robot.drives) == 2), suffices=False
    )


def _increments_m(robot: Robot, number: float) -> float:
    """Travel of the rim with the coarsest encoder for so many increments [m]."""
    return number * max(_increment_m(robot, place) for place in range(len(robot.drives)))


def _increment_m(robot: Robot, place: int) -> float:
    drive = robot.drives[place]
    return abs(m_per_count(drive, robot.base.radius_m(drive.side)))


def _commands_s(robot: Robot) -> float:
    return 2.0 / robot.rates.command_hz + TOPIC_LATE_S


def _cycles_s(robot: Robot) -> float:
    return 4.0 / robot.rates.control_hz + FEEDBACK_LATE_S


_COMMANDS: Final = f"2 / rates.command_hz + {TOPIC_LATE_S:g}"
_CYCLES: Final = f"4 / rates.control_hz + {FEEDBACK_LATE_S:g}"
_INCREMENT: Final = "2π × base.wheel_radius_m / (drives.gear_ratio × drives.counts_per_motor_rev)"
COUNTS: Final = "drives.counts_per_motor_rev"
GEAR: Final = "drives.gear_ratio"

RESERVES: Final = (
    _row("timeouts.command_s", "cmd_vel at the driver", _COMMANDS, ("rates.command_hz",), _commands_s),
    _row("timeouts.lease_s", "the leases at the watchdog", _COMMANDS, ("rates.command_hz",), _commands_s),
    _row("safety.command_timeout_s", "cmd_vel_mux at the filter", _COMMANDS, ("rates.command_hz",), _commands_s),
    Reserve(
        "mux.sources.….timeout_s",
        f"{ACTION_TOPIC}, where that is its topic, at the mux",
        f"2 / action.control_hz + {GOAL_LATE_S:g}",
        ("action.control_hz",),
        lambda robot: 2.0 / robot.action.control_hz + GOAL_LATE_S,
        _action_sources,
    ),
    _row(
        "timeouts.odometry_s",
        "odom at the action server; from one to the next are whole control cycles",
        f"2 / rates.odometry_hz + 2 / rates.control_hz + {TOPIC_LATE_S:g}",
        ("rates.odometry_hz", "rates.control_hz"),
        lambda robot: 2.0 / robot.rates.odometry_hz + 2.0 / robot.rates.control_hz + TOPIC_LATE_S,
    ),
    _row(
        "timeouts.watchdog_s",
        f"the state frame of the watchdog, every {STATE_PERIOD_S:g} s, at the driver",
        f"2 × {STATE_PERIOD_S:g} + 1 / rates.control_hz + {STATE_LATE_S:g}",
        ("rates.control_hz",),
        lambda robot: 2.0 * STATE_PERIOD_S + 1.0 / robot.rates.control_hz + STATE_LATE_S,
    ),
    _row("timeouts.feedback_s", "a status TPDO after each SYNC", _CYCLES, ("rates.control_hz",), _cycles_s),
    _row(
        "timeouts.drive_heartbeat_s",
        f"heartbeats at the drives, {HEARTBEATS_PER_TIMEOUT} in this time, each sent in a control cycle",
        _CYCLES,
        ("rates.control_hz",),
        _cycles_s,
    ),
    _row(
        "timeouts.drive_heartbeat_s",
        "the watchdog's heartbeats, when its loop is as late as watchdog.loop_late_s allows",
        "1.5 × watchdog.loop_late_s",
        ("watchdog.loop_late_s",),
        lambda robot: HEARTBEATS_PER_TIMEOUT / (HEARTBEATS_PER_TIMEOUT - 1) * robot.watchdog.loop_late_s,
    ),
    Reserve(
        "safety.reaction_s",
        "a command, which is on the bus after that many control cycles; the drives need their lag on top",
        f"{CYCLES_TO_SETPOINT} / rates.control_hz",
        ("rates.control_hz",),
        lambda robot: CYCLES_TO_SETPOINT / robot.rates.control_hz,
        lambda _robot: (("safety", "reaction_s"),),
        suffices=False,
    ),
    _row(
        "watchdog.travel_tolerance_m",
        "the encoder beside the measured velocity",
        f"{COUNTS_PER_TRAVEL:g} increments of the coarsest encoder, each {_INCREMENT}",
        (COUNTS, GEAR),
        lambda robot: _increments_m(robot, COUNTS_PER_TRAVEL),
    ),
    _row(
        "watchdog.motion_missing_m",
        "the first sign of life of an encoder that turns",
        f"{COUNTS_OF_LIFE:g} increments of the coarsest encoder",
        (COUNTS, GEAR),
        lambda robot: _increments_m(robot, COUNTS_OF_LIFE),
    ),
    *(
        _footprint(f"{side}_m", f"the {side} wheel", "base.track_m / 2", lambda robot: robot.base.track_m / 2.0)
        for side in ("left", "right")
    ),
    *(
        _footprint(f"{end}_m", "the wheels at x = 0", "base.wheel_radius_m", lambda robot: robot.base.wheel_radius_m)
        for end in ("front", "rear")
    ),
)

_PUBLISHER: Final = "the rate of the publisher is not in the file; two of its periods and 0.05 s are needed"
_DRIVE: Final = "a property of the drives, which the file does not have"
_HUMAN: Final = "how long to wait before people are informed; no stop depends on it"
WITHOUT_RESERVE: Final = {
    "rates.status_hz": "motor_driver/status is not published more often than odom; who waits for it computes with both",
    "timeouts.standstill_s": "at least the time of the longest ramp: refused with the numbers of `limits`",
    "timeouts.sdo_s": "one answer of a drive, outside the control cycle; the boot learns a longer time",
    "timeouts.boot_s": _HUMAN,
    "mux.twist_mux_timeout_s": "becomes the timeout_s of a source",
    "mux.sources.….timeout_s": f"{_PUBLISHER} (a source on {ACTION_TOPIC} has a rule)",
    "mux.sources.….neutral_after_s": "not less than the timeout_s of the source: refused with both numbers",
    "mux.locks.….timeout_s": _PUBLISHER,
    "safety.scan.timeout_s": _PUBLISHER,
    "safety.scan.frozen_s": "counts with several equal scans only, whatever their rate",
    "safety.more_scans[…].timeout_s": _PUBLISHER,
    "safety.more_scans[…].frozen_s": "counts with several equal scans only, whatever their rate",
    "safety.estop.timeout_s": _PUBLISHER,
    "watchdog.latency_s": "added to timeouts.command_s, which has a rule",
    "watchdog.drive_lag_s": _DRIVE,
    "watchdog.motion_missing_s": "counts after watchdog.drive_lag_s, and with a travel (motion_missing_m, above)",
    "watchdog.stand_impulse_s": _DRIVE,
    "watchdog.stand_answer_s": _DRIVE,
    "watchdog.slow_wheel_s": "counts after watchdog.drive_lag_s; its least value is two control cycles at 20 Hz",
    "watchdog.twist_s": "counts after watchdog.drive_lag_s; its least value is two control cycles at 20 Hz",
    "watchdog.bus_failed_s": f"the watchdog sends every {STATE_PERIOD_S:g} s at least; the range begins above",
    "action.client_lease_s": "the client publishes at a third of its least value",
    "action.feedback_hz": "feedback is sent in a control cycle, so at most at action.control_hz; no decision",
    "action.progress_timeout_s": "how long a goal may go on without 1 mm of travel; the speed decides what is enough",
    "action.overall_extra_s": "added to a computed time",
    "health.stall_time_s": _DRIVE,
    "drives[…].values[…].period_s": "rounded to whole control cycles; published only",
    "sdo.timeout_s": "a property of the drive; replaces timeouts.sdo_s",
    "sdo.gap_s": _DRIVE,
    "start.boot_up_s": _DRIVE,
    "start.settle_s": _DRIVE,
    "self_stop.vendor_watchdog.per_s": "the value that means one second to the drive: a unit, no time",
}
"""Every other key that is a time or a rate, and why no rule compares it. A test finds the keys in the model."""


def check(robot: Robot) -> None:
    """Raises MisfitError for the rows that do not hold, each with the least value that would."""
    misfits = [
        (row, loc, at(robot, loc), least)
        for row in RESERVES
        for least in (row.least(robot),)
        for loc in row.keys(robot)
        if at(robot, loc) < least - ROUNDING
    ]
    if misfits:
        row, loc, given, least = misfits[0]
        others = [f"{row.key} ({given:g}): at least {rounded_up(least):g}" for row, _, given, least in misfits[1:]]
        sentence = "; likewise ".join((_sentence(row, given, least), *others))
        raise MisfitError(sentence, loc, *_locs(row, robot))


def _sentence(row: Reserve, given: float, least: float) -> str:
    return (
        f"{row.key} ({given:g}) is too little for {row.waits_for}: at least {rounded_up(least):g} "
        f"({row.rule}), or change {' or '.join(row.others)}"
    )


def _locs(row: Reserve, robot: Robot) -> list[Loc]:
    """Where else the file may have what is wrong: the key itself may be a default. Of the drives, the coarsest one."""
    coarsest = max(range(len(robot.drives)), key=lambda place: _increment_m(robot, place))
    parts = [other.split(".") for other in row.others]
    return [("drives", coarsest, *keys) if first == "drives" else (first, *keys) for first, *keys in parts]


def rounded_up(value: float) -> float:
    """To three digits: a value that a person writes, and that passes."""
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.ceil(value / step - 1e-6) * step


def at(section: Any, loc: Loc) -> float:
    """What the key at `loc` of a robot, or of its values, is."""
    for part in loc:
        section = section[part] if isinstance(section, dict) else getattr(section, str(part))
    return float(section)
