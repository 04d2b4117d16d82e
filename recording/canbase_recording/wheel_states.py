"""Angle and speed of each wheel from the PDOs of a recording, message by message, for joint_states. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from canbase_config.object_map import POSITION_ACTUAL, TARGET_VELOCITY, VELOCITY_ACTUAL
from canbase_config.robot import Robot
from canbase_driver.drive_units import AxisUnits
from canbase_recording.entry import FrameKind, RecordedFrame
from canbase_recording.pdo_layouts import PdoLayouts
from canbase_recording.trace import units_of, wrapped


@dataclass(slots=True)
class WheelStates:
    """By joint. Without robot.yaml joints are called after their nodes, and values are raw numbers of the drives."""

    layouts: PdoLayouts
    robot: Robot | None
    measured: dict[str, float] = field(default_factory=dict)
    """Angular velocity of the wheel [rad/s]."""
    ordered: dict[str, float] = field(default_factory=dict)
    angle: dict[str, float] = field(default_factory=dict)
    """Of the wheel, from the begin of the recording on [rad]."""
    _counts: dict[str, int] = field(default_factory=dict)
    _units: dict[tuple[int, int], tuple[str, AxisUnits]] = field(init=False)

    def __post_init__(self) -> None:
        self._units = units_of(self.robot)
        for joint, _ in self._units.values():
            self.measured[joint] = self.ordered[joint] = math.nan

    def on_frame(self, frame: RecordedFrame) -> tuple[bool, bool]:
        """Whether this frame has new measured values, and new ordered ones."""
        if frame.kind is not FrameKind.DATA:
            return False, False
        layout = self.layouts.of(frame.cob_id, len(frame.data))
        if layout is None or not layout.fits(len(frame.data)):
            return False, False
        measured = ordered = False
        for mapped in layout.mapped:
            fallback = f"node{layout.node_id}" + (f"_axis{mapped.axis}" if mapped.axis else "")
            known = self._units.get((layout.node_id, mapped.axis))
            name, scale = known if known is not None else (fallback, None)
            radius_m = scale.radius_m if scale else 1.0
            value = mapped.value(frame.data)
            if mapped.base == POSITION_ACTUAL:
                step = wrapped(value - self._counts.get(name, value))
                self._counts[name] = value
                self.angle[name] = self.angle.get(name, 0.0) + (scale.position_m(step) if scale else step) / radius_m
            elif mapped.base in (VELOCITY_ACTUAL, TARGET_VELOCITY):
                speed = (scale.velocity_mps(value) if scale else float(value)) / radius_m
                measured = measured or mapped.base == VELOCITY_ACTUAL
                ordered = ordered or mapped.base == TARGET_VELOCITY
                (self.measured if mapped.base == VELOCITY_ACTUAL else self.ordered)[name] = speed
        return measured, ordered

    def angles(self, names: list[str]) -> list[float]:
        """In the order of `names`; NaN: not known."""
        return [self.angle.get(name, math.nan) for name in names]
