"""What mux and filter decided from in the last seconds, call by call, and what they decided. No clock, no file.

The same calls give new cores the same decisions (`canbase record replay`). A recording begins with their state, which
is kept every CHECKPOINT_S. The form of the file: docs/ros_api.md, "The inputs of mux and filter".
"""

from __future__ import annotations

import json
import pickle
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from canbase_config.robot import Robot
from canbase_runtime.driver_state import DriverState
from canbase_velocity.clearance import Points
from canbase_velocity.core_state import array, plain
from canbase_velocity.decision import Decision
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.mux import Mux, MuxDecision
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import FilterConfig
from canbase_velocity.scan import Scan

FORMAT: Final = 1
"""Grows when a reader of this form would misread a new one."""
CHECKPOINT_S: Final = 5.0
MAX_INPUTS: Final = 50_000
MAX_SCAN_BYTES: Final = 8_000_000
"""Of the readings of all scans that are kept."""
AFTER_S: Final = 1.0
"""A file is due so long after the stop: it has what followed [s]."""
DRIVER, ESTOP = "driver", "estop"

STATE: Final = "state"
Input = tuple[Any, ...]
"""What it is, its monotonic time [s], and its values: plain ones, Scan, Points, Placement."""
Note = Callable[..., None]
"""`InputRing.note`, or `forget`."""
SECTIONS: Final = ("limits", "safety", "mux", "rates", "base")
"""Of robot.yaml, that mux and filter work with."""


@dataclass(frozen=True, slots=True)
class Stop:
    """What a file is written for: `driver`, latched by driver or watchdog, or `estop`. Monotonic time [s]."""

    at_s: float
    cause: str


class InputRing:
    """Keeps the newest inputs. One thread adds, and it alone."""

    def __init__(self, seconds: float) -> None:
        """`seconds`: how far a file goes back at least, and CHECKPOINT_S more at most."""
        self._keep_s = seconds + CHECKPOINT_S
        self._inputs: deque[Input] = deque()
        self._scan_bytes = 0
        self._state_at_s = float("-inf")

    def note(self, *entry: Any) -> None:
        """An input, or a decision. Nothing of it may change afterwards."""
        self._inputs.append(entry)
        if entry[0] == "scan":
            self._scan_bytes += _size(entry)

    def keep_recent(self, mux: Mux, safety: SafetyFilter, now_s: float) -> None:
        """Now and then: forgets what is old, and keeps the state."""
        if now_s >= self._state_at_s + CHECKPOINT_S:
            self._state_at_s = now_s
            self.note(STATE, now_s, _pickled(mux, safety))
        inputs = self._inputs
        while inputs and (inputs[0][1] < now_s - self._keep_s or self._is_full):
            entry = inputs.popleft()
            if entry[0] == "scan":
                self._scan_bytes -= _size(entry)

    @property
    def _is_full(self) -> bool:
        return len(self._inputs) > MAX_INPUTS or self._scan_bytes > MAX_SCAN_BYTES

    def cut(self) -> tuple[Input, ...]:
        """All of them, in the order of the calls."""
        return tuple(self._inputs)


def _size(entry: Input) -> int:
    return int(getattr(entry[3].ranges_m, "nbytes", 0) or np.asarray(entry[3].ranges_m).nbytes)


def _pickled(mux: Mux, safety: SafetyFilter) -> bytes | None:
    """A copy that costs 0.2 ms. None: compiled cores cannot be copied; a replay then begins without a past."""
    try:
        return pickle.dumps((mux, safety), protocol=5)
    except (TypeError, AttributeError, pickle.PicklingError):
        return None


class StopWatch:
    """Finds out when a file is due."""

    def __init__(self) -> None:
        self._latched = self._held = True  # what was there at the start is no new stop
        self.open: Stop | None = None

    def due_stop(self, driver: DriverState, estop_free: bool, now_s: float) -> Stop | None:
        """The stop whose file is due now."""
        latched = driver is DriverState.LATCHED
        if self.open is None and ((latched and not self._latched) or (not estop_free and not self._held)):
            self.open = Stop(now_s, DRIVER if latched and not self._latched else ESTOP)
        self._latched, self._held = latched, not estop_free
        due = self.open
        if due is None or now_s < due.at_s + AFTER_S:
            return None
        self.open = None
        return due


def forget(*_: Any) -> None:
    """In place of `InputRing.note`, where nobody records."""


def filter_entry(kind: str, now_s: float, decision: Decision) -> Input:
    """A decision of the filter: `decide` or `shut_down`, and what came of it."""
    twist = decision.twist
    values = int(decision.action), decision.cause.value, twist.linear_mps, twist.angular_radps, decision.emergency
    return kind, now_s, *values, decision.detail


def mux_entry(kind: str, now_s: float, decision: MuxDecision) -> Input:
    """A decision of the mux: `mux` or `mux_shutdown`, and what came of it."""
    holder = decision.holder
    standing = None if holder is None else int(holder.standing)
    return kind, now_s, decision.active or "", decision.twist.linear_mps, decision.twist.angular_radps, standing


def head(robot: Robot, config: FilterConfig, stop: Stop, wall_offset_s: float) -> dict[str, Any]:
    """The first line of the file."""
    return {
        "format": FORMAT,
        "part": "velocity",
        "robot": robot.name,
        "stop": asdict(stop),
        "wall_offset_s": wall_offset_s,
        "uncommissioned": config.uncommissioned,
        "robot_yaml": {
            name: (config.safety if name == "safety" else getattr(robot, name)).model_dump(mode="json")
            for name in SECTIONS
        },
    }


def lines(first: dict[str, Any], inputs: tuple[Input, ...]) -> Iterator[str]:
    """The file, line by line, from the first state on."""
    yield json.dumps(first) + "\n"
    begun = False
    for each in inputs:
        if each[0] == STATE and not begun:
            begun = True
            yield json.dumps([_plain(value) for value in _stated(each)]) + "\n"
        elif begun and each[0] != STATE:
            yield json.dumps([_plain(value) for value in each]) + "\n"


def _stated(each: Input) -> Input:
    if each[0] != STATE or each[2] is None:
        return each
    return STATE, each[1], plain(pickle.loads(each[2]))


def _plain(value: Any) -> Any:
    if isinstance(value, Scan):
        fields = {name: getattr(value, name) for name in Scan.__slots__ if name != "ranges_m"}
        return {"ranges_m": array(value.ranges_m), **fields}
    if isinstance(value, Points):
        return {"at_m": array(value.at_m), "beams": array(value.beams), "beam_count": value.beam_count}
    if isinstance(value, Placement):
        return asdict(value)
    return value
