"""The motion of the base as its drives can know it at best: the true one, with the size that their encoders give it.

Position, velocity and the drive's own loop hang on one encoder. Where it counts half of the motion, the wheel is to
every part of the robot a wheel of half the size; only another sensor could tell them apart. So orders are compared with
the motion in the measure of the encoders. A side has the measure of the encoder that counts least.
"""

from __future__ import annotations

from campaign.world import World


class Shown:
    """Rim speeds and the twist that they make [m/s, rad/s]; `look` once a step."""

    def __init__(self, world: World) -> None:
        self._base, self._track_m = world.drives.bench.base, world.robot.base.track_m
        drives = world.robot.drives
        self._encoders = tuple(
            [world.drives.axis(wheel).encoder for wheel, drive in enumerate(drives) if drive.side == side]
            for side in ("left", "right")
        )
        self.left_mps = self.right_mps = self.linear_mps = self.angular_radps = 0.0

    def look(self) -> None:
        """Now."""
        base = self._base
        if base.resting:
            self.left_mps = self.right_mps = self.linear_mps = self.angular_radps = 0.0
            return
        left, right = (min(encoder.scale for encoder in side) for side in self._encoders)
        self.left_mps, self.right_mps = left * base.v_left_mps, right * base.v_right_mps
        self.linear_mps = (self.left_mps + self.right_mps) / 2.0
        self.angular_radps = (self.right_mps - self.left_mps) / self._track_m

    @property
    def fastest_mps(self) -> float:
        """The faster wheel."""
        return max(abs(self.left_mps), abs(self.right_mps))

    def __str__(self) -> str:
        return f"{self.linear_mps:+.3f} m/s {self.angular_radps:+.3f} rad/s"
