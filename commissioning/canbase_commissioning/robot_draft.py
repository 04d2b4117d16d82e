"""A robot.yaml for drives that were found on a bus: the questions about the robot, and the file. Pure.

`canbase setup init` asks them. The file is a sample with its comments, in which the answers stand.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final, get_args

from pydantic import TypeAdapter, ValidationError

from canbase_commissioning.drive_survey import LEAST_GEAR, MOST_COUNTS, MOST_GEAR, FoundAxis
from canbase_commissioning.edits import Edit, edited
from canbase_commissioning.guide import Ask, CommissionError, Tell, number, one_of
from canbase_config.profile import VelocityUnit
from canbase_config.robot import Bus
from canbase_config.section import Name

MOST_AXES: Final = 8
FULL_TURN_S: Final = 2.5
"""A turn on the spot takes at least this long: the limit of the turning speed is drafted from it."""
UNITS: Final = get_args(VelocityUnit)
HEAD: Final = "# Written by canbase setup init. `canbase config check` prints it with every key that it leaves out.\n"
NAME: Final = TypeAdapter(Name)


class Side(Enum):
    """Where the wheel of an axis is."""

    LEFT = "left"
    RIGHT = "right"
    NEITHER = "none"


@dataclass(frozen=True, slots=True)
class Wheel:
    """One axis that turns a wheel, as a person described it."""

    found: FoundAxis
    side: Side
    gear_ratio: float
    counts_per_motor_rev: int
    velocity_unit: VelocityUnit | None


@dataclass(frozen=True, slots=True)
class Scanner:
    """Where a laser scanner is in base_link: ahead and left [m], its zero beam turned to the left [degrees]."""

    x_m: float
    y_m: float
    yaw_deg: float
    upside_down: bool


@dataclass(frozen=True, slots=True)
class Draft:
    """What a robot.yaml needs, in metres and m/s. `scanner`, `has_estop`: nothing moves without their messages."""

    name: str
    wheels: tuple[Wheel, ...]
    wheel_radius_m: float
    track_m: float
    front_m: float
    rear_m: float
    half_width_m: float
    linear_mps: float
    scanner: Scanner | None
    has_estop: bool


Questions = Generator[Ask | Tell, Any, Draft]


def ask_about(axes: Sequence[FoundAxis]) -> Questions:
    """Asks for what no drive can report. Raises CommissionError when no base of two sides comes of it."""
    name = yield _ask("name", "Name of the robot", _name, "robot")
    wheels = []
    for i, axis in enumerate(axes):
        wheels += yield from _ask_about_wheel(axis, Side.LEFT if i < len(axes) / 2 else Side.RIGHT)
    if {wheel.side for wheel in wheels} != {Side.LEFT, Side.RIGHT}:
        raise CommissionError("a base has at least one wheel on each side, left and right")
    if len(wheels) > MOST_AXES:
        raise CommissionError(f"these are {len(wheels)} wheels; canbase drives {MOST_AXES} axes at most")
    edge = number(0.01, 5.0)
    radius_m = yield _ask("wheel_radius_m", "Wheel radius under load [m]", number(0.006, 1.0), "0.1")
    track_m = yield _ask(
        "track_m", "Distance between the contact points of left and right wheel [m]", number(0.03, 5.0), "0.5"
    )
    front_m = yield _ask("front_m", "From the middle between the wheels to the front edge [m]", edge, "0.4")
    rear_m = yield _ask("rear_m", "From there to the rear edge [m]", edge, "0.3")
    half_m = yield _ask("half_width_m", "From there to the left or right edge [m]", edge, f"{track_m / 2 + 0.05:.3g}")
    speed_mps = yield _ask("linear_mps", "Greatest speed [m/s]; begin low", number(0.02, 5.0), "0.3")
    scanner = yield from _ask_about_scanner()
    estop = yield _ask("estop", "Does a node publish the emergency stop on estop_state (yes, no)?", _yes_or_no, "yes")
    if not estop:
        yield Tell("without estop_state an emergency stop is noticed when the drives lose power", is_loud=True)
    return Draft(
        name=name,
        wheels=tuple(wheels),
        wheel_radius_m=radius_m,
        track_m=track_m,
        front_m=front_m,
        rear_m=rear_m,
        half_width_m=half_m,
        linear_mps=speed_mps,
        scanner=scanner,
        has_estop=estop,
    )


def _ask_about_scanner() -> Generator[Ask | Tell, Any, Scanner | None]:
    """A pose that is wrong moves every obstacle by as much: how far ahead it is has no proposed answer."""
    if not (yield _ask("scanner", "Does a laser scanner publish on scan (yes, no)?", _yes_or_no, "yes")):
        yield Tell("without a scanner no obstacle stops the robot", is_loud=True)
        return None
    where = number(-5.0, 5.0)
    text = "Scanner ahead of the middle between the wheels [m]; behind: negative"
    x_m = yield _ask("scanner.x_m", text, where)
    y_m = yield _ask("scanner.y_m", "Scanner to the left of it [m]; right: negative", where, "0")
    text = "Its zero beam, turned to the left from straight ahead [degrees]; to the right: negative"
    yaw_deg = yield _ask("scanner.yaw_deg", text, number(-360.0, 360.0), "0")
    upside_down = yield _ask("scanner.upside_down", "Is it mounted upside down (yes, no)?", _yes_or_no, "no")
    return Scanner(x_m, y_m, yaw_deg, upside_down)


def _ask_about_wheel(axis: FoundAxis, side: Side) -> Generator[Ask | Tell, Any, list[Wheel]]:
    """No wheel where the drive turns something else."""
    key = f"node{axis.node_id}" + (f".axis{axis.axis}" if axis.axis else "")
    text = f"{axis.title}: on which side of the base is its wheel (left, right, none)?"
    where = yield _ask(f"{key}.side", text, one_of(Side), side.value)
    if where is Side.NEITHER:
        return []
    text = "Motor revolutions for one revolution of the wheel"
    gear = yield _ask(f"{key}.gear_ratio", text, number(LEAST_GEAR, MOST_GEAR), _shown(axis.gear_ratio))
    text = "Increments of the position (6064h) for one revolution of the motor: encoder lines × 4"
    counts = yield _ask(f"{key}.counts_per_motor_rev", text, _counts, _shown(axis.counts_per_motor_rev))
    unit = None
    if axis.lacks_unit:
        text = f"What one bit of its velocities (60FFh) means, by its manual or 60A9h: {', '.join(UNITS)}"
        unit = yield _ask(f"{key}.velocity_unit", text, _unit, axis.velocity_unit)
    return [Wheel(axis, where, gear, counts, unit)]


def _ask(key: str, text: str, check: Callable[[str], object], default: str | None = None) -> Ask:
    return Ask(key, text, check, default=default)


def _shown(value: float | None) -> str | None:
    """A value that a drive reports, as the answer of a bare Enter; None: a person has to know it."""
    return None if value is None else f"{value:.9g}"


def _name(text: str) -> str:
    try:
        return NAME.validate_python(text)
    except ValidationError as error:
        raise ValueError(f"{text!r} is no name: at most 64 letters, digits and _, beginning with a letter") from error


def _counts(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= MOST_COUNTS:
        raise ValueError(f"expected a whole number from 1 to {MOST_COUNTS}, found {text!r}")
    return int(text)


def _unit(text: str) -> str:
    if text not in UNITS:
        raise ValueError(f"expected one of {', '.join(UNITS)}, found {text!r}")
    return text


def _yes_or_no(text: str) -> bool:
    word = text.strip().lower()
    if word not in ("y", "yes", "n", "no"):
        raise ValueError(f"{text.strip()!r} is neither yes nor no")
    return word.startswith("y")


def robot_yaml(sample: str, draft: Draft, bus: Bus) -> str:
    """The text of a robot.yaml: `sample`, a file that comes with canbase, with its comments and these values.

    The drives and the first lines are written anew. Accelerations stay those of the sample.
    """
    before, drives, after = _around_drives(f"{HEAD}{sample[sample.index('# Lengths in m') :]}")
    values: list[tuple[tuple[str, ...], Any]] = [
        (("name",), draft.name),
        (("bus", "interface"), bus.interface),
        (("bus", "channel"), bus.channel),
        *([] if bus.is_virtual else [(("bus", "bitrate"), bus.bitrate)]),
        *([(("bus", "extra"), dict(bus.extra))] if bus.extra else []),
        *([(("lease", "socket"), f"$XDG_RUNTIME_DIR/canbase-{draft.name}/lease.sock")] if bus.is_virtual else []),
        (("base", "wheel_radius_m"), draft.wheel_radius_m),
        (("base", "track_m"), draft.track_m),
        (("limits", "linear_mps"), draft.linear_mps),
        (("limits", "angular_radps"), _turning_radps(draft)),
        (("safety", "footprint", "front_m"), draft.front_m),
        (("safety", "footprint", "rear_m"), draft.rear_m),
        (("safety", "footprint", "left_m"), draft.half_width_m),
        (("safety", "footprint", "right_m"), draft.half_width_m),
        (("safety", "scan", "required"), draft.scanner is not None),
        *_scanner_values(draft.scanner),
        (("safety", "estop", "required"), draft.has_estop),
    ]
    text = f"{before}{drives}{_drives(draft.wheels)}{after}"
    return edited(text, [Edit(loc, None, value) for loc, value in values])


def _scanner_values(scanner: Scanner | None) -> list[tuple[tuple[str, ...], Any]]:
    if scanner is None:
        return []
    values = {"x_m": scanner.x_m, "y_m": scanner.y_m, "yaw_rad": float(f"{math.radians(scanner.yaw_deg):.6g}")}
    upside_down = {"upside_down": True} if scanner.upside_down else {}
    return [(("safety", "scan", key), value) for key, value in (values | upside_down).items()]


def _around_drives(sample: str) -> tuple[str, str, str]:
    """The text before the drives, the line `drives:`, and the text behind them."""
    before, key, rest = sample.partition("\ndrives:\n")
    end = re.search(r"^(?=\S)|^\n", rest, re.MULTILINE)
    if not key or end is None:
        raise ValueError("the sample has no drives")
    return before, key, rest[end.start() :]


def _drives(wheels: Sequence[Wheel]) -> str:
    return "".join(_drive(wheel, joint) for wheel, joint in zip(wheels, _joints(wheels), strict=True))


def _joints(wheels: Sequence[Wheel]) -> list[str]:
    """left_wheel, or left_wheel_1, left_wheel_2 where a side has several."""
    names = []
    for i, wheel in enumerate(wheels):
        same = [j for j, other in enumerate(wheels) if other.side is wheel.side]
        names.append(f"{wheel.side.value}_wheel" + (f"_{same.index(i) + 1}" if len(same) > 1 else ""))
    return names


def _drive(wheel: Wheel, joint: str) -> str:
    lines = [
        f"  - joint: {joint}",
        f"    node_id: {wheel.found.node_id}",
        *([f"    axis: {wheel.found.axis}"] if wheel.found.axis else []),
        f"    side: {wheel.side.value}",
        "    direction: 1                  # not measured yet: canbase setup commission finds it"
        if wheel.side is Side.LEFT
        else (
            "    direction: -1                 # mounted mirrored, as on most bases; canbase setup commission finds it"
        ),
        f"    gear_ratio: {wheel.gear_ratio:.9g}",
        f"    counts_per_motor_rev: {wheel.counts_per_motor_rev}",
        f"    profile: {wheel.found.profile}",
        *([f'    velocity_unit: "{wheel.velocity_unit}"'] if wheel.velocity_unit else []),
    ]
    return "".join(f"{line}\n" for line in lines)


def _turning_radps(draft: Draft) -> float:
    """As fast as the wheels turn the base at the greatest speed, and no faster than a turn in FULL_TURN_S."""
    return float(f"{min(2.0 * draft.linear_mps / draft.track_m, 2.0 * math.pi / FULL_TURN_S):.2g}")
