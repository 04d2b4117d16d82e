"""How hard a drive pushes at a wheel that shows no motion. It measures; policy.py decides (docs/decisions/0041).

A dead encoder shows a stand, and the integrator of the velocity loop that it left behind goes on to push with nothing
ordered. A wheel that is held on a slope, or against a threshold, looks the same on the bus. They differ when the drive
releases the wheel: the healthy wheel rolls, which its encoder shows, or its friction holds it and no torque is needed.

Rules, for a drive with power
1. Pushed: torque × time since the last sign of life, or since there was no power, bounds the speed that a dead encoder
   can hide. With nothing ordered of any wheel, a drive that was ordered motion before must release it once.
2. In vain: the torque is more than friction takes, and by as much another one than at the last sign of life, or than
   what held the wheel before motion was ordered (a hill), and more than there, whatever its direction; and nothing
   moves. Its time adds up over orders until the encoder moves, and most of it outlives the power. Of the first
   millimetres that it is ordered in one go it is time at rated torque, or longer at less: a wheel breaks loose slowly.
3. Unasked: the torque changes with nothing ordered and without a count of the encoder. The drive must release the
   wheel once more (unasked_torque.py).
A drive that does not report its torque may give the rated one: rule 1 alone. So may one that has only ever reported
zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from canbase_config.watchdog import WatchdogConfig, WatchedDrive
from canbase_watchdog.counts import Life, difference, life_m
from canbase_watchdog.motion_evidence import KEPT_SHARE, STRAIN_SHARE
from canbase_watchdog.unasked_torque import UnaskedTorque

ALIKE_SHARE = 0.05
"""Friction takes as much one way as the other."""
NOISE_SHARE = 0.01
"""Of the rated torque: less moves no wheel."""
LONGEST_STEP_S = 0.1
"""Time between two samples counts for at most this long [s]: a drive that sends nothing for longer is another cause."""


@dataclass(frozen=True, slots=True)
class TorqueEvidence:
    """The torque of a drive on a wheel that shows no motion. `share`: of the rated one; None: it is not reported."""

    share: float | None = None
    pushed_s: float = 0.0
    """Rule 1: time at rated torque that gives the same impulse."""
    release_due: bool = False
    """It was ordered motion, and has not released the wheel since."""
    overdue_s: float = 0.0
    """It has pushed enough, nothing is ordered, and it has had power for this long since then; at once where it was
    released for rule 3 before and its encoder has not counted since [s]."""
    vain_s: float = 0.0
    """Rule 2."""


class TorqueWatch:
    """Follows one axis. What is ordered counts from the SYNC that made it effective."""

    def __init__(self, drive: WatchedDrive, config: WatchdogConfig) -> None:
        self._config = config
        self._m_per_count = drive.m_per_count
        self._life = Life(life_m(drive, config))
        self._counts: int | None = None
        self._counts_before: int | None = None
        self._at = math.inf
        self._reports_torque = self._rests = False
        self._setpoint_mps = self._asked_m = 0.0
        """What was ordered while it was strained, since its last sign of life; infinity: it was released since."""
        self._unasked = UnaskedTorque(drive.m_per_count, config.stand_impulse_s)
        self._usual = 0.0
        """Torque at the last sign of life, of the rated one; or that which held the wheel when motion was ordered first
        since its last release."""
        self.last = TorqueEvidence()

    def on_sync(self, setpoint_mps: float, rests: bool) -> None:
        """The setpoint of this wheel; `rests`: those of all wheels are zero, and none moves by what it measures."""
        self._rests, self._setpoint_mps = rests, setpoint_mps
        if setpoint_mps != 0.0 and not self.last.release_due:
            self.last = replace(self.last, release_due=True)

    def on_position(self, counts: int) -> None:
        """6064h of a status TPDO; the velocity of the same SYNC follows."""
        self._counts = counts

    def trust(self) -> None:
        """A reset was accepted: everything starts again."""
        self._unasked.trust()
        self.last = TorqueEvidence()

    @property
    def contradicts_encoder(self) -> bool:
        """What the encoder reports is no evidence any more."""
        return self.overdue or self.in_vain

    @property
    def overdue(self) -> bool:
        """It had to release the wheel, and had time for it."""
        return self.last.overdue_s >= self._config.stand_answer_s

    @property
    def in_vain(self) -> bool:
        """It was pushed as long as an ordered wheel may show nothing."""
        return self.last.vain_s >= self._config.motion_missing_s

    def on_sample(self, share: float | None, powered: bool, now_s: float) -> None:
        """A velocity TPDO with the torque in it, None: none."""
        elapsed_s, self._at = min(max(now_s - self._at, 0.0), LONGEST_STEP_S), now_s
        self._reports_torque = self._reports_torque or bool(share)
        known = share if self._reports_torque else None
        step_m = self._step_m()
        encoder_moves = self._life.on_step(step_m)
        self._unasked.on_step(step_m)
        vain_s = 0.0 if encoder_moves else self.last.vain_s
        if encoder_moves:
            self._asked_m = 0.0
        if not powered:
            self._unasked.release()
            self._usual, self._asked_m = 0.0, 0.0 if encoder_moves else math.inf
            self.last = TorqueEvidence(known, vain_s=min(vain_s, KEPT_SHARE * self._config.motion_missing_s))
            return
        if encoder_moves or not self.last.release_due:
            self._usual = known or 0.0
        rests = self._rests and not self.last.release_due and self._config.stand_proof
        self._unasked.on_torque(known, rests, elapsed_s)
        self.last = self._with_power(known, elapsed_s, encoder_moves, vain_s)

    def _with_power(self, share: float | None, elapsed_s: float, encoder_moves: bool, vain_s: float) -> TorqueEvidence:
        config, release_due = self._config, self.last.release_due
        torque = 1.0 if share is None else abs(share)
        given_s = torque * elapsed_s if torque >= NOISE_SHARE else 0.0
        pushed_s = 0.0 if encoder_moves else min(self.last.pushed_s + given_s, config.stand_impulse_s)
        overdue = release_due and self._rests and config.stand_proof and pushed_s >= config.stand_impulse_s
        overdue_s = self.last.overdue_s + elapsed_s if overdue or self._unasked.is_due else 0.0
        overdue_s = config.stand_answer_s if self._unasked.is_dead else min(overdue_s, config.stand_answer_s)
        strain = min(torque, abs(share - self._usual), 1.0) if release_due and share is not None else 0.0
        if strain > STRAIN_SHARE and torque > abs(self._usual) + ALIKE_SHARE:
            self._asked_m += abs(self._setpoint_mps) * elapsed_s
            weight = strain if self._asked_m < config.motion_missing_m else 1.0
            vain_s = min(vain_s + weight * elapsed_s, config.motion_missing_s)
        return TorqueEvidence(share, pushed_s, release_due, overdue_s, vain_s)

    def _step_m(self) -> float:
        """Travel of the encoder since the last sample."""
        counts, before = self._counts, self._counts_before
        self._counts_before = counts
        if counts is None or before is None:
            return 0.0
        return difference(counts, before) * self._m_per_count
