"""Torque that changes with nothing ordered, while the encoder does not count (docs/decisions/0041). Pure, one wheel.

A drive changes the torque that holds a wheel because it saw the wheel move. One whose encoder did not count works
against a motion that does not exist: its velocity loop integrates an error that 606Ch need not even show. It must
release the wheel. Where it does so again before the encoder has counted, the sensor is dead. Any loss of power ends a
period, whoever caused it, and half of the limit counts: the driver releases the wheel before all of it is reached.

    holds ──the torque differs──► due: the driver releases ──differs again, no count between──► dead

What holds the wheel is the torque SETTLES_S after the last count or the last release, and never more than HELD_SHARE:
slopes take no more, and what a dead encoder winds up is not learned. One increment to and fro at an edge is no count: a
dead encoder that jitters by more is not found by this rule.
"""

from __future__ import annotations

from canbase_watchdog.counts import LIFE_COUNTS, Life

SETTLES_S = 0.1
"""A drive that holds a wheel again has found its torque after this time [s]."""
HELD_SHARE = 0.5
"""Of the rated torque, for slope and friction (docs/bus.md)."""
CHANGE_SHARE = 0.1
"""Of the rated torque: noise and rounding change it by less."""
NOISE_SHARE = 0.01
"""Of the rated torque: a motor that gives less, as beside a closed brake, moves no wheel."""
COUNTED_SHARE = 0.5
"""Of the limit: the driver releases at three quarters of it, and that counts."""
DEAD = 2
"""So many times with a release between them, and without a count."""


class UnaskedTorque:
    """Follows the torque of one wheel, as a share of the rated one."""

    def __init__(self, m_per_count: float, limit_s: float) -> None:
        """`limit_s`: the change of the torque × time that is too much, as time at rated torque."""
        self._life, self._limit_s = Life(LIFE_COUNTS * abs(m_per_count)), limit_s
        self._begin()
        self.times = 0
        """In how many periods with power it counted, since the encoder last did."""
        self._counted = False
        """In this one."""

    @property
    def is_due(self) -> bool:
        """The drive must release the wheel."""
        return self.unasked_s >= self._limit_s

    @property
    def is_dead(self) -> bool:
        """Released, and at work again without a count."""
        return self.times >= DEAD

    def trust(self) -> None:
        """A reset was accepted: everything starts again."""
        self._begin()
        self.times, self._counted = 0, False

    def release(self) -> None:
        """The drive has no power."""
        self._begin()
        self._counted = False

    def _begin(self) -> None:
        self._settles_s, self._held_share, self.unasked_s = SETTLES_S, 0.0, 0.0

    def on_step(self, step_m: float) -> None:
        """Travel of the encoder since the last sample, with or without power."""
        if self._life.on_step(step_m):
            self.trust()

    def on_torque(self, share: float | None, rests: bool, elapsed_s: float) -> None:
        """With power. `share`: None: not reported. `rests`: nothing is ordered, and it was released since it was."""
        if share is None or not rests:
            self._begin()
            return
        if self._settles_s > 0.0:
            self._settles_s -= elapsed_s
            self._held_share = max(-HELD_SHARE, min(share, HELD_SHARE))
        changed = abs(share - self._held_share)
        if abs(share) < NOISE_SHARE or changed <= CHANGE_SHARE:
            self.unasked_s = 0.0
            return
        self.unasked_s = min(self.unasked_s + changed * elapsed_s, self._limit_s)
        if self.unasked_s >= COUNTED_SHARE * self._limit_s and not self._counted:
            self.times, self._counted = self.times + 1, True
