"""The file of the inputs of mux and filter at a stop: each call, and each decision. Pure; docs/ros_api.md has its form.

canbase_velocity.input_ring writes it. It may come from anybody: each value is checked, and its size is bounded.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BeforeValidator, TypeAdapter, ValidationError

from canbase_config.mux import Mux as MuxSection
from canbase_config.robot import Base, Limits, Rates
from canbase_config.safety import Safety
from canbase_recording.core_state import array
from canbase_recording.input_lines import NoInputsError, Time, first_of, head_of, json_line, read_call, readers
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
    at_s: Time
    """Of the stop."""
    cause: str
    """`driver`: latched by driver or watchdog; `estop`."""
    wall_offset_s: Time


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
        calls.append(read_call(values, number, _CALLS, "mux or filter"))
    return VelocityInputs(head, state, tuple(calls))


def velocity_head(line: str) -> VelocityHead:
    """Of the first line. Raises NoInputsError."""
    head = head_of(line, LINE_BYTES, "velocity", FORMAT, "mux and filter")
    try:
        return _HEAD.validate_python(
            {
                **{name: head[name] for name in ("robot", "wall_offset_s")},
                **{name: head["stop"][name] for name in ("at_s", "cause")},
                "config": {**head["robot_yaml"], "uncommissioned": head["uncommissioned"]},
            }
        )
    except KeyError as error:
        raise NoInputsError(f"line 1: the key {error} is missing") from error
    except ValidationError as error:
        raise NoInputsError(f"line 1: this canbase refuses the recorded robot.yaml: {first_of(error)}") from error
    except TypeError as error:
        raise NoInputsError(f"line 1: a value is not what it must be: {str(error)[:200]}") from error


def _scan(told: Mapping[str, Any]) -> Scan:
    ranges = array(told["ranges_m"])
    if ranges.ndim != 1 or ranges.dtype.kind != "f":
        raise ValueError("a scan has one row of ranges")
    return Scan(**{**told, "ranges_m": ranges})


def _points(told: Mapping[str, Any]) -> Points:
    at_m, beams = array(told["at_m"]), array(told["beams"])
    if at_m.ndim != 2 or at_m.shape[1] != 2 or beams.shape != at_m.shape[:1]:
        raise ValueError("points are rows of two")
    return Points(at_m.astype(np.float64), beams.astype(np.intp), int(told["beam_count"]))


_HEAD: Final = TypeAdapter(VelocityHead)
_HELD: Final = (str, float, float, int | None)
_DECIDED: Final = (int, str, float, float, bool, str)
_CALLS: Final = readers(
    {
        "command": (str, float, float, float, tuple[float, float] | None),
        "driver": (int, int, float),
        "lock": (str, bool, float),
        "foreign": (list[dict[str, Any]],),
        "publishers": (str, list[str], list[str]),
        "mux": _HELD,
        "mux_shutdown": _HELD,
        "obey": (float,),
        "estop": (bool, float),
        "buttons": (int, str),
        "scan": (str, Annotated[Any, BeforeValidator(_scan)], Placement | None, float),
        "points": (str, Annotated[Any, BeforeValidator(_points)]),
        "unplaced": (str, str),
        "scanners": (str, list[str], list[str]),
        "speed_limit": (float, float, str),
        "reset": (list[str],),
        "record": (dict[str, Any] | None, str),
        "end": (),
        "decide": _DECIDED,
        "shut_down": _DECIDED,
    }
)
