"""Whether the base is at standstill after the order: by odometry, else by the driver's status, else by waiting.

Odometry whose velocity is no more than noise shows no motion where its pose does not move and the driver's status
reports standstill. A sample counts only when it was received after the order had time to reach the wheels: what stood
before a motion began proves nothing about its end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from canbase_action_server.inputs import Inputs, Odometry

HOLD_S = 0.1
"""The base must be seen standing for this long."""
STILL_S = 0.2
"""A pose that did not move for this long shows standstill, even if the velocity is noisy."""
SETTLE_S = 0.15
"""From the order to stand until it must show at the wheels."""
BRAKING_RESERVE_S = 0.5
"""Added to the time that braking takes when nothing can be measured."""


class StandstillVerdict(Enum):
    """What is known about the base now."""

    WAIT = "not known to be at standstill yet"
    STANDS = "at standstill"
    HANDED_OVER = "belongs to another source now, and may be moving"
    NOT_MEASURED = "had time to stop, but nothing confirms that it did"
    STILL_MOVES = "is not known to be at standstill after the time in which it must stop"


@dataclass(frozen=True, slots=True)
class StandstillLimits:
    """Numbers of robot.yaml that the judgement needs."""

    linear_mps: float
    angular_radps: float
    noise_mps: float
    noise_radps: float
    odometry_timeout_s: float
    driver_timeout_s: float
    """An older motor_driver/status is no evidence of standstill."""
    deceleration_mps2: float
    give_up_s: float


class Standstill:
    """Watches one stop, ordered at `began` from a speed of `speed_mps`."""

    def __init__(self, limits: StandstillLimits, began: float, speed_mps: float) -> None:
        self._limits = limits
        self._counts_from = began + SETTLE_S
        self._give_up = began + limits.give_up_s
        self._braked = self._counts_from + abs(speed_mps) / limits.deceleration_mps2 + BRAKING_RESERVE_S
        self._standing_since: float | None = None
        self._anchor: Odometry | None = None
        """Where the pose has not moved since."""

    def judge(self, inputs: Inputs, now_s: float) -> StandstillVerdict:
        """Call once per control cycle."""
        odometry = inputs.odometry.within(self._limits.odometry_timeout_s, now_s)
        driver = inputs.driver.within(self._limits.driver_timeout_s, now_s)
        reported = driver is not None and driver.standstill and inputs.driver.received_at_s >= self._counts_from
        if odometry is not None:
            still = self._is_still(odometry) and reported
            return self._or_give_up(self._seen_standing(odometry) or still, now_s)
        self._standing_since = self._anchor = None
        if driver is not None:
            return self._or_give_up(reported, now_s)
        return StandstillVerdict.NOT_MEASURED if now_s >= self._braked else StandstillVerdict.WAIT

    def _seen_standing(self, odometry: Odometry) -> bool:
        limits = self._limits
        if abs(odometry.linear_mps) > limits.linear_mps or abs(odometry.angular_radps) > limits.angular_radps:
            self._standing_since = None
            return False
        if odometry.received < self._counts_from:
            return False
        if self._standing_since is None:
            self._standing_since = odometry.received
        return odometry.received - self._standing_since >= HOLD_S

    def _is_still(self, odometry: Odometry) -> bool:
        """Its velocity is noise, by the pose, which comes from the encoders."""
        limits, anchor = self._limits, self._anchor or odometry
        moved_m = math.hypot(odometry.pose.x_m - anchor.pose.x_m, odometry.pose.y_m - anchor.pose.y_m)
        turned_rad = abs(math.remainder(odometry.pose.yaw_rad - anchor.pose.yaw_rad, math.tau))
        moves = moved_m > limits.linear_mps * STILL_S or turned_rad > limits.angular_radps * STILL_S
        self._anchor = odometry if moves or odometry.received < self._counts_from else anchor
        quiet = abs(odometry.linear_mps) <= limits.noise_mps and abs(odometry.angular_radps) <= limits.noise_radps
        return quiet and odometry.received - self._anchor.received >= STILL_S

    def _or_give_up(self, stands: bool, now_s: float) -> StandstillVerdict:
        if stands:
            return StandstillVerdict.STANDS
        return StandstillVerdict.STILL_MOVES if now_s >= self._give_up else StandstillVerdict.WAIT
