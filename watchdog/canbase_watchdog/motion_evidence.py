"""Whether a wheel shows the motion that it is ordered: the lower bounds of motion. It measures; policy.py decides.

Rules, 1 and 5 for an enabled drive and the setpoint that a SYNC made effective, the others for one with power: a wheel
that is being stopped can lose its sensor as well (docs/decisions/0041)
1. Unseen: ordered to move, and the encoder has not moved: net, from one place to another, for an encoder that jitters
   moves nothing. The ordered travel adds up until it moves, however slow the order is; a setpoint of zero adds nothing
   and forgets nothing, so short orders add up too, and most of it outlives the power. The time adds up while an order
   is older than `drive_lag_s`, once it ordered the travel that a sign of life takes: a slow wheel needs its time for
   that. Once enough travel was ordered it adds up without such an order too: a wheel runs away after its order; but
   not while nothing is ordered of any wheel and none moves: then its drive has to release it (torque_evidence.py).
   But a wheel that was held, and comes free as its order goes through zero, has nothing to show until the new order
   ordered it: the loop's integral has to turn round, against its friction. So each direction counts apart, and
   orders to and fro have BOTH_WAYS times the travel in all; the first turn has no time until it ordered motion.
   And a slow order may need long until its drive has got over the friction: where that reports no motion, and no more
   torque than friction takes, the time counts as time at rated torque, which bounds the speed that a dead encoder
   hides.
2. Halted: the velocity of a wheel that rolled drops at once to standstill, as no wheel can, whatever is ordered, and
   the encoder does not move from then on.
3. Jolts: velocities that change as no wheel can, again and again.
4. Ghost: the velocity shows that the wheel turns, one way, and the encoder does not move (ghost.py).
5. Behind: slower than the least that the setpoints of the last `drive_lag_s` order, reached by `slowest_ramp_mps2`.
   It adds up while the wheel is too slow, and goes down as fast while it is not.
6. Strained: its drive gives all its torque, and the wheel is slower than ordered and gets no faster: an encoder that
   cannot show the speed (it loses counts) makes its drive push without end, however near to the order it is.
A sensor that did one of 1 to 4 or 6, or contradicts itself, is not trusted until a reset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from canbase_config.watchdog import WatchdogConfig, WatchedDrive
from canbase_watchdog.counts import Life, life_m
from canbase_watchdog.envelope import Peak
from canbase_watchdog.ghost import NO_GHOST, Ghost, GhostWatch

UNSEEN_COUNTS = 4
"""With a coarse encoder nothing is missed before this many increments were ordered."""
KEPT_SHARE = 0.875
"""So much of the time that is allowed without a sign of life, and of the travel of one direction, is remembered while
there is no power. Not all: a wheel that gets power again needs an order before it can show anything. Of both directions
all of the travel is: orders of less than what would be left were never found."""
STRAIN_SHARE = 0.5
"""Of the rated torque: friction takes less, and from one direction to the other changes it by less."""
LEAST_WEIGHT = 0.25
"""A wheel that cannot turn, and takes no torque for it, is found all the same."""
SLOW_SLACKS = 2.0
"""An order of less than this many times the error of a velocity is a slow one: its drive winds up torque slowly."""
STRAINED_SHARE, NEARER_S = 0.9, 0.1
"""Of the rated torque: a drive gives all that it has for long; after this time without a gain it is strained [s]."""
BOTH_WAYS = 2.0
"""Of what one direction may lack."""
ROLLING_SHARE = 0.5
"""An encoder that moved by more than this share of the travel by velocity: the wheel really rolled."""
VELOCITY_JUMP_MEMORY_S = 1.0


@dataclass(frozen=True, slots=True)
class Evidence:
    """The evidence against a wheel. `ordered_mps`: the least that its setpoints order, `setpoint_mps` the last one."""

    ordered_mps: float = 0.0
    setpoint_mps: float = 0.0
    unseen_s: float = 0.0
    unseen_m: float = 0.0
    """Since the order last went through zero."""
    both_s: float = 0.0
    both_m: float = 0.0
    """Of both directions, the time since they ordered as much as one may lack."""
    unseen: bool = False
    """Time and travel are beyond what is allowed, of one direction or of both: rule 1."""
    halted_samples: int = 0
    """Samples in a row without any motion after a drop that no wheel can do: rule 2."""
    velocity_jumps: int = 0
    """Changes of the velocity that no wheel can do, each within VELOCITY_JUMP_MEMORY_S of the last one: rule 3."""
    ghost: Ghost = NO_GHOST
    """Rule 4."""
    behind_s: float = 0.0
    """Rule 5."""
    strained_s: float = 0.0
    """Rule 6, without a gain since NEARER_S."""
    trusted: bool = True


class EvidenceWatch:
    """Follows one axis. Speeds at the rim, forward positive [m/s]."""

    def __init__(self, drive: WatchedDrive, config: WatchdogConfig, now_s: float) -> None:
        """Before the monotonic time `now_s` [s] nothing was ordered."""
        self._config = config
        count_m = abs(drive.m_per_count)
        self._unseen_m = max(config.motion_missing_m, UNSEEN_COUNTS * count_m)
        self._life_m = life_m(drive, config)
        self._life = Life(self._life_m)
        self._slack_mps = config.motion_tolerance_mps + abs(drive.velocity_mps_per_bit)
        self._ghost = GhostWatch(drive, config, now_s)
        self._period_s = 1.0 / config.control_hz
        self._backward, self._forward = Peak(config.drive_lag_s), Peak(config.drive_lag_s)
        self._setpoint_mps = self._ordered_mps = 0.0
        self._least_mps = self._velocity_mps = self._direction = 0.0
        self._fine_mps = config.standstill_mps + abs(drive.velocity_mps_per_bit)
        self._lacked_mps, self._worst_mps, self._nearer_at = math.inf, 0.0, now_s
        """How much slower than ordered a strained wheel was when it last came nearer to its order, at most since then,
        and when that was. Nearer is than ever, or clearly than after something had held it."""
        self._rolled = self._rests = False
        self._turns = 0
        self._jumped_at = -math.inf
        self.last = Evidence()

    def on_sync(self, rests: bool) -> None:
        """After the setpoints: `rests`: those of all wheels are zero, and none moves by what it measures."""
        self._rests = rests and self._config.stand_proof

    def on_setpoint(self, setpoint_mps: float, now_s: float) -> None:
        """A SYNC made it effective."""
        self._setpoint_mps = setpoint_mps
        self._forward.set(setpoint_mps, now_s, math.inf)
        self._backward.set(-setpoint_mps, now_s, math.inf)

    def trust(self) -> None:
        """A reset was accepted: everything starts again."""
        self._life.begin()
        self._ghost.trust()
        self.last = Evidence()

    def doubt(self) -> None:
        """The sensor contradicts itself."""
        self.last = replace(self.last, trusted=False)

    def on_sample(
        self,
        velocity_mps: float,
        step_m: float | None,
        powered: bool,
        enabled: bool,
        elapsed_s: float,
        now_s: float,
        torque: float | None = None,
    ) -> None:
        """606Ch, and the travel of the encoder since the last sample; None: it is not known, or a jump.

        `torque`: 6077h as a share of the rated torque, None: the drive does not report it.
        """
        jumped, rolled = self._is_velocity_jump(velocity_mps, elapsed_s), self._rolled
        moves = self._encoder_moves(step_m, jumped)
        self._velocity_mps = velocity_mps
        self._rolled = step_m is not None and abs(step_m) > ROLLING_SHARE * abs(velocity_mps) * elapsed_s
        self._update_ordered(elapsed_s, now_s, enabled)
        ghost = self._ghost.on_sample(velocity_mps, step_m, powered, elapsed_s, now_s)
        strained_s = self._strained_s(velocity_mps, torque if powered and enabled else None, elapsed_s, now_s)
        if not powered:
            self.last = self._kept(moves, ghost)
            return
        before = self._unseen(moves, step_m is not None, elapsed_s, torque) if enabled else self._kept(moves, ghost)
        halted, jumps = self._halted(jumped and rolled, moves), self._velocity_jumps(jumped, now_s)
        samples, unseen = self._config.feedback_samples, self._is_unseen(before)
        strained = strained_s >= self._config.motion_missing_s
        lies = unseen or ghost.is_one or strained or halted >= samples or jumps >= self._config.jolts
        self.last = Evidence(
            self._ordered_mps,
            self._setpoint_mps,
            before.unseen_s,
            before.unseen_m,
            before.both_s,
            before.both_m,
            unseen,
            halted,
            jumps,
            ghost,
            self._behind_s(velocity_mps, elapsed_s) if enabled else 0.0,
            strained_s,
            self.last.trusted and not lies,
        )

    def _is_visible(self, ordered_mps: float) -> bool:
        """Slower than `standstill_mps` nothing has to be seen in time: many drives cannot turn so slowly."""
        return abs(ordered_mps) > self._config.standstill_mps

    def _is_velocity_jump(self, velocity_mps: float, elapsed_s: float) -> bool:
        """Samples that were received at once are one cycle apart all the same."""
        possible_mps = self._config.jolt_mps2 * max(elapsed_s, self._period_s) + self._slack_mps
        return abs(velocity_mps - self._velocity_mps) > possible_mps

    def _encoder_moves(self, step_m: float | None, jumped: bool) -> bool:
        """The encoder has moved since it last did. What it did until a velocity jump was before it."""
        encoder_moves = self._life.on_step(step_m or 0.0)
        if jumped:
            self._life.begin()
        return encoder_moves

    def _unseen(self, encoder_moves: bool, known: bool, elapsed_s: float, torque: float | None) -> Evidence:
        """What rule 1 counts."""
        last, trusted = self.last, self.last.trusted
        if encoder_moves:
            self._direction, self._turns = 0.0, 0
            return Evidence(trusted=trusted)
        if not known:
            return Evidence(
                unseen_s=last.unseen_s, unseen_m=last.unseen_m, both_s=last.both_s, both_m=last.both_m, trusted=trusted
            )
        turned = self._setpoint_mps * self._direction < 0.0
        self._direction = self._setpoint_mps or self._direction
        self._turns = min(self._turns + turned, 2)
        step_m = abs(self._setpoint_mps) * elapsed_s
        unseen_m = step_m + (0.0 if turned else last.unseen_m)
        both_m = step_m + last.both_m
        step_s = 0.0 if self._rests else elapsed_s * self._weight(torque, unseen_m)
        asked = unseen_m >= self._unseen_m or (self._is_visible(self._least_mps) and unseen_m >= self._life_m)
        turns_round = self._turns == 1 and unseen_m < self._life_m
        return Evidence(
            unseen_s=(step_s if asked else 0.0) + (0.0 if turned else last.unseen_s),
            unseen_m=unseen_m,
            both_s=last.both_s + (step_s if both_m >= self._unseen_m and not turns_round else 0.0),
            both_m=both_m,
            trusted=trusted,
        )

    def _is_unseen(self, counted: Evidence) -> bool:
        least_s, least_m = self._config.motion_missing_s, self._unseen_m
        one_way = counted.unseen_s >= least_s and counted.unseen_m >= least_m
        return one_way or (counted.both_s >= least_s and counted.both_m >= BOTH_WAYS * least_m)

    def _weight(self, torque: float | None, unseen_m: float) -> float:
        """Of a moment: less for a wheel that is ordered to move slowly, and has not begun to or just begins.

        `unseen_m`: ordered this way. Where the drive reports no torque, it is less only while the wheel begins to roll.
        """
        fast = abs(self._least_mps) > SLOW_SLACKS * self._slack_mps
        turns = self._is_visible(self._velocity_mps)
        if fast or (turns and not self._rolled):
            return 1.0
        if torque is None:
            begins = turns and self._setpoint_mps * self._velocity_mps > 0.0 and unseen_m < self._unseen_m
            return LEAST_WEIGHT if begins else 1.0
        return 1.0 if abs(torque) > STRAIN_SHARE else max(abs(torque), LEAST_WEIGHT)

    def _kept(self, encoder_moves: bool, ghost: Ghost) -> Evidence:
        """What outlives a time without power: most of it, or a drive that releases after each order is never found."""
        last = Evidence(trusted=self.last.trusted) if encoder_moves else self.last
        return Evidence(
            unseen_m=min(last.both_m, KEPT_SHARE * self._unseen_m),
            both_s=min(last.both_s, KEPT_SHARE * self._config.motion_missing_s),
            both_m=min(last.both_m, BOTH_WAYS * self._unseen_m),
            velocity_jumps=self.last.velocity_jumps,
            ghost=replace(ghost, is_one=False),
            trusted=last.trusted,
        )

    def _halted(self, halts: bool, encoder_moves: bool) -> int:
        if self._is_visible(self._velocity_mps):
            return 0
        if halts:
            return 1
        return self.last.halted_samples + 1 if self.last.halted_samples and not encoder_moves else 0

    def _velocity_jumps(self, jumped: bool, now_s: float) -> int:
        before = self.last.velocity_jumps if now_s < self._jumped_at + VELOCITY_JUMP_MEMORY_S else 0
        if jumped:
            self._jumped_at = now_s
        return before + jumped

    def _update_ordered(self, elapsed_s: float, now_s: float, enabled: bool) -> None:
        """The least that the setpoints of the lag order, and how far the slowest ramp has got to it from standstill.

        A wheel that still turns the other way has not begun: how fast that ends is the upper bound's, plausibility.py.
        """
        backward_mps, forward_mps = -self._backward.greatest(now_s), self._forward.greatest(now_s)
        self._least_mps = max(backward_mps, 0.0) + min(forward_mps, 0.0)
        other_way = self._velocity_mps * self._least_mps < 0.0 and abs(self._velocity_mps) > self._slack_mps
        gain_mps = self._config.slowest_ramp_mps2 * elapsed_s
        if not enabled or other_way or self._least_mps == 0.0:
            self._ordered_mps = 0.0
        elif self._least_mps > 0.0:
            self._ordered_mps = min(self._least_mps, max(self._ordered_mps, 0.0) + gain_mps)
        else:
            self._ordered_mps = max(self._least_mps, min(self._ordered_mps, 0.0) - gain_mps)

    def _behind_s(self, velocity_mps: float, elapsed_s: float) -> float:
        ordered_mps = self._ordered_mps
        least_mps = abs(ordered_mps) * (1.0 - self._config.slow_wheel_share) - self._slack_mps
        behind = ordered_mps != 0.0 and math.copysign(1.0, ordered_mps) * velocity_mps < least_mps
        return max(0.0, self.last.behind_s + (elapsed_s if behind else -elapsed_s))

    def _strained_s(self, velocity_mps: float, torque: float | None, elapsed_s: float, now_s: float) -> float:
        least_mps = self._least_mps
        lacks_mps = abs(least_mps) - math.copysign(1.0, least_mps) * velocity_mps if least_mps else 0.0
        strained = torque is not None and abs(torque) >= STRAINED_SHARE and lacks_mps > self._fine_mps
        self._worst_mps = max(self._worst_mps, lacks_mps)
        nearer = lacks_mps < self._lacked_mps - self._fine_mps or lacks_mps < self._worst_mps - self._slack_mps
        if not strained or nearer:
            self._lacked_mps, self._worst_mps, self._nearer_at = (lacks_mps if strained else math.inf), lacks_mps, now_s
        held = now_s > self._nearer_at + NEARER_S
        return self.last.strained_s + elapsed_s if held else 0.0
