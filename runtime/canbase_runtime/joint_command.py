"""Wheel speeds of a sensor_msgs/JointState, as the topic hardware of ros2_control publishes them, as a base velocity.

Rules. What breaks one of them is refused as a whole:
1. The message has exactly the joints of robot.yaml's drives, each once, in any order. What a missing wheel shall do is
   unknown, and another joint is none that canbase turns.
2. It has one velocity for each joint, no positions and no efforts: joint_states has positions, and a base that follows
   its own measured speed never stops.
3. Every speed is finite.
4. The wheels of one side have one speed. Rims that differ by more than base.standstill_mps do not belong to one
   velocity of the base. Below that the fastest counts: zero means that every wheel is ordered zero.
Limits are those of every other source: filter and driver apply them to the velocity of the base.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from canbase_config.drive import Drive
from canbase_config.robot import Robot
from canbase_runtime.foreign_text import printable

CURE = "give the wheels a ros2_control tag of their own, as canbase print urdf prints it"


class JointMessage(Protocol):
    """The fields of sensor_msgs/JointState that are read."""

    name: Sequence[str]
    position: Sequence[float]
    velocity: Sequence[float]
    """[rad/s], positive drives the base forward."""
    effort: Sequence[float]


@dataclass(frozen=True, slots=True)
class BaseVelocity:
    """Of the base, by REP 103. Both are finite."""

    linear_mps: float
    angular_radps: float


@dataclass(frozen=True, slots=True)
class Refusal:
    """A message that orders no velocity of the base. `why`: for people, and what helps."""

    why: str


def base_velocity(message: JointMessage, robot: Robot) -> BaseVelocity | Refusal:
    """The velocity of the base whose wheels turn as `message` orders: the inverse of diff_drive_controller's split."""
    why = _wrong_form(message, robot.drives)
    if why:
        return Refusal(why)
    speeds_radps = dict(zip(message.name, message.velocity, strict=True))
    sides = [
        {drive.joint: speeds_radps[drive.joint] for drive in robot.drives if drive.side == side}
        for side in ("left", "right")
    ]
    return _of_sides(sides[0], sides[1], robot)


def _wrong_form(message: JointMessage, drives: Sequence[Drive]) -> str:
    """Rules 1 and 2; empty: they hold. Counts come first: a message may be of any size."""
    joints = [drive.joint for drive in drives]
    ours = f"robot.yaml has drives[…].joint: {', '.join(joints)}"
    if len(message.name) != len(joints):
        return f"{len(message.name)} joints instead of {len(joints)}; {ours}; {CURE}"
    strangers = [printable(name) for name in message.name if name not in joints]
    if strangers:
        return f"no drive turns the joint {', '.join(strangers)}; {ours}"
    missing = [joint for joint in joints if joint not in message.name]
    if missing:
        return f"no speed for the joint {', '.join(missing)}, another one is named twice; {ours}"
    if len(message.position) or len(message.effort):
        return "it has positions or efforts, as measured joint_states do: give each joint a velocity command alone"
    if len(message.velocity) != len(joints):
        return f"{len(message.velocity)} velocities for {len(joints)} joints: each needs a velocity command"
    return ""


def _of_sides(left: Mapping[str, float], right: Mapping[str, float], robot: Robot) -> BaseVelocity | Refusal:
    """Rules 3 and 4. Speeds by joint [rad/s]."""
    for joint, radps in (*left.items(), *right.items()):
        if not math.isfinite(radps):
            return Refusal(f"the speed of {joint} is {radps:g}: NaN or infinity")
    base = robot.base
    for side, speeds in (("left", left), ("right", right)):
        if (max(speeds.values()) - min(speeds.values())) * base.radius_m(side) > base.standstill_mps:
            each = ", ".join(f"{joint} {radps:.3f}" for joint, radps in speeds.items())
            limit = f"base.standstill_mps allows {base.standstill_mps / base.radius_m(side):.3f} rad/s"
            return Refusal(f"the wheels on the {side} differ: {each} rad/s ({limit}); a side has one speed")
    left_mps = max(left.values(), key=abs) * base.radius_m("left")
    right_mps = max(right.values(), key=abs) * base.radius_m("right")
    velocity = BaseVelocity((left_mps + right_mps) / 2.0, (right_mps - left_mps) / base.track_m)
    if not (math.isfinite(velocity.linear_mps) and math.isfinite(velocity.angular_radps)):
        return Refusal("its speeds are too great for a number: infinity")
    return velocity
