"""The file of the inputs of mux and filter at a stop: each call, and each decision. Pure; docs/ros_api.md has its form.

canbase_velocity.input_ring writes it. It may come from anybody: each value is checked, and its size is bounded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from canbase_config.mux import Mux as MuxSection
from canbase_config.robot import Base, Limits, Rates
from canbase_config.safety import Safety
from canbase_recording.core_state import array
from canbase_recording.input_lines import finite, head_of, json_line
from canbase_recording.recorded_inputs import NoInputsError
from canbase_velocity.clearance import Points
from canbase_velocity.input_ring import FORMAT, MAX_INPUTS
from canbase_velocity.placement import Placement
from canbase_velocity.scan import Scan

LINE_BYTES: Final = 3_000_000
"""The state of a filter with a scanner of 5,000 beams, or one scan of 100,000."""

Call = tuple[Any, ...]
"""What it is, its time [s], and its values."""


@dataclass(frozen=True, slots=True)
class VelocityConfig:
    """What mux and filter need of robot.yaml."""

    limits: Limits
    safety: Safety
    mux: MuxSection
    rates: Rates
    base: Base
    uncommissioned: str


@dataclass(frozen=True, slots=True)
class VelocityHead:
    """The first line. Times: monotonic seconds of the robot's computer."""

    robot: str
    config: VelocityConfig
    at_s: float
    """Of the stop."""
    cause: str
    """`driver`: latched by driver or watchdog; `estop`."""
    wall_offset_s: float


@dataclass(frozen=True, slots=True)
class VelocityInputs:
    """One file."""

    head: VelocityHead
    state: Any
    """Of mux and filter at its begin; None: not recorded."""
    calls: tuple[Call, ...]

    @property
    def began_s(self) -> float:
        """Of the first call [s]."""
        return float(self.calls[0][1]) if self.calls else self.head.at_s


def velocity_inputs(lines: Iterable[str]) -> VelocityInputs:
    """`lines` of the file, the head first. Raises NoInputsError, with the number of the line."""
    numbered = enumerate(lines, 1)
    head = velocity_head(next(numbered, (1, ""))[1])
    state, calls = None, []
    for number, line in numbered:
        if number > MAX_INPUTS + 2:
            raise NoInputsError(f"line {number}: canbase writes no more than {MAX_INPUTS}")
        values = json_line(line, number, LINE_BYTES)
        if number == 2 and isinstance(values, list) and values[:1] == ["state"]:
            state = values[2] if len(values) == 3 else None
            continue
        calls.append(_call(values, number))
    return VelocityInputs(head, state, tuple(calls))


def velocity_head(line: str) -> VelocityHead:
    """Of the first line. Raises NoInputsError."""
    head = head_of(line, LINE_BYTES, "velocity", FORMAT, "mux and filter")
    try:
        told = head["robot_yaml"]
        config = VelocityConfig(
            Limits.model_validate(told["limits"]),
            Safety.model_validate(told["safety"]),
            MuxSection.model_validate(told["mux"]),
            Rates.model_validate(told["rates"]),
            Base.model_validate(told["base"]),
            str(head["uncommissioned"]),
        )
        stop = head["stop"]
        return VelocityHead(
            str(head["robot"]), config, finite(stop["at_s"]), str(stop["cause"]), finite(head["wall_offset_s"])
        )
    except KeyError as error:
        raise NoInputsError(f"line 1: the key {error} is missing") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        raise NoInputsError(f"line 1: this canbase refuses the recorded robot.yaml: {key}: {first['msg']}") from error
    except (TypeError, ValueError, AttributeError) as error:
        raise NoInputsError(f"line 1: a value is not what it must be: {str(error)[:200]}") from error


def _call(values: Any, number: int) -> Call:
    try:
        what, at_s, *rest = values
        return what, finite(at_s), *_READ[what](*rest)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise NoInputsError(f"line {number}: no input of mux or filter ({str(error)[:80]})") from error


def _names(values: Any) -> list[str]:
    return [str(each) for each in values]


def _scan(topic: Any, told: Mapping[str, Any], placement: Any, wall_s: Any = None) -> Call:
    """Of a recording without the time of its scans by the wall clock none was late."""
    fields = {name: told[name] for name in Scan.__slots__ if name != "ranges_m"}
    ranges = array(told["ranges_m"])
    if ranges.ndim != 1 or ranges.dtype.kind != "f":
        raise ValueError("a scan has one row of ranges")
    scan = Scan(ranges_m=ranges, **_scan_fields(fields))
    wall_s = (scan.stamp_ns or 0) * 1e-9 if wall_s is None else float(wall_s)
    return str(topic), scan, _placement(placement), wall_s


def _scan_fields(fields: Mapping[str, Any]) -> dict[str, Any]:
    text, whole = ("frame",), ("stamp_ns",)
    return {
        name: None if value is None else str(value) if name in text else int(value) if name in whole else float(value)
        for name, value in fields.items()
    }


def _placement(told: Any) -> Placement | None:
    if told is None:
        return None
    (xx, xy), (yx, yy) = told["x_axis"], told["y_axis"]
    return Placement(float(told["x_m"]), float(told["y_m"]), (float(xx), float(xy)), (float(yx), float(yy)))


def _points(topic: Any, told: Mapping[str, Any]) -> Call:
    at_m, beams = array(told["at_m"]), array(told["beams"])
    if at_m.ndim != 2 or at_m.shape[1] != 2 or beams.shape != at_m.shape[:1]:
        raise ValueError("points are rows of two")
    return str(topic), Points(at_m.astype(np.float64), beams.astype(np.intp), int(told["beam_count"]))


def _times(told: Any) -> tuple[float, float] | None:
    return None if told is None else (float(told[0]), float(told[1]))


def _hold(active: Any, v: Any, w: Any, standing: Any) -> Call:
    return str(active), float(v), float(w), None if standing is None else int(standing)


_READ: Final[Mapping[str, Callable[..., Call]]] = {
    "command": lambda name, v, w, received, times: (str(name), float(v), float(w), float(received), _times(times)),
    "driver": lambda state, cycles, received: (int(state), int(cycles), float(received)),
    "lock": lambda name, locked, received: (str(name), bool(locked), float(received)),
    "foreign": lambda found: ([dict(each) for each in found],),
    "publishers": lambda topic, nodes, keys: (str(topic), _names(nodes), _names(keys)),
    "mux": _hold,
    "mux_shutdown": _hold,
    "obey": lambda received: (float(received),),
    "estop": lambda pressed, received: (bool(pressed), float(received)),
    "buttons": lambda count, why: (int(count), str(why)),
    "scan": _scan,
    "points": _points,
    "unplaced": lambda topic, why: (str(topic), str(why)),
    "scanners": lambda topic, nodes, keys=None: (str(topic), _names(nodes), _names(nodes if keys is None else keys)),
    "speed_limit": lambda v, w, by: (float(v), float(w), str(by)),
    "reset": lambda moving: (_names(moving),),
    "record": lambda record, problem: (None if record is None else dict(record), str(problem)),
    "end": lambda: (),
    "decide": lambda a, c, v, w, e, d: (int(a), str(c), float(v), float(w), bool(e), str(d)),
    "shut_down": lambda a, c, v, w, e, d: (int(a), str(c), float(v), float(w), bool(e), str(d)),
}
