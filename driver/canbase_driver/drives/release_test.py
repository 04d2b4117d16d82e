"""When the drives let go of wheels at standstill: each order that ends in one takes their power off once. Pure.

A dead encoder shows a stand, and its drive pushes on with the integrator of its velocity loop, with nothing ordered.
So a drive that was ordered motion, and gives torque to a wheel that shows none, loses its power as soon as zero is
ordered of all wheels, and gets it back at once: its loop starts again. A wheel that is held on a slope rolls a little
and is held again; one that friction holds does not notice (docs/decisions/0041).

The same holds where the torque changes later, with nothing ordered, and the encoder does not count: the drive works
against a motion that does not exist (docs/decisions/0041). Where the release does not end that, the watchdog trips.

    HELD ──an axis must (axis.py)──► LETTING GO ──no axis has torque──► RETURNING ──all enabled──► HELD
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Protocol

from canbase_config.robot import Robot
from canbase_driver.cia402 import DriveState, PowerGoal

LIFE_M, LIFE_COUNTS = 0.001, 2
"""Places that are nearer to each other than this may be jitter; whichever is more. Others are a sign of life."""
NOISE_SHARE = 0.01
"""Of the rated torque: less moves no wheel."""
SETTLES_S = 0.1
"""A drive that holds a wheel again has found its torque so long after the last count, or after its release [s]."""
HELD_SHARE, CHANGE_SHARE = 0.5, 0.1
"""Of the rated torque: a slope takes no more; noise changes it by less."""
LONGEST_SAMPLE_GAP_S = 0.1
"""Time between two samples counts for at most this long [s]."""
RETURN_S = 1.0
"""From the power off until all drives are enabled again; then one that is not is a failure."""


class TorqueEvidence:
    """How hard a drive pushes at a wheel that shows no motion, and whether any was ordered since its last release."""

    def __init__(self, limit_s: float, m_per_count: float) -> None:
        """`limit_s`: time at rated torque, or longer at less."""
        self._limit_s = limit_s
        self._life_m = max(LIFE_M, LIFE_COUNTS * abs(m_per_count))
        self._travel_m = self._at_m = self._low_m = self._high_m = self.pushed_s = 0.0
        """Where it is, and between which places it has been, from that of its last sign of life on."""
        self._at = math.inf
        self._release_due = self._reports_torque = False
        self._count_m, self._counted_m = LIFE_COUNTS * abs(m_per_count), 0.0
        self._unasked_s = self._held_share = 0.0
        """The change of the torque with nothing ordered, as time at rated torque; and what held the wheel before."""
        self._settles_s = SETTLES_S
        self.encoder_moves = True
        """The last sample was a sign of life of the encoder, or the drive had no torque."""
        self.share: float | None = None
        """Torque, of the rated one; None: the drive does not report it, or has only ever reported zero."""

    @property
    def must_release(self) -> bool:
        """With nothing ordered, only a release shows whether the wheel is at standstill."""
        return (self._release_due and self.pushed_s >= self._limit_s) or self._unasked_s >= self._limit_s

    def on_sample(
        self, travel_m: float, share: float | None, ordered_mps: float, has_torque: bool, now_s: float
    ) -> None:
        """Encoder and torque of one SYNC, and what an enabled drive was ordered before it."""
        elapsed_s, self._at = min(max(now_s - self._at, 0.0), LONGEST_SAMPLE_GAP_S), now_s
        self._reports_torque = self._reports_torque or bool(share)
        self.share = share if self._reports_torque else None
        torque = 1.0 if self.share is None else abs(self.share)
        given_s = torque * elapsed_s if torque >= NOISE_SHARE else 0.0
        self._at_m, self._travel_m = self._at_m + travel_m - self._travel_m, travel_m
        self._low_m, self._high_m = min(self._low_m, self._at_m), max(self._high_m, self._at_m)
        self.encoder_moves = self._high_m - self._low_m >= self._life_m or not has_torque
        if self.encoder_moves:
            self._at_m = self._low_m = self._high_m = self.pushed_s = 0.0
        else:
            self.pushed_s = min(self.pushed_s + given_s, self._limit_s)
        self._release_due = has_torque and (self._release_due or ordered_mps != 0.0)
        counts = abs(travel_m - self._counted_m) >= self._count_m
        self._counted_m = travel_m if counts else self._counted_m
        self._note_change(counts or self._release_due or not has_torque, elapsed_s)

    def _note_change(self, begins: bool, elapsed_s: float) -> None:
        """`begins`: what the torque is from now on is what holds the wheel."""
        share = self.share
        if begins or share is None:
            self._unasked_s, self._settles_s, self._held_share = 0.0, SETTLES_S, 0.0
            return
        if self._settles_s > 0.0:
            self._settles_s -= elapsed_s
            self._held_share = max(-HELD_SHARE, min(share, HELD_SHARE))
        changed = abs(share - self._held_share)
        if abs(share) < NOISE_SHARE or changed <= CHANGE_SHARE:
            self._unasked_s = 0.0
        else:
            self._unasked_s = min(self._unasked_s + changed * elapsed_s, self._limit_s)


class Wheel(Protocol):
    """What is looked at: an axis of a drive."""

    @property
    def state(self) -> DriveState | None:
        """By its last statusword."""

    @property
    def velocity_mps(self) -> float:
        """Measured."""

    @property
    def torque_evidence(self) -> TorqueEvidence:
        """Of its drive."""


class ReleasePhase(Enum):
    """See the drawing at the head of this file."""

    HELD = "held"
    RELEASING = "letting go"
    RETURNING = "returning"


class ReleaseTest:
    """All drives release together: the base keeps its heading, and none is enabled beside one that is not."""

    def __init__(self, robot: Robot) -> None:
        self._proves = robot.watchdog.stand_proof == "let_go"
        self._still_mps = robot.watchdog.motion_tolerance_mps
        self._disable_s = min(robot.watchdog.stand_answer_s, robot.timeouts.feedback_s) / 2.0
        self._phase = ReleasePhase.HELD
        self._since = -math.inf
        self._returned = True

    @property
    def active(self) -> bool:
        """Nothing is to be ordered."""
        return self._phase is not ReleasePhase.HELD

    def excuses(self, now_s: float) -> bool:
        """A drive that is not enabled is so because of this; also on the ramp of a stop that took over."""
        return not self._returned and now_s - self._since <= RETURN_S

    def end(self, ramps: bool) -> None:
        """Something else decides about the power. `ramps`: it is the ramp, on which drives that have none yet are not
        to be taken for failed ones. Once the power is off, the next that lose it have no excuse.
        """
        self._phase = ReleasePhase.HELD
        self._returned = self._returned or not ramps

    def step(self, wheels: Sequence[Wheel], rests: bool, now_s: float) -> None:
        """One cycle in which the drives are to be enabled; `rests`: zero is commanded of all wheels."""
        if self._phase is ReleasePhase.HELD and rests and self._is_due(wheels):
            self._phase, self._since, self._returned = ReleasePhase.RELEASING, now_s, False
        elif self._phase is ReleasePhase.RELEASING and all(
            wheel.state and not wheel.state.has_torque for wheel in wheels
        ):
            self._phase = ReleasePhase.RETURNING
        elif self._phase is ReleasePhase.RETURNING and all(
            wheel.state is DriveState.OPERATION_ENABLED for wheel in wheels
        ):
            self._phase, self._returned = ReleasePhase.HELD, True

    def goal(self, now_s: float) -> PowerGoal:
        """The commands to the drives: disable operation, and where that has no effect, disable voltage.

        A wheel that a threshold releases at that moment turns, and its drive brakes it first (605Ch). None may have
        power beside one without it for as long as feedback_s: for the watchdog that is a drive that has failed.
        """
        if self._phase is not ReleasePhase.RELEASING:
            return PowerGoal.ON
        return PowerGoal.RELEASE if now_s - self._since <= self._disable_s else PowerGoal.READY

    def _is_due(self, wheels: Sequence[Wheel]) -> bool:
        stand = all(abs(wheel.velocity_mps) <= self._still_mps for wheel in wheels)
        return self._proves and stand and any(wheel.torque_evidence.must_release for wheel in wheels)
