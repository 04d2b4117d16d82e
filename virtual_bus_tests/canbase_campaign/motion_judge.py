"""Does each wheel do what was ordered? Runaway, another path than ordered, and a standstill that is none."""

from __future__ import annotations

import math
from collections import deque

from canbase_campaign.allowance import is_late
from canbase_campaign.envelope import notice_s
from canbase_campaign.excuses import Ledger
from canbase_campaign.judged_by import Bounds, lag_s, ramp_s
from canbase_campaign.shown import Shown
from canbase_campaign.world import World
from canbase_hazards.stated_times import stated_s
from canbase_sim.cia402.states import State
from canbase_velocity.twist import Twist

PATH_SHARE = 0.25
"""Beyond its bound the base may turn faster by this share of what was ordered."""
STANDS_S = 0.5


class Greatest:
    """The greatest of the values that were entered and not dropped yet; they are dropped in their order."""

    def __init__(self) -> None:
        self._numbers: deque[tuple[int, float]] = deque()
        """Only those that may still be the greatest: the values fall."""
        self._entered = self._dropped = 0

    def enter(self, value: float) -> None:
        """One more."""
        numbers = self._numbers
        while numbers and numbers[-1][1] <= value:
            numbers.pop()
        self._entered += 1
        numbers.append((self._entered, value))

    def drop(self) -> None:
        """The oldest one does not count any more."""
        self._dropped += 1
        if self._numbers[0][0] == self._dropped:
            self._numbers.popleft()

    @property
    def value(self) -> float:
        """Of all that count."""
        return self._numbers[0][1]


class MotionJudge:
    """To be called every step. Times in seconds, virtual."""

    def __init__(self, world: World, shown: Shown, ledger: Ledger) -> None:
        self._ledger = ledger
        self._world, self._half_m = world, world.robot.base.track_m / 2.0
        self._shown = shown
        robot, limits = world.robot, world.robot.limits
        self._allowed = Bounds.of(robot)
        ramp = ramp_s(limits, limits.linear_mps, limits.angular_radps) + lag_s(world.drawn.body)
        self._remembered_s = notice_s(robot) + ramp
        """An order counts for this long: the layers notice its end, and its ramp follows."""
        now_s = world.clock.now_s
        self._ordered_at: deque[float] = deque()
        self._wheel, self._left, self._right = Greatest(), Greatest(), Greatest()
        """Of these orders: the speed of a wheel, and the turn each way."""
        self.order(Twist(0.0, 0.0))
        self._fast_since = self._beside_since = self._lies_since = now_s
        self._before_mps, self._lost = 0.0, False
        self._heartbeat_s = world.robot.timeouts.drive_heartbeat_s
        self._watchdog_s = world.robot.timeouts.watchdog_s
        self._impulse_s = stated_s("dead_encoder_after_a_tap", robot)
        self._unasked_at = self._unwatched_at = -math.inf
        self.ran_away = False
        """Since the base last stood, some wheel was faster than ordered, or the base turned otherwise: `runaway` and
        `path` bound for how long. Or a wheel with a dead encoder rolls, which no drive can brake."""

    @property
    def runaway_s(self) -> float:
        """How long a wheel with power may be wrong before a layer has to have acted [s]."""
        return self._allowed.runaway_s

    def order(self, twist: Twist) -> None:
        """The filter ordered this, with a lease."""
        self._ordered_at.append(self._world.clock.now_s)
        self._wheel.enter(abs(twist.linear_mps) + abs(twist.angular_radps) * self._half_m)
        self._left.enter(twist.angular_radps)
        self._right.enter(-twist.angular_radps)

    def step(self, now_s: float, lost: bool) -> tuple[str, str]:
        """Name of the property that does not hold now and what is seen; two empty texts: everything holds.

        `lost`: no process reaches a drive that turns; one that does again has its time from there on.
        """
        self._lost = lost
        while len(self._ordered_at) > 1 and self._ordered_at[1] < now_s - self._remembered_s:
            self._ordered_at.popleft()
            for greatest in (self._wheel, self._left, self._right):
                greatest.drop()
        found = self._runaway(now_s) or self._path(now_s) or self._standstill(now_s) or ("", "")
        beyond = not math.isclose(now_s, min(self._fast_since, self._beside_since)) or self._shown.is_blind
        self.ran_away = beyond or (self.ran_away and self._shown.fastest_mps > self._allowed.stands_mps)
        return found

    def _follows(self) -> bool:
        """A drive follows its setpoints. Where all brake by ramps of their own, a turn ends when the base stands."""
        nodes = self._world.drives.bench.nodes.values()
        return any(axis.state is State.OPERATION_ENABLED for node in nodes for axis in node.axes)

    def _driven_mps(self, fastest_mps: float) -> float:
        """The faster side with a motor that drives or brakes it, where the fastest one may be that fast."""
        drives, (left, right) = self._world.drives, self._world.drives.sides
        left_mps, right_mps = abs(self._shown.left_mps), abs(self._shown.right_mps)
        if max(left_mps, right_mps) <= fastest_mps:
            return max(left_mps, right_mps)
        return max(0.0 if drives.roll(left) else left_mps, 0.0 if drives.roll(right) else right_mps)

    def _rolls_blindly(self) -> bool:
        """The wheels of a side roll, with power, as their drives see nothing of it."""
        drives = self._world.drives
        return any(any(axis.motor.powered for axis in side) and drives.roll(side) for side in drives.sides)

    def _missed_s(self, now_s: float) -> float:
        """No drive reports anything without SYNC: a driver that hangs or is dead is missed first [s]. And a driver
        alone misses its watchdog before it stops what a stranger's setpoints move."""
        world = self._world
        if not world.driver.running:
            self._unasked_at = now_s
        if not world.watchdog.running and world.intruder.setpoints_mps:
            self._unwatched_at = now_s
        unasked = self._fast_since - self._heartbeat_s <= self._unasked_at
        unwatched = self._fast_since - self._watchdog_s <= self._unwatched_at
        return max(unasked * self._heartbeat_s, unwatched * self._watchdog_s)

    def _runaway(self, now_s: float) -> tuple[str, str] | None:
        fastest_mps = self._wheel.value + self._allowed.runaway_mps
        wheel_mps = self._driven_mps(fastest_mps)
        if wheel_mps <= fastest_mps:
            rolls = self._shown.fastest_mps > fastest_mps and now_s > self._fast_since + self._allowed.runaway_s
            if not rolls or self._ledger.excuse("runaway", "rolls out"):
                self._fast_since = now_s
        if self._lost and now_s > self._fast_since and self._ledger.excuse("runaway", "unreachable"):
            self._fast_since = now_s
        over_s = now_s - self._fast_since - self._allowed.runaway_s
        if not is_late("runaway", self._ledger, over_s, [("unasked", self._missed_s(now_s))]):
            return None
        ordered = f"{self._wheel.value:.2f} m/s was the most ordered of it"
        return "runaway", f"a wheel turns at {wheel_mps:.2f} m/s, {ordered}"

    def _path(self, now_s: float) -> tuple[str, str] | None:
        """Between the slowest and the fastest turn that was ordered, zero among them, as a stop may come any time."""
        low, high = min(0.0, -self._right.value), max(0.0, self._left.value)
        turn = self._shown.angular_radps
        slack = self._allowed.path_radps + PATH_SHARE * max(-low, high)
        if low - slack <= turn <= high + slack:
            self._beside_since = now_s
        rows = {"unreachable": self._lost, "no motor follows": not self._follows(), "rolls out": self._rolls_blindly()}
        row = next((row for row, holds in rows.items() if holds), "")
        if now_s > self._beside_since and row and self._ledger.excuse("path", row):
            self._beside_since = now_s
        if now_s <= self._beside_since + self._allowed.path_s:
            return None
        return "path", f"the base turns at {turn:+.2f} rad/s, between {low:+.2f} and {high:+.2f} rad/s were ordered"

    def _unproven(self) -> bool:
        """A dead encoder shows a stand, and its drive has not given more torque yet than it may before it lets go, or
        the wheel rolls out after that. One without its motor rolls out without any encoder."""
        slower, drives = self._shown.fastest_mps < self._before_mps, self._world.drives
        self._before_mps = self._shown.fastest_mps
        rolls_out = slower and any(drives.roll(side) for side in drives.sides)
        unproven = self._shown.is_blind and self._shown.pushed_blindly_s <= self._impulse_s
        return unproven or (rolls_out and (self._shown.is_blind or self._shown.is_uncoupled))

    def _standstill(self, now_s: float) -> tuple[str, str] | None:
        driver = self._world.driver
        unproven = self._unproven()
        says = driver.running and driver.snapshot is not None and driver.snapshot.standstill
        if not says or self._shown.fastest_mps <= self._allowed.stands_mps or math.isclose(now_s, self._lies_since):
            self._lies_since = now_s
        for row, holds in (("unreachable", self._lost), ("unproven standstill", unproven)):
            if holds and now_s > self._lies_since and self._ledger.excuse("standstill", row):
                self._lies_since = now_s
        if now_s <= self._lies_since + STANDS_S:
            return None
        return "standstill", f"the driver says standstill, a wheel turns at {self._shown.fastest_mps:.2f} m/s"
