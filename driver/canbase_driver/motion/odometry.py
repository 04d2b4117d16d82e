"""From the drives' 32-bit positions to the pose of the base: unwrapping, travel of a wheel, exact arcs.

A first sample is an offset and never motion. What a wheel cannot have done does not enter the pose. No ROS, no clock.
Frames and axes are those of REP 103 and REP 105.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.odometry import OdometrySettings
from canbase_driver.motion.kinematics import Twist2D, base_twist
from canbase_driver.motion.pose_error import Covariance, PoseError

RE_REFERENCE_SAMPLES = 3
"""This many samples in a row at a new place, each near the one before: the counter stays there."""

DOUBTED_CYCLES = 10
"""A place that a counter jumped to is doubted after a gap of this many cycles: a second drive with the same node
id may have reported it."""

_STRAIGHT_RAD = 1e-4
_COUNTS = 1 << 32


def unwrap(previous_raw: int, raw: int) -> int:
    """Signed way from one 32-bit position to the next [counts], the shorter way round: −2³¹ … 2³¹ − 1.

    Both may be given as i32 (6064h) or as u32.
    """
    return (raw - previous_raw + _COUNTS // 2) % _COUNTS - _COUNTS // 2


def wrap_angle(angle_rad: float) -> float:
    """The same direction in −π … π, for publishing only: counting turns needs the angle unwrapped [rad]."""
    return math.remainder(angle_rad, math.tau)


class WheelTravel:
    """Travel of one wheel's rim since its first sample, from the raw position of its axis (6064h).

    Each sample is compared with the last one that was taken in. A step that the wheel cannot have made is a jump: it
    is dropped. If the samples after it come back, nothing was lost. If `RE_REFERENCE_SAMPLES` in a row
    stay at the new place, the counter stays there: that place becomes the new reference, the travel goes on
    from where it was, and `losses` counts it, as the travel of those samples is unknown. After such a jump no gap
    of more than `DOUBTED_CYCLES` is bridged any more: the first sample after it is a new reference as well.
    Two jumps in a row by the same way are those of a counter that wraps: `wraps_by`.
    """

    __slots__ = (
        "_accepted_cycles",
        "_accepted_raw",
        "_counts",
        "_doubted",
        "_jump_counts",
        "_max_step_counts",
        "_metres_per_count",
        "_suspect_raw",
        "_suspects",
        "losses",
        "wraps_by",
    )

    def __init__(self, metres_per_count: float, max_step_counts: float) -> None:
        """`metres_per_count`: rim travel, negative for a mirrored axis. `max_step_counts`: possible in one cycle.

        Raises ValueError for a step that is not positive or not below half the 32-bit range: it would look like a
        wrap.
        """
        if not 0.0 < max_step_counts < _COUNTS / 2:
            raise ValueError(f"max_step_counts must be above 0 and below 2^31, not {max_step_counts}")
        if not math.isfinite(metres_per_count) or metres_per_count == 0.0:
            raise ValueError(f"metres_per_count must be finite and not 0, not {metres_per_count}")
        self._metres_per_count = metres_per_count
        self._max_step_counts = max_step_counts
        self._counts = 0
        self._accepted_raw: int | None = None
        self._accepted_cycles = 0
        self._suspect_raw = 0
        self._suspects = 0
        self._doubted = False
        self.losses = 0
        """References that were lost, since start: each time the travel misses what happened meanwhile."""
        self.forget_jumps()

    def forget_jumps(self) -> None:
        """A counter that wraps shows it again."""
        self._jump_counts = self.wraps_by = 0

    @property
    def travel_m(self) -> float:
        """Rim travel since the first sample, forward positive [m]."""
        return self._counts * self._metres_per_count

    @property
    def referenced(self) -> bool:
        """A sample was taken in since the start or the last `reset_reference`, and the newest one is no jump."""
        return self._accepted_raw is not None and self._suspects == 0

    def reset_reference(self) -> None:
        """The next sample is a new offset: after a drive's power cycle or a gap in its feedback. The travel stays."""
        self.losses += self._accepted_raw is not None
        self._accepted_raw = None
        self._suspects = 0
        self._doubted = False
        self.forget_jumps()

    def update(self, raw: int, cycles: int = 1) -> float:
        """Take in a new sample; the travel after it [m]. `cycles`: control cycles since the sample before, from 1."""
        if cycles < 1:
            raise ValueError(f"a new sample is at least one cycle younger than the one before, not {cycles}")
        if self._accepted_raw is None:
            self._accept(raw)
            return self.travel_m
        self._accepted_cycles += cycles
        if self._doubted and cycles > DOUBTED_CYCLES:
            self._lose(raw)
            return self.travel_m
        stays = self._suspects > 0 and self._is_near(self._suspect_raw, raw, cycles)
        if not stays and self._is_near(self._accepted_raw, raw, self._accepted_cycles):
            self._counts += unwrap(self._accepted_raw, raw)
            self._accept(raw)
        else:
            self._suspect(raw, stays)
        return self.travel_m

    def _is_near(self, from_raw: int, raw: int, cycles: int) -> bool:
        return abs(unwrap(from_raw, raw)) <= self._max_step_counts * cycles

    def _accept(self, raw: int) -> None:
        self._accepted_raw = raw
        self._accepted_cycles = 0
        self._suspects = 0

    def _suspect(self, raw: int, stays: bool) -> None:
        self._suspects = self._suspects + 1 if stays else 1
        self._suspect_raw = raw
        if self._suspects >= RE_REFERENCE_SAMPLES:
            self._doubted = True
            self._note_jump(raw)
            self._lose(raw)

    def _note_jump(self, raw: int) -> None:
        jump_counts = unwrap(self._accepted_raw or 0, raw)
        alike = self._is_near(self._jump_counts, jump_counts, self._accepted_cycles)
        if alike and not self._is_near(0, jump_counts, 2 * self._accepted_cycles):
            self.wraps_by = abs(jump_counts)
        self._jump_counts = jump_counts

    def _lose(self, raw: int) -> None:
        self.losses += 1
        self._accept(raw)


@dataclass(frozen=True, slots=True)
class Pose2D:
    """Pose in the odom frame; `yaw_rad` is counter-clockwise and counts the turns (not wrapped)."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0


class Odometry:
    """Pose of the base by dead reckoning: between two updates each wheel keeps its speed, so the base runs an arc."""

    __slots__ = ("_error", "_last_m", "_pose", "_slips", "_track_m", "_twist")

    def __init__(self, track_m: float, settings: OdometrySettings) -> None:
        self._track_m = track_m
        self._error = PoseError(settings, track_m)
        self._last_m: tuple[float, float] | None = None
        self.reset(Pose2D())

    @property
    def pose(self) -> Pose2D:
        """Pose of the base since start or `reset`."""
        return self._pose

    @property
    def twist(self) -> Twist2D:
        """Mean velocity between the last two updates."""
        return self._twist

    def reset(self, pose: Pose2D) -> None:
        """Continue from `pose`, with the covariance of a fresh start. The wheels' travel goes on."""
        self._pose = pose
        self._twist = Twist2D.ZERO
        self._error.reset(pose.yaw_rad)
        self._slips = False

    def lose_reference(self, rolled_m: float) -> None:
        """The next update is a reference and no motion: what is rolled until then does not enter the pose.

        `rolled_m`: so far may each side have rolled meanwhile, either way; it enters the covariance.
        """
        self._last_m = None
        self._error.lose(rolled_m)

    def update(
        self, left_m: float, right_m: float, dt_s: float, left_slip_m: float = 0.0, right_slip_m: float = 0.0
    ) -> Twist2D:
        """Take in the travel of both sides since their start [m]; the mean velocity since the update before.

        `*_slip_m`: so far may that side have slipped since the update before (1 σ), from 0 [m].

        The first call, and the first after `lose_reference`, is the reference and no motion. Raises ValueError, with
        nothing changed, for a travel that is not finite and for a `dt_s` that is not positive.
        """
        if not (math.isfinite(left_m) and math.isfinite(right_m)):
            raise ValueError(f"the travel must be finite, not {left_m} m and {right_m} m")
        if not (math.isfinite(dt_s) and dt_s > 0.0):
            raise ValueError(f"the time between two updates must be positive, not {dt_s} s")
        last_left_m, last_right_m = self._last_m or (left_m, right_m)
        self._last_m = left_m, right_m
        step = base_twist(left_m - last_left_m, right_m - last_right_m, self._track_m)
        self._pose = _along_arc(self._pose, step.linear_mps, step.angular_radps)
        self._note_error(left_m - last_left_m, right_m - last_right_m, left_slip_m, right_slip_m)
        self._twist = Twist2D(step.linear_mps / dt_s, step.angular_radps / dt_s)
        return self._twist

    def pose_covariance(self) -> Covariance:
        """Of `pose`, in the odom frame, since start or `reset`: `PoseError.covariance`."""
        return self._error.covariance()

    def _note_error(self, left_m: float, right_m: float, left_slip_m: float, right_slip_m: float) -> None:
        self._error.roll(left_m, right_m, left_slip_m, right_slip_m)
        slips = left_slip_m > 0.0 or right_slip_m > 0.0
        if self._slips and not slips:
            self._error.end_slip()
        self._slips = slips


def _along_arc(pose: Pose2D, distance_m: float, turn_rad: float) -> Pose2D:
    """The end of an arc: its chord, distance × sin(turn/2) / (turn/2), points half the turn away from the start."""
    half_rad = turn_rad / 2.0
    # Next to 0 the quotient loses digits; the series 1 − x²/6 is exact to 1e-18 there.
    shortening = math.sin(half_rad) / half_rad if abs(half_rad) > _STRAIGHT_RAD else 1.0 - half_rad * half_rad / 6.0
    heading_rad = pose.yaw_rad + half_rad
    return Pose2D(
        pose.x_m + distance_m * shortening * math.cos(heading_rad),
        pose.y_m + distance_m * shortening * math.sin(heading_rad),
        pose.yaw_rad + turn_rad,
    )
