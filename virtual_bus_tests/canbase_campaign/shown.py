"""The motion of the base as its drives can know it at best: the true one, with the size that their encoders give it.

Position, velocity and the drive's own loop hang on one encoder. Where it counts half of the motion, the wheel is to
every part of the robot a wheel of half the size; only another sensor could distinguish them. So orders are compared
with the motion in the measure of the encoders. A side has the measure of the encoder that counts least.
"""

from __future__ import annotations

from canbase_campaign.world import World
from canbase_sim.cia402.axis import Axis


def _lies(axis: Axis) -> bool:
    """Its position on the bus may be another one than that of its encoder, or that one than its motor's."""
    return axis.encoder.is_faulty or axis.faults.frozen or axis.faults.frozen_position is not None


class Shown:
    """Rim speeds and the twist that they make [m/s, rad/s]; `look` once a step."""

    def __init__(self, world: World) -> None:
        self._base, self._track_m = world.drives.bench.base, world.robot.base.track_m
        drives = world.robot.drives
        self._intruder = world.intruder
        self._clock, self._at = world.clock, world.clock.now_s
        self._axes = [world.drives.axis(wheel) for wheel in range(len(drives))]
        self._encoders = tuple(
            [axis.encoder for axis, drive in zip(self._axes, drives, strict=True) if drive.side == side]
            for side in ("left", "right")
        )
        self._pushed_s = [0.0 for _ in drives]
        self.left_mps = self.right_mps = self.linear_mps = self.angular_radps = 0.0

    def look(self) -> None:
        """Now."""
        base, elapsed_s, self._at = self._base, self._clock.now_s - self._at, self._clock.now_s
        for wheel, axis in enumerate(self._axes):
            motor = axis.motor
            given_s = elapsed_s * abs(motor.force_n) / motor.peak_force_n
            self._pushed_s[wheel] = self._pushed_s[wheel] + given_s if motor.powered else 0.0
        if base.resting:
            self.left_mps = self.right_mps = self.linear_mps = self.angular_radps = 0.0
            return
        left, right = (min(encoder.scale for encoder in side) for side in self._encoders)
        self.left_mps, self.right_mps = left * base.v_left_mps, right * base.v_right_mps
        self.linear_mps = (self.left_mps + self.right_mps) / 2.0
        self.angular_radps = (self.right_mps - self.left_mps) / self._track_m

    @property
    def tells_truth(self) -> bool:
        """Each position on the bus is that of the wheel."""
        lies = any(_lies(axis) for axis in self._axes) or not self._base.is_as_configured
        return not lies and not self._intruder.twin

    @property
    def is_blind(self) -> bool:
        """An encoder shows nothing that its drive could brake."""
        return any(not axis.encoder.closes_loop for axis in self._axes)

    @property
    def is_uncoupled(self) -> bool:
        """A motor and its encoder have no coupling to their wheel: no sensor shows its motion."""
        return any(axis.uncoupled for axis in self._axes)

    @property
    def pushed_blindly_s(self) -> float:
        """How long a drive with such an encoder has given its rated torque, or less for longer, without a release."""
        pushed = zip(self._axes, self._pushed_s, strict=True)
        return max((given_s for axis, given_s in pushed if not axis.encoder.closes_loop), default=0.0)

    @property
    def fastest_mps(self) -> float:
        """The faster wheel."""
        return max(abs(self.left_mps), abs(self.right_mps))

    def __str__(self) -> str:
        return f"{self.linear_mps:+.3f} m/s {self.angular_radps:+.3f} rad/s"
