"""Which parameters of Nav2 are speeds, and which of them are above what robot.yaml permits. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from canbase_config.nav2_params import speeds
from canbase_doctor.check import Check, ok, warn
from canbase_doctor.evidence import Evidence

LINEAR, ANGULAR = "m/s", "rad/s"
AXES: Final = (LINEAR, "", ANGULAR)
"""What the three numbers of velocity_smoother's lists are: x, y, yaw. A base of canbase has no y."""
SLACK: Final = 1e-6
NAME: Final = "Nav2 speeds"


@dataclass(frozen=True, slots=True)
class Speed:
    """A parameter with the units of its numbers."""

    node: str
    parameter: str
    units: tuple[str, ...]

    @property
    def key(self) -> tuple[str, str]:
        """As in `Evidence.nav2_values`."""
        return (self.node, self.parameter)


SPEEDS: Final = (
    Speed("velocity_smoother", "max_velocity", AXES),
    Speed("velocity_smoother", "min_velocity", AXES),
    Speed("controller_server", "FollowPath.vx_max", (LINEAR,)),
    Speed("controller_server", "FollowPath.vx_min", (LINEAR,)),
    Speed("controller_server", "FollowPath.wz_max", (ANGULAR,)),
    Speed("docking_server", "controller.v_linear_max", (LINEAR,)),
    Speed("following_server", "controller.v_linear_max", (LINEAR,)),
)


def speed_checks(seen: Evidence) -> list[Check]:
    """One row: the speeds of Nav2 that are above ours. The base is not faster for them, but Nav2 plans with them."""
    if not seen.nav2_values:
        return [warn(NAME, "no node of Nav2 answered for its parameters", "is it configured? Call doctor again")]
    most = speeds(seen.robot)
    above = list(_above(seen, {LINEAR: most.linear_mps, ANGULAR: most.angular_radps}))
    if not above:
        return [ok(NAME, f"at most {most.linear_mps:g} {LINEAR} and {most.angular_radps:g} {ANGULAR}, as robot.yaml")]
    return [warn(NAME, "; ".join(above), "the base does not follow them: canbase print nav2 prints fitting parameters")]


def _above(seen: Evidence, most: dict[str, float]) -> Iterator[str]:
    for speed in SPEEDS:
        for value, unit in zip(seen.nav2_values.get(speed.key, ()), speed.units, strict=False):
            if unit and not abs(value) <= most[unit] + SLACK:  # NaN too
                yield f"{speed.node} {speed.parameter} is {value:g} {unit}, robot.yaml permits {most[unit]:g}"
