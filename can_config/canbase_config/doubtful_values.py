"""Values of robot.yaml that can be used and are probably not meant: sentences with both values and the remedy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from canbase_config.errors import Loc

if TYPE_CHECKING:
    from canbase_config.robot import Robot


def doubtful_values(robot: Robot) -> Iterator[tuple[Loc, str]]:
    """The place of each in robot.yaml, and a sentence."""
    pairs = (("max_speed_mps", "linear_mps", "m/s"), ("max_speed_radps", "angular_radps", "rad/s"))
    for own, limit, unit in pairs:
        most, allowed = getattr(robot.action, own), getattr(robot.limits, limit)
        if most > allowed and own in robot.action.model_fields_set:
            yield ("action", own), f"no goal is faster than limits.{limit} ({allowed:g} {unit}): set at most that"
    if not robot.mux.action_source:
        yield (
            ("mux", "sources"),
            "no source has the topic cmd_vel_action, so every goal is rejected; sources that are given replace all "
            "default ones: add action: {topic: cmd_vel_action, priority: 40, timeout_s: 0.3, nodes: "
            "[drive_distance_server]}",
        )
