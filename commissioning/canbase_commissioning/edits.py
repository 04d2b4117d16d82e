"""What commissioning found, as changes to robot.yaml: comments, order and all other lines stay as they are."""

from __future__ import annotations

import io
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.scalarint import HexCapsInt

from canbase_commissioning.calibration import agree
from canbase_commissioning.floor import FloorFound
from canbase_commissioning.wheel_direction import WheelFound
from canbase_config.commissioned import Step, identities, mark
from canbase_config.errors import Loc, key_path
from canbase_config.odometry import OdometrySettings
from canbase_config.robot import Robot
from canbase_config.scale_objects import Expected
from canbase_driver.boot.sequence import NUMBERS, BootReport

DIGITS = 5
"""Significant digits of a measured value: a tape gives four."""
SAME = 1e-4
"""A share below which a measured value is the one that stood there."""


TAPE = OdometrySettings()
"""How wrong a radius and a track are that a person has measured."""


@dataclass(frozen=True, slots=True)
class Edit:
    """One value of robot.yaml: what stood there (None: the default) and what is to stand there."""

    loc: Loc
    before: Any
    after: Any

    def __str__(self) -> str:
        return f"{key_path(self.loc)}: {self._shown(self.before)} → {self._shown(self.after)}"

    def _shown(self, value: Any) -> str:
        if isinstance(value, list | tuple):
            return ", ".join(str(Expected.model_validate(each)) for each in value) or "none"
        in_hex = isinstance(self.after, HexCapsInt) and value is not None
        return f"0x{value:X}" if in_hex else str(value)


def wheel_edits(robot: Robot, found: Sequence[WheelFound]) -> list[Edit]:
    """Direction, gear, counts and unit of each wheel where they differ."""
    edits = []
    for wheel in found:
        i = next(i for i, drive in enumerate(robot.drives) if drive.joint == wheel.joint)
        drive = robot.drives[i]
        edits.append(Edit(("drives", i, "direction"), drive.direction, wheel.direction))
        if wheel.scale is not None:
            edits.append(Edit(("drives", i, "gear_ratio"), drive.gear_ratio, rounded(wheel.scale.gear_ratio)))
            counts = wheel.scale.counts_per_motor_rev
            edits.append(Edit(("drives", i, "counts_per_motor_rev"), drive.counts_per_motor_rev, counts))
            edits.append(Edit(("drives", i, "velocity_unit"), drive.velocity_unit, wheel.scale.velocity_unit))
    return [edit for edit in edits if differs(edit)]


def floor_edits(robot: Robot, found: FloorFound) -> list[Edit]:
    """Radius and track. What `canbase setup calibrate` has found stays where the tape agrees: it is the more exact
    one."""
    base, odometry = robot.base, robot.odometry
    edits = []
    for key, before, measured, error, tape in (
        ("wheel_radius", base.wheel_radius_m, found.wheel_radius_m, odometry.radius_error, TAPE.radius_error),
        ("track", base.track_m, found.track_m, odometry.track_error, TAPE.track_error),
    ):
        calibrated = error < tape
        if calibrated and agree(before, measured):
            continue
        edits.append(Edit(("base", f"{key}_m"), before, rounded(measured)))
        if calibrated:
            edits.append(Edit(("odometry", f"{key.removeprefix('wheel_')}_error"), error, tape))
    return [edit for edit in edits if differs(edit)]


def identity_edits(robot: Robot, boots: Mapping[int, BootReport]) -> list[Edit]:
    """1018h of each drive that was booted, where robot.yaml has no identity; later boots compare with it."""
    edits = []
    for i, drive in enumerate(robot.drives):
        found = boots[drive.node_id].identity if drive.node_id in boots else drive.identity
        for name in NUMBERS:
            before, after = getattr(drive.identity, name), getattr(found, name)
            if after is not None:
                edits.append(Edit(("drives", i, "identity", name), before, HexCapsInt(after)))
    return [edit for edit in edits if differs(edit)]


def expects_edits(robot: Robot, boots: Mapping[int, BootReport]) -> list[Edit]:
    """Units and polarity that the drives had while their wheels were measured; later boots compare with them. Entries
    of other objects stay."""
    edits = []
    for i, drive in enumerate(robot.drives):
        boot = boots.get(drive.node_id)
        scale = () if boot is None else boot.scale.get(drive.joint, ())
        after = {(each.index, each.sub): each for each in (*drive.expects, *scale)}
        if scale and tuple(after.values()) != drive.expects:
            edits.append(Edit(("drives", i, "expects"), drive.expects, [_expected(each) for each in after.values()]))
    return edits


def _expected(each: Expected) -> CommentedMap:
    entry = CommentedMap({"index": HexCapsInt(each.index), "sub": each.sub, "value": each.value})
    entry.fa.set_flow_style()
    return entry


def commissioned_edits(robot: Robot, edits: Sequence[Edit], done: Collection[Step]) -> list[Edit]:
    """The marks of the steps that were done, with `edits` in robot.yaml; with a proof also that of its drives."""
    after, before = with_edits(robot, edits), robot.commissioned
    marks = [Edit(("commissioned", step), getattr(before, step), mark(after, step)) for step in done]
    if "proof" in done:
        marks.append(Edit(("commissioned", "identities"), before.identities, identities(after)))
    return [edit for edit in marks if differs(edit)]


def with_edits(robot: Robot, edits: Sequence[Edit]) -> Robot:
    """The robot with these values. Raises pydantic.ValidationError when they do not fit together."""
    values = robot.model_dump()
    values["drives"] = [dict(drive) for drive in values["drives"]]
    for edit in edits:
        _put(values, edit)
    return Robot.model_validate(values)


def edited(text: str, edits: Sequence[Edit]) -> str:
    """robot.yaml with these values, everything else as it is, comments too. Raises KeyError for a place it has not."""
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = 4096
    values = yaml.load(text)
    yaml.indent(mapping=2, sequence=4 if "\n  - " in text else 2, offset=2 if "\n  - " in text else 0)
    for edit in edits:
        _put(values, edit)
    out = io.StringIO()
    yaml.dump(values, out)
    return out.getvalue()


def _put(values: Any, edit: Edit) -> None:
    *places, key = edit.loc
    for place in places:
        if isinstance(values, CommentedMap) and place not in values:
            section = CommentedMap()
            section.fa.set_flow_style()
            _add(values, place, section)
        values = values[place]
    if isinstance(values, CommentedMap) and key not in values:
        _add(values, key, edit.after)
    else:
        values[key] = edit.after


def _add(values: CommentedMap, key: Any, value: Any) -> None:
    """At the end; before the last key if comments are behind that one: they may belong to the section that follows."""
    has_comments = next(reversed(values), None) in values.ca.items
    values.insert(len(values) - has_comments, key, value)


def rounded(value: float) -> float:
    """As it is written."""
    return float(f"{value:.{DIGITS}g}")


def differs(edit: Edit) -> bool:
    """Whether a measured value is another one than what stood there."""
    if isinstance(edit.before, float) and isinstance(edit.after, float):
        return abs(edit.after - edit.before) > SAME * abs(edit.before)
    return bool(edit.before != edit.after)
