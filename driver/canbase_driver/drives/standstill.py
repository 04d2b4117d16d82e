"""Whether one wheel stands, judged from encoder and velocity together, and whether they are evidence for it.

Standstill: the velocity is below base.standstill_mps and the encoder does not contradict it; or the encoder has not
moved for STILL_S, and what is left of the velocity is noise. A sensor that did not show motion that was ordered is no
evidence, nor is one that stopped on less travel than a wheel can, in a quick stop and without power: then a stand is
only assumed, when the power has been off for as long as a wheel rolls. Pure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.drive import Drive
from canbase_config.robot import Robot
from canbase_config.stopping import coasting_s, hardest_braking_mps2, hardest_stop_mps2, max_wheel_mps
from canbase_driver.drives.stopping_distance import StoppingDistance

STILL_S = 0.2
"""An encoder that did not move for this long is at standstill [s], even if the velocity is noisy."""
STEP_FACTOR = 3.0
"""One step of the encoder may look this many times as fast as it is: samples come early and late."""
SHORTEST_S = 0.005
"""Samples that come together are one cycle apart all the same: rates.control_hz is 200 at most [s]."""
COUNTS = 2.0
"""An encoder at an edge counts to and fro."""


@dataclass(frozen=True, slots=True)
class StillnessLimits:
    """Numbers of robot.yaml."""

    standstill_mps: float
    noise_mps: float
    unshown_m: float
    """So much ordered travel without any sign of motion takes the trust."""
    coasting_s: float
    braking_mps2: float
    """With power it loses no more ..."""
    rolling_mps2: float
    """... and this without."""

    @classmethod
    def of(cls, robot: Robot, drive: Drive) -> StillnessLimits:
        """Of this wheel."""
        watchdog = robot.watchdog
        rolls_s = coasting_s(watchdog.overspeed_factor * max_wheel_mps(robot))
        return cls(
            standstill_mps=robot.base.standstill_mps,
            noise_mps=watchdog.motion_tolerance_mps,
            unshown_m=watchdog.travel_tolerance_m,
            coasting_s=rolls_s,
            braking_mps2=hardest_braking_mps2(robot, drive),
            rolling_mps2=hardest_stop_mps2(robot),
        )


class Stillness:
    """Follows the samples of one wheel. Speeds and travel at the rim, forward positive [m/s, m]."""

    def __init__(self, limits: StillnessLimits, m_per_count: float) -> None:
        self._limits = limits
        self._grain_m = COUNTS * abs(m_per_count)
        self._at = self._still_since = -math.inf
        self._travel_m = self._anchor_m = self._unshown_m = 0.0
        self._off_since = math.inf
        self._quiet = self._follows = self._had_torque = False
        self._stopping = StoppingDistance(limits.noise_mps, self._grain_m)
        self._lie = ""
        """Why the sensors are no evidence, whatever they show."""
        self._sudden, self._sudden_since = "", math.inf
        """The wheel stopped within less than it can."""

    @property
    def doubt(self) -> str:
        """Why the sensors are no evidence; empty: they are."""
        return self._lie or ("" if self._follows else self._sudden)

    def unproven(self, now_s: float) -> str:
        """Why the sensors do not prove standstill, what to do about it, and how long that takes.

        Without a statusword the time has not begun: the watchdog lets the drive boot once its own wait is over.
        """
        limit_s = self._limits.coasting_s
        left_s = limit_s - now_s + self._off_since
        todo = f"; repair it, and wait until its power has been off for {limit_s:.0f} s" if self._lie else ""
        left = f"{max(math.ceil(left_s), 0)} s left" if self._off_since < math.inf else f"up to {2.0 * limit_s:.0f} s"
        return f"{self.doubt}{todo} ({left})"

    def pause(self) -> None:
        """Samples did not come for a while. What the wheel rolled meanwhile the encoder has counted."""
        self._at = self._still_since = -math.inf
        self._quiet = False

    def forget(self) -> None:
        """What was measured no longer counts, after a restart. Doubts and the time without power stay.

        A part that judged a sudden stop until then may not see it any more.
        """
        self._follows = False
        if not self._sudden:
            self._stopping.forget()
        self.pause()

    def on_power(self, has_torque: bool, now_s: float, follows: bool = False) -> None:
        """What the statusword shows; `follows`: operation enabled, where the watchdog judges a sudden stop.

        Power after a stand that was assumed: the sensors get a new trial.
        """
        if has_torque and self.doubt and self.rolled_out(now_s):
            self._lie, self._sudden, self._unshown_m = "", "", 0.0
            self._stopping.forget()
        self._follows = follows
        self._off_since = math.inf if has_torque else min(self._off_since, now_s)

    def on_sample(self, travel_m: float, velocity_mps: float, ordered_mps: float, now_s: float) -> None:
        """Encoder and velocity of one SYNC; `ordered_mps`: what an enabled drive was ordered before it, else 0."""
        limits, elapsed_s = self._limits, now_s - self._at
        first = self._at == -math.inf
        step_m = 0.0 if first else abs(travel_m - self._travel_m)
        slow_m = 0.0 if first else STEP_FACTOR * limits.standstill_mps * elapsed_s
        moved = first or abs(travel_m - self._anchor_m) > max(limits.standstill_mps * STILL_S, self._grain_m)
        if moved:
            self._anchor_m, self._still_since = travel_m, now_s
        speed_mps = abs(velocity_mps)
        slow = speed_mps <= limits.standstill_mps and step_m <= max(slow_m, self._grain_m)
        self._quiet = slow or (speed_mps <= limits.noise_mps and now_s - self._still_since >= STILL_S)
        self._travel_m, self._at = travel_m, now_s
        if not first:
            self._compare(moved and speed_mps > limits.standstill_mps, abs(ordered_mps) * elapsed_s)
        shown_mps = 0.0 if first else min(speed_mps, step_m / max(elapsed_s, SHORTEST_S))
        self._stopping.on_sample(shown_mps, travel_m, self._hardest_mps2())
        self._sudden = self._too_soon() if self._quiet and self._stopping.missing_m else ""
        self._sudden_since = min(self._sudden_since, now_s) if self._sudden else math.inf

    def _hardest_mps2(self) -> float:
        """The hardest braking since the last sample: by its drive, or without power; it may have been either."""
        had_torque, self._had_torque = self._had_torque, self._off_since == math.inf
        limits = self._limits
        return limits.braking_mps2 if had_torque and self._had_torque else limits.rolling_mps2

    def _too_soon(self) -> str:
        stopping = self._stopping
        return (
            f"shows standstill and nothing of how it braked from {stopping.least_mps:.2f} m/s: it met something hard, "
            f"or its encoder is dead; turn it by hand by {stopping.missing_m + 0.001:.3f} m, or wait until its power "
            f"has been off for {self._limits.coasting_s:.0f} s"
        )

    def is_sudden(self, lost_mps: float, elapsed_s: float) -> bool:
        """Whether a wheel that lost so much speed was braked harder than it can be, noise apart."""
        limits = self._limits
        hardest_mps2 = max(limits.braking_mps2, limits.rolling_mps2)
        return lost_mps > hardest_mps2 * elapsed_s + limits.noise_mps

    def distrust(self, why: str) -> None:
        """The sensors are no evidence: the watchdog has found them implausible, or the wheel stalls."""
        self._lie = why

    def stands(self, now_s: float) -> bool:
        """The last sample shows it, and is evidence; or nothing has driven it for longer than it rolls."""
        return self._quiet and (not self.doubt or self.rolled_out(now_s))

    def is_proven(self, now_s: float) -> bool:
        """It stands, and a wheel that stopped within less than it can has had the time to roll out, power or not."""
        return self.stands(now_s) and (not self._sudden or now_s - self._sudden_since >= self._limits.coasting_s)

    def rolled_out(self, now_s: float) -> bool:
        """Its power has been off, by its own statusword, for longer than a wheel rolls on a level floor."""
        return now_s - self._off_since >= self._limits.coasting_s

    def assumed(self, now_s: float) -> str:
        """Why its standstill is assumed and not measured; empty: it is measured, or it does not stand."""
        if not self.doubt or not self.stands(now_s):
            return ""
        return f"{self.doubt}; its power has been off for {now_s - self._off_since:.0f} s, so standstill is assumed"

    def _compare(self, moved: bool, ordered_m: float) -> None:
        if moved:
            self._unshown_m, self._lie = 0.0, ""
            return
        self._unshown_m += ordered_m
        if self._unshown_m > self._limits.unshown_m:
            self._lie = f"showed no motion for {self._unshown_m:.3f} m of ordered travel"
