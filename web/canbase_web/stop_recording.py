"""The speeds of a recorded stop: from the frames of a black box to what a plot shows. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from canbase_config.profile import Layout
from canbase_config.robot import Robot
from canbase_driver.cia301.pdo import joined_velocity, node_layout, unpack_velocity
from canbase_driver.drive_units import AxisUnits

MOST_FRAMES: Final = 100_000
"""A recording has 80,000 at most."""
MOST_POINTS: Final = 1_000
"""Of a line in a plot."""

FrameAt = tuple[float, int, bytes]
"""Time [s], identifier, data."""


@dataclass(slots=True)
class WheelSpeeds:
    """Of one wheel: times [s] and speeds of its rim, ordered (60FFh) and measured (606Ch) [m/s]."""

    joint: str
    ordered: list[tuple[float, float]] = field(default_factory=list)
    measured: list[tuple[float, float]] = field(default_factory=list)


def wheel_speeds(robot: Robot, frames: Iterable[FrameAt]) -> list[WheelSpeeds]:
    """In the order of robot.yaml; forward is positive. Frames that do not fit the layout are passed over."""
    found = [WheelSpeeds(drive.joint) for drive in robot.drives]
    ordered, measured, joined = {}, {}, {}
    for drive, speeds in zip(robot.drives, found, strict=True):
        same_node = tuple(each for each in robot.drives if each.node_id == drive.node_id)
        layout = node_layout(drive.node_id, same_node, robot)
        wheel = drive, AxisUnits(drive, robot.base), speeds
        ordered[layout.setpoint_cob_id(drive.axis)] = wheel
        measured[layout.velocity_cob_id(drive.axis)] = joined[layout.status_cob_id(drive.axis)] = wheel
    for at_s, cob_id, data in frames:
        if cob_id in ordered:
            drive, units, speeds = ordered[cob_id]
            _add(speeds.ordered, at_s, _target(data, drive.kind.layout), units)
        if cob_id in measured:
            drive, units, speeds = measured[cob_id]
            _add(speeds.measured, at_s, unpack_velocity(data, drive.kind.layout), units)
        if cob_id in joined:
            drive, units, speeds = joined[cob_id]
            velocity = unpack_velocity(joined_velocity(data, drive.kind.layout), drive.kind.layout)
            _add(speeds.measured, at_s, velocity, units)
    for speeds in found:
        speeds.ordered, speeds.measured = _thinned(speeds.ordered), _thinned(speeds.measured)
    return found


def _add(line: list[tuple[float, float]], at_s: float, raw: int | None, units: AxisUnits) -> None:
    if raw is not None:
        line.append((round(at_s, 3), round(units.velocity_mps(raw), 4)))


def _target(data: bytes, layout: Layout) -> int | None:
    """60FFh behind the controlword; None: the frame is too short."""
    end = 2 + layout.target_bits // 8
    return int.from_bytes(data[2:end], "little", signed=True) if len(data) >= end else None


def _thinned(line: list[tuple[float, float]]) -> list[tuple[float, float]]:
    step = max(1, -(-len(line) // MOST_POINTS))
    return line[::step]
