"""What the leases allow each wheel, worked out from the commands of a recording as canbase's watchdog does it. Pure.

Each command on cmd_vel has a lease with the same velocity (docs/bus.md): the commands of a black box show the leases.
"""

from __future__ import annotations

from typing import Final

from canbase_config.derive import watchdog_config
from canbase_config.robot import Robot
from canbase_recording.notes import CommandNote
from canbase_watchdog.envelope import Envelope

STEP_S: Final = 0.02
SETTLES_S: Final = 2.0
"""At the start everything is allowed: what the envelope says then is left out [s]."""
Bounds = list[tuple[float, float, float]]
"""Time [s], least and greatest speed of the rim [m/s]."""


def lease_bounds(robot: Robot, commands: list[CommandNote], until_s: float) -> dict[str, Bounds]:
    """By joint; empty without commands."""
    if not commands:
        return {}
    envelope = Envelope(watchdog_config(robot), commands[0].at_s)
    arms = {drive.joint: robot.base.track_m / 2.0 * (1.0 if drive.side == "right" else -1.0) for drive in robot.drives}
    found: dict[str, Bounds] = {joint: [] for joint in arms}
    waiting, now_s = list(reversed(commands)), commands[0].at_s
    while now_s <= until_s:
        while waiting and waiting[-1].at_s <= now_s:
            note = waiting.pop()
            envelope.advance(note.at_s)
            envelope.order(note.linear_mps, note.angular_radps, note.at_s)
        bounds = envelope.advance(now_s)
        for joint, arm_m in arms.items():
            if now_s - commands[0].at_s >= SETTLES_S:
                found[joint].append((now_s, *bounds.wheel(arm_m)))
        now_s += STEP_S
    return found
