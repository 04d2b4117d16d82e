"""Whether one wheel is at standstill, judged from encoder and velocity together: each alone may be noisy, or a lie.

Rules, with `standstill_mps` s and `motion_tolerance_mps` n:
1. Slow: the velocity is at most s, the encoder's last step is no faster than STEP_FACTOR times s, and since the
   velocity is so low the encoder has not gone further than s lasts for in STILL_S.
2. Still: the encoder has stayed where it is for STILL_S, and the velocity is at most n: noise.
Anything else is motion: so is a wheel of which position or velocity did not come. The driver has the same rules in code
of its own. No frames here, no judgement of the sensor: that is motion_evidence.py. But a standstill that came on less
travel than a wheel needs to stop is unproven (stopping_distance.py), until the encoder has shown it, or the wheel has
been without power long enough to have rolled out and gets power again. One that moves again before that, without
power, has never stood: its encoder comes and goes.
"""

from __future__ import annotations

import math

from canbase_config.watchdog import WatchdogConfig, WatchedDrive
from canbase_watchdog.counts import difference
from canbase_watchdog.stopping_distance import StoppingDistance

STILL_S = 0.2
STEP_FACTOR = 3.0
"""One step of the encoder may look this many times as fast as it is: samples come early and late."""
GAP_S = 0.5
"""Values that came further apart only show whether the wheel is where it was. Two motors that
are read by SDO take 0.15 s a turn."""
COUNTS = 2
"""An encoder at an edge counts to and fro."""
SELDOM_S = 0.05
"""Positions that are further apart, as those that are read by SDO, give a good mean speed: at its end the wheel had
this, less what half of the time can brake. Velocities come too seldom then."""
JUMP_FACTOR = 3.0
"""A step beyond this many times the fastest wheel's is no travel."""


class StandstillWatch:
    """Follows one axis. Speeds and travel at the rim [m/s, m]."""

    def __init__(self, drive: WatchedDrive, config: WatchdogConfig) -> None:
        """Nothing has come yet: it moves."""
        self._m_per_count = abs(drive.m_per_count)
        self._slow_mps, self._noise_mps = config.standstill_mps, config.motion_tolerance_mps
        self._grain_m = COUNTS * self._m_per_count
        self._near_m = max(config.standstill_mps * STILL_S, self._grain_m)
        self._counts: int | None = None
        self._still_m = self._slow_m = 0.0
        """How far it is from where it stayed, and from where it was when it became slow."""
        self._steady = False
        self._speed_mps = math.inf
        self.position_at = self._still_since = self._crept_at = -math.inf
        self._velocity_at = self._slow_since = -math.inf
        self._samples, self._rolls_s = config.feedback_samples, config.coasting_s
        self._jump_mps, self._period_s = JUMP_FACTOR * config.max_wheel_mps, 1.0 / config.control_hz
        self._braking_mps2 = drive.hardest_braking_mps2, config.hardest_stop_mps2
        """With power, and without."""
        self._stopping = StoppingDistance(config.motion_tolerance_mps, self._grain_m)
        self._encoder_mps, self._mean_s = 0.0, math.inf
        self._sudden, self._sudden_since = 0, -math.inf
        self._never_stood = False
        """It moved again sooner than it can have rolled out: what it showed as standstill was none."""
        self._off_since, self._was_powered = math.inf, False

    def on_position(self, counts: int, now_s: float) -> None:
        """6064h, of a TPDO or of an answer to an SDO, at the monotonic time `now_s` [s]."""
        before, elapsed_s = self._counts, now_s - self.position_at
        self._counts, self.position_at = counts, now_s
        step_m = 0.0 if before is None else difference(counts, before) * self._m_per_count
        self._note_travel(step_m, elapsed_s)
        if before is None or elapsed_s >= GAP_S:
            self._steady, self._still_since = before is not None and abs(step_m) <= self._grain_m, now_s
            self._still_m = self._slow_m = 0.0
            return
        self._steady = abs(step_m) <= max(STEP_FACTOR * self._slow_mps * elapsed_s, self._grain_m)
        self._still_m, self._slow_m = self._still_m + step_m, self._slow_m + step_m
        if abs(self._still_m) > self._near_m:
            self._still_m, self._still_since = 0.0, now_s
        if abs(self._slow_m) > self._near_m:
            if now_s - self._slow_since < STILL_S:
                self._crept_at = now_s
            self._slow_m, self._slow_since = 0.0, now_s

    def on_velocity(self, velocity_mps: float, now_s: float, powered: bool = True) -> None:
        """606Ch, of a TPDO or of an answer to an SDO; `powered`: by the last statusword."""
        if abs(velocity_mps) <= self._slow_mps < self._speed_mps:
            self._slow_m, self._slow_since, self._crept_at = 0.0, now_s, -math.inf
        self._speed_mps, self._velocity_at = abs(velocity_mps), now_s
        self._note_power(powered, now_s)
        moves = min(self._speed_mps, self._encoder_mps) > self._noise_mps
        if moves and not powered and self.unproven and now_s < self._sudden_since + self._rolls_s:
            self._never_stood = True
        hardest_mps2 = self._hardest_mps2(powered)
        at_end_mps = self._encoder_mps - hardest_mps2 * self._mean_s / 2.0
        self._mean_s = math.inf
        self._stopping.on_speed(max(min(self._speed_mps, self._encoder_mps), at_end_mps), hardest_mps2)
        self._sudden = min(self._sudden + 1, max(self._samples, 2)) if self.sudden else 0
        if self._sudden == 1:
            self._sudden_since = now_s

    def trust(self) -> None:
        """A reset was accepted: everything starts again."""
        self._stopping.forget()
        self._sudden, self._never_stood = 0, False

    @property
    def sudden(self) -> bool:
        """By its last values it is at standstill, and nothing brakes a wheel so hard."""
        return self._stopping.lacks and self.stands

    @property
    def unproven(self) -> bool:
        """The same, for as long as it takes to be no error of one sample. Answers to SDOs come seldom."""
        if self._never_stood:
            return True
        lasts = self._sudden >= 2 and self._velocity_at - self._sudden_since >= self._samples * self._period_s
        return lasts or self._sudden >= self._samples

    def _note_travel(self, step_m: float, elapsed_s: float) -> None:
        elapsed_s = max(elapsed_s, self._period_s)
        jumped = abs(step_m) > self._jump_mps * elapsed_s
        self._encoder_mps = 0.0 if jumped else abs(step_m) / elapsed_s
        self._stopping.on_travel(0.0 if jumped else step_m)
        self._mean_s = elapsed_s if SELDOM_S <= elapsed_s < GAP_S else math.inf

    def _note_power(self, powered: bool, now_s: float) -> None:
        if powered and now_s >= self._off_since + self._rolls_s:
            self.trust()
        self._off_since = math.inf if powered else min(self._off_since, now_s)

    def _hardest_mps2(self, powered: bool) -> float:
        """What brakes it may have changed since the last sample."""
        braked, rolled = self._braking_mps2
        both, self._was_powered = powered and self._was_powered, powered
        return braked if both else rolled

    @property
    def stands(self) -> bool:
        """The last values of both show it."""
        if not self._steady or not abs(self._velocity_at - self.position_at) < GAP_S:
            return False
        at = self.position_at
        slow = self._speed_mps <= self._slow_mps and at - self._crept_at >= STILL_S
        return slow or (self._speed_mps <= self._noise_mps and at - self._still_since >= STILL_S)
