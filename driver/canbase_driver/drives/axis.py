"""One axis at run time: its drive's last values, in SI, and the setpoint frame of the next cycle. Decides nothing."""

from __future__ import annotations

import math

from canbase_config.drive import Drive
from canbase_config.robot import Robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.pdo import (
    NodeLayout,
    joined_velocity,
    pack_setpoint,
    unpack_status,
    unpack_torque,
    unpack_velocity,
)
from canbase_driver.cia402 import VL_RAMP, Command, DriveState, PowerGoal, decode_statusword
from canbase_driver.drive_units import AxisUnits
from canbase_driver.drives.feedback_factor import FeedbackFactor
from canbase_driver.drives.release_test import TorqueEvidence
from canbase_driver.drives.stall import Stall, StallLimits
from canbase_driver.drives.standstill import Stillness, StillnessLimits
from canbase_driver.motion.limiter import Limiter
from canbase_driver.motion.odometry import WheelTravel

STEP_MARGIN = 3.0
"""An encoder step in one cycle is possible up to this many times the fastest wheel: cycles come early and late."""
LETS_GO_SHARE = 0.75
"""Of watchdog.stand_impulse_s: the watchdog counts from signs of life of its own, and must not be first."""
GAP_MAX_S = 60.0
"""A gap in the feedback counts as this long at most: what a wheel can have done in it stays far from a wrap."""


_ENABLE = Command.ENABLE_OPERATION.value


class Axis:
    """Feedback and setpoint of one wheel. Speeds are those of the rim [m/s], forward positive."""

    def __init__(self, drive: Drive, layout: NodeLayout, robot: Robot) -> None:
        self.drive = drive
        self.units = AxisUnits(drive, robot.base)
        self.statusword = 0
        self.is_left = drive.side == "left"
        self.state: DriveState | None = None
        self.has_torque = True
        """By its last statusword, or unknown."""
        self.velocity_mps = 0.0
        self.target_mps = 0.0
        self.status_at = self.velocity_at = -math.inf
        self.has_new_sample = False
        metres_per_count = self.units.position_m(1)
        step_m = STEP_MARGIN * Limiter(robot.limits, robot.base.track_m).wheel_mps / robot.rates.control_hz
        self.travel = WheelTravel(metres_per_count, max(1.0, step_m / abs(metres_per_count)))
        self.stillness = Stillness(StillnessLimits.of(robot, drive), metres_per_count)
        self.torque_evidence = TorqueEvidence(LETS_GO_SHARE * robot.watchdog.stand_impulse_s, metres_per_count)
        self.stall = Stall(StallLimits.of(robot))
        self.factor = FeedbackFactor(drive, metres_per_count)
        self.misfit_bytes: tuple[int, int] | None = None
        """Length of the last TPDO that was not understood, 0 for the status and 1 for the velocity before it."""
        self._raw_position = 0
        self._feedback_s = robot.timeouts.feedback_s
        self._layout = layout.profile.layout
        self._with_enable = VL_RAMP if layout.profile.is_vl else 0
        self._setpoint_cob_id = layout.setpoint_cob_id(drive.axis)
        self._control_hz = robot.rates.control_hz
        self._status_is_new = False
        self._known_mps, self._known_at = 0.0, -math.inf
        """How fast it was when it was lost, and when."""

    @property
    def position_rad(self) -> float:
        """Angle of the wheel since its first feedback [rad]."""
        return self.travel.travel_m / self.units.radius_m

    @property
    def losses(self) -> int:
        """How often the travel went on from a new reference: what the wheel rolled meanwhile is unknown."""
        return self.travel.losses

    @property
    def fed_at(self) -> float:
        """When the older one of its values came: 6041h with 6064h, and 606Ch, mostly come in frames of their own."""
        return min(self.status_at, self.velocity_at)

    def age_s(self, now_s: float) -> float:
        """Age of the oldest of its values [s]; infinity: not all came since the last `forget`."""
        status_at, velocity_at = self.status_at, self.velocity_at
        return now_s - (status_at if status_at < velocity_at else velocity_at)

    def stands(self, now_s: float) -> bool:
        """Fresh values are evidence that the wheel stands."""
        return self.stillness.stands(now_s) and self.age_s(now_s) <= self._feedback_s

    def is_proven_to_stand(self, now_s: float) -> bool:
        """The same, and it cannot be rolling with a dead encoder."""
        return self.stands(now_s) and self.stillness.is_proven(now_s)

    def forget(self) -> None:
        """What was received no longer counts: the drive restarted, or its bus did."""
        if self.velocity_at > -math.inf:
            self._known_mps, self._known_at = self.velocity_mps, self.velocity_at
        self.status_at = self.velocity_at = -math.inf
        self.state, self.has_torque = None, True
        self.velocity_mps = 0.0
        self.misfit_bytes = None
        self.stillness.forget()
        self.travel.reset_reference()
        self._status_is_new = self.has_new_sample = False

    def on_status(self, data: bytes, now_s: float) -> bool:
        """Take 6041h and 6064h, and 606Ch where it is behind them. False: wrong length, to be dropped and counted."""
        status = unpack_status(data, self._layout, self.drive.axis)
        if status is None:
            self.misfit_bytes = 0, len(data)
            return False
        self.statusword, counts = status
        self._raw_position = counts
        self.state = decode_statusword(self.statusword)
        gap_s = min(now_s - self.status_at, GAP_MAX_S)
        self.travel.update(counts, max(1, round(gap_s * self._control_hz)))
        self.status_at = now_s
        self._status_is_new = True
        self.has_torque = self.state is None or self.state.has_torque
        self.stillness.on_power(self.has_torque, now_s, self.state is DriveState.OPERATION_ENABLED)
        velocity = joined_velocity(data, self._layout)
        return not velocity or self.on_velocity(velocity, now_s)

    def on_velocity(self, data: bytes, now_s: float) -> bool:
        """Take 606Ch, which follows the status of the same SYNC. False: wrong length, to be dropped and counted."""
        raw = unpack_velocity(data, self._layout)
        if raw is None:
            self.misfit_bytes = 1, len(data)
            return False
        self.velocity_mps = self.units.velocity_mps(raw)
        if now_s - self.velocity_at > self._feedback_s:
            self.stillness.pause()
        self.velocity_at = now_s
        self.factor.on_sample(self._raw_position, self.velocity_mps, now_s)
        ordered_mps = self.target_mps if self.state is DriveState.OPERATION_ENABLED else 0.0
        travel_m = self.travel.travel_m
        self.stillness.on_sample(travel_m, self.velocity_mps, ordered_mps, now_s)
        torque = unpack_torque(data, self._layout)
        evidence = self.torque_evidence
        evidence.on_sample(travel_m, torque, ordered_mps, self.has_torque, now_s)
        self.stall.on_sample(self.velocity_mps, evidence.share, ordered_mps, moves=evidence.encoder_moves, now_s=now_s)
        if self.stall.is_over:
            self.stillness.distrust(self.stall.sentence)
        self.has_new_sample = self._status_is_new
        return True

    def on_speed(self, raw: int, now_s: float) -> None:
        """Take 606Ch that was read by SDO, after `forget`: how fast it is, and no evidence that it stands.

        Where nothing can have braked it so much since it was lost, its sensor is none either.
        """
        self.velocity_mps, self.velocity_at = self.units.velocity_mps(raw), now_s
        if self.stillness.is_sudden(abs(self._known_mps) - abs(self.velocity_mps), now_s - self._known_at):
            after_s = now_s - self._known_at
            self.stillness.distrust(
                f"went from {self._known_mps:.2f} to {self.velocity_mps:.2f} m/s in {after_s:.2f} s"
            )

    def has_fresh_sample(self, now_s: float) -> bool:
        """A new sample, and none from before a gap: beside a fresh one of another wheel it would turn the pose."""
        return self.has_new_sample and self.age_s(now_s) <= self._feedback_s

    def rests(self, rim_mps: float) -> bool:
        """Its last setpoint was zero bits of 60FFh, and that of `rim_mps` is: the drive sees nothing below one bit."""
        return self.target_mps == 0.0 and self.units.velocity_raw(rim_mps) == 0

    def sample_taken(self) -> None:
        """The core has taken the new sample into the odometry."""
        self._status_is_new = self.has_new_sample = False

    def setpoint(self, goal: PowerGoal, rim_mps: float, controlword: int) -> Frame:
        """The frame with 6040h and 60FFh (6042h in mode 2); the target is zero unless the goal is ON."""
        target_raw = self.units.velocity_raw(rim_mps) if goal is PowerGoal.ON else 0
        self.target_mps = rim_mps if target_raw else 0.0
        if controlword == _ENABLE:
            controlword |= self._with_enable
        return Frame(self._setpoint_cob_id, pack_setpoint(controlword, target_raw, self._layout))
