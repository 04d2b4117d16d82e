"""Whether what one drive reports fits its setpoints and itself: three counts of bad samples in a row. No judgement.

The wheel follows its setpoints: it may have the speed of any setpoint of the last `drive_lag_s` and less, and after
that it falls with the configured deceleration, under "brakes hard" with the emergency deceleration. What it must have
at least is motion_evidence.py. A wheel that something held back catches up when it comes free (overshoot.py). Encoder
and velocity show the same travel, but for a small drift: a difference is forgotten over the way on which it did not
grow, and very slowly with time, so that it is found at any speed (docs/decisions/0041).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from canbase_config.watchdog import WatchdogConfig, WatchedDrive
from canbase_watchdog.counts import difference
from canbase_watchdog.envelope import Peak
from canbase_watchdog.motion_evidence import EvidenceWatch
from canbase_watchdog.overshoot import Overshoot

DRIFT_M, DRIFT_S = 0.25, 10.0
"""Differences between encoder and velocity are forgotten over this way, and within this time: noise, filters and a
scale that is a little wrong have no memory. An error of more than travel_tolerance_m / DRIFT_M is found on the way."""
JUMP_FACTOR = 3.0
"""A step of the encoder beyond this many times the fastest wheel's is a jump: it is no evidence of motion."""
JUMP_CYCLES = 2.0
JUMP_COUNTS = 2
"""... and of more increments than these, however coarse they are: a slow wheel shows one of them in one cycle."""
BUNCHED = 0.5
"""Samples after fewer periods waited while this process was late: only the sum of their times is evidence."""
SWING_SHARE, SWING_S = 0.08, 0.3
"""A loaded wheel swings beyond its setpoint with its velocity loop: by this share of the fastest one in this time."""


@dataclass(frozen=True, slots=True)
class Feedback:
    """What the last velocity sample showed. The allowed range is without tolerance [m/s]; drift in m."""

    low_mps: float = 0.0
    high_mps: float = 0.0
    outside_samples: int = 0
    """Samples in a row outside the range and its tolerance."""
    overspeed_samples: int = 0
    """Samples in a row above the greatest speed of any wheel."""
    implausible_samples: int = 0
    """Samples in a row at which encoder and velocity had drifted apart, or the encoder jumped."""
    drift_m: float = 0.0
    """Travel by velocity minus travel by encoder."""


class Plausibility:
    """Follows the setpoints and samples of one axis. Speeds at the rim, forward positive [m/s]."""

    def __init__(self, drive: WatchedDrive, config: WatchdogConfig, now_s: float) -> None:
        """Before the monotonic time `now_s` [s] the wheel may have had any setpoint within the limits."""
        self._config = config
        self._falls_mps2 = config.deceleration_mps2
        self._m_per_count = drive.m_per_count
        self._fixed_mps = config.motion_tolerance_mps + abs(drive.velocity_mps_per_bit)
        self._jump_mps = JUMP_FACTOR * config.max_wheel_mps
        self._least_jump_m = max(self._jump_mps * JUMP_CYCLES / config.control_hz, JUMP_COUNTS * abs(drive.m_per_count))
        self._fastest_mps = config.overspeed_factor * config.max_wheel_mps
        self._forward, self._backward = Peak(config.drive_lag_s), Peak(config.drive_lag_s)
        self._ahead, self._behind = Overshoot(), Overshoot()
        self._fastest, self._bunched_s = Peak(SWING_S), BUNCHED / config.control_hz
        self._gap = False
        self._target_mps = 0.0
        self._high = self._low = config.max_wheel_mps
        for peak in (self._forward, self._backward):
            peak.set(config.max_wheel_mps, now_s, now_s)
        self._at = now_s
        self._velocity_mps = 0.0
        self._counts: int | None = None
        self._counts_before: int | None = None
        self.last = Feedback()
        self.evidence = EvidenceWatch(drive, config, now_s)

    def brake(self, hard: bool) -> None:
        """Whether from now on the wheel has to follow setpoints that fall with the emergency deceleration."""
        config = self._config
        self._falls_mps2 = config.emergency_deceleration_mps2 if hard else config.deceleration_mps2

    def trust(self) -> None:
        """A reset was accepted: the differences of encoder and velocity are dropped."""
        self.last = replace(self.last, drift_m=0.0)
        self.evidence.trust()

    def on_target(self, target_mps: float, now_s: float) -> None:
        """A setpoint, which stays until the next one."""
        self._target_mps = target_mps
        self._forward.set(target_mps, now_s, math.inf)
        self._backward.set(-target_mps, now_s, math.inf)
        self._fastest.set(abs(target_mps), now_s, math.inf)

    def on_position(self, counts: int) -> None:
        """6064h of a status TPDO; the velocity of the same SYNC follows."""
        self._counts = counts

    def on_velocity(
        self, velocity_mps: float, powered: bool, enabled: bool, now_s: float, torque: float | None = None
    ) -> None:
        """606Ch of a velocity TPDO. A wheel without power may be pushed: nothing of it is bad. The drift of
        before stays, or a drive that releases after each order would never be found.

        `torque`: its 6077h, as a share of the rated one; None: not reported.
        """
        elapsed_s, self._at = now_s - self._at, now_s
        self._follow(elapsed_s, now_s)
        step_m, jumped = self._step(elapsed_s)
        drift_m = self._drift(velocity_mps, step_m, jumped, elapsed_s)
        self._judge(velocity_mps, powered, drift_m, jumped, elapsed_s, now_s)
        step_m = None if jumped else step_m
        self.evidence.on_sample(velocity_mps, step_m, powered, enabled, elapsed_s, now_s, torque)
        if self.last.implausible_samples >= self._config.feedback_samples:
            self.evidence.doubt()
        self._velocity_mps, self._counts_before = velocity_mps, self._counts

    def _judge(
        self, velocity_mps: float, powered: bool, drift_m: float, jumped: bool, elapsed_s: float, now_s: float
    ) -> None:
        if not powered:
            kept_m = self.last.drift_m * max(1.0 - elapsed_s / DRIFT_S, 0.0)
            self.last = Feedback(-self._low, self._high, drift_m=kept_m)
            return
        config, last = self._config, self.last
        swing_mps = SWING_SHARE * self._fastest.greatest(now_s)
        slack = self._fixed_mps + max(config.motion_tolerance_share * max(self._low, self._high), swing_mps)
        forward_mps, backward_mps = self._overshoots(velocity_mps, slack, elapsed_s, now_s)
        apart = jumped or abs(drift_m) > config.travel_tolerance_m
        inside = -self._low - slack - backward_mps <= velocity_mps <= self._high + slack + forward_mps
        self.last = Feedback(
            -self._low,
            self._high,
            0 if inside else last.outside_samples + 1,
            last.overspeed_samples + 1 if abs(velocity_mps) > self._fastest_mps else 0,
            last.implausible_samples + (elapsed_s >= self._bunched_s) if apart else 0,
            drift_m,
        )

    def _overshoots(self, velocity_mps: float, slack_mps: float, elapsed_s: float, now_s: float) -> tuple[float, float]:
        """By how much the wheel may be faster than its setpoints, forward and backward, since it was slower."""
        target_mps = self._target_mps
        return (
            self._ahead.on_sample(target_mps, velocity_mps, slack_mps, elapsed_s, now_s),
            self._behind.on_sample(-target_mps, -velocity_mps, slack_mps, elapsed_s, now_s),
        )

    def _follow(self, elapsed_s: float, now_s: float) -> None:
        fallen_mps = elapsed_s * self._falls_mps2
        self._high = max(self._high - fallen_mps, self._forward.greatest(now_s), 0.0)
        self._low = max(self._low - fallen_mps, self._backward.greatest(now_s), 0.0)

    def _step(self, elapsed_s: float) -> tuple[float | None, bool]:
        """Travel by the encoder since the last sample [m], and whether it jumped.

        None after a gap: what the wheel did in it was not measured. So are the samples that waited in it.
        """
        gap = elapsed_s >= self._config.feedback_timeout_s
        self._gap = gap or (self._gap and elapsed_s < self._bunched_s)
        if self._counts is None or self._counts_before is None or self._gap:
            return None, False
        step_m = difference(self._counts, self._counts_before) * self._m_per_count
        return step_m, abs(step_m) > max(self._jump_mps * elapsed_s, self._least_jump_m)

    def _drift(self, velocity_mps: float, step_m: float | None, jumped: bool, elapsed_s: float) -> float:
        """Travel by velocity minus travel by encoder [m]. A jump is no travel; without a step it starts again."""
        if step_m is None:
            return 0.0
        by_velocity_m = (velocity_mps + self._velocity_mps) / 2.0 * elapsed_s
        way_m = max(abs(by_velocity_m), 0.0 if jumped else abs(step_m))
        left = max(1.0 - way_m / DRIFT_M - elapsed_s / DRIFT_S, 0.0)
        return self.last.drift_m * left + (0.0 if jumped else by_velocity_m - step_m)
