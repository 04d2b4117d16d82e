"""How far the watchdog goes to stop a drive: the ladder as a table, and the rule that climbs it. No frames here.

Each node has a ladder of its own: a drive that brakes well is not made to coast because another one is lost.
Quick stop and pre-operational leave the braking to the drive's velocity loop. Where that loop does not brake, or its
sensor cannot be trusted, only the power can go: then the rungs between are left out. The last rung makes the drive
restart; it is for a drive that reports itself that it kept its power, and for no other (docs/decisions/0023).
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace

from canbase_config.watchdog import WatchdogConfig


class Step(enum.IntEnum):
    """Byte 2 of the state frame."""

    NONE = 0
    QUICK_STOP = 1
    PRE_OPERATIONAL = 2
    DISABLE_VOLTAGE = 3
    HEARTBEAT_WITHHELD = 4
    RESET_NODE = 5


@dataclass(frozen=True, slots=True)
class Rung:
    """One way to stop. `obey_s`: until the drive, by fresh feedback, has done what this rung orders [s].

    Where a node has several axes, that are read one after the other, it may take READINGS turns of all of them.
    """

    step: Step
    obey_s: float


RUNGS = {
    Step.QUICK_STOP: Rung(Step.QUICK_STOP, obey_s=0.15),
    Step.PRE_OPERATIONAL: Rung(Step.PRE_OPERATIONAL, obey_s=0.15),
    Step.DISABLE_VOLTAGE: Rung(Step.DISABLE_VOLTAGE, obey_s=0.1),
    Step.HEARTBEAT_WITHHELD: Rung(Step.HEARTBEAT_WITHHELD, obey_s=0.1),
    Step.RESET_NODE: Rung(Step.RESET_NODE, obey_s=math.inf),
}


READINGS = 2.0
"""One reading may be lost."""
HELD_S = 0.2
"""A drive that holds a wheel at standstill has this long to switch off, by 605Ah or by the driver's order [s]."""


@dataclass(frozen=True, slots=True)
class Braking:
    """What a wheel under power that is ordered to stop may do at most, and one without power. From robot.yaml."""

    lag_s: float
    """It may keep its speed for this long [s]."""
    least_mps2: float
    """Then it loses at least this."""
    tolerance_mps: float
    tolerance_share: float
    coasting_s: float
    """A wheel without power has rolled out after this, whatever its sensor reports."""
    samples: int
    """This many in a row must show that it does not brake: one may be an outlier."""

    @classmethod
    def of(cls, config: WatchdogConfig) -> Braking:
        """The numbers of this robot."""
        return cls(
            lag_s=config.drive_lag_s,
            least_mps2=config.braking_mps2,
            tolerance_mps=config.motion_tolerance_mps,
            tolerance_share=config.motion_tolerance_share,
            coasting_s=config.coasting_s,
            samples=config.braking_samples,
        )

    def allowed_mps(self, from_mps: float, elapsed_s: float) -> float:
        """The speed that is left at most when it began at `from_mps`, `elapsed_s` ago."""
        begin_mps = from_mps * (1.0 + self.tolerance_share) + self.tolerance_mps
        return begin_mps - self.least_mps2 * max(0.0, elapsed_s - self.lag_s)


@dataclass(frozen=True, slots=True)
class NodeFeedback:
    """The feedback of one node. `seen_at`: when the oldest of its values came (monotonic, s).

    `begin_mps`: the speed from which it may begin to brake, which its last setpoint may have raised within the lag.
    `trusted`: its sensors were not found faulty. `reading_s`: the time to read all its axes by SDO.
    """

    enabled: bool
    powered: bool
    standing: bool
    speed_mps: float
    begin_mps: float
    seen_at: float
    present: bool
    trusted: bool
    reading_s: float
    unslowed: bool = False
    """A wheel with power has not lost speed for a window of time, on this rung: slowing.py."""


@dataclass(frozen=True, slots=True)
class LadderPosition:
    """Where on the ladder one node is. `since` [s] and `begin_mps`: when and how fast it came onto this rung."""

    step: Step
    since: float
    begin_mps: float
    stopped: bool = False
    stopped_at: float = math.inf
    assumed: bool = False
    """Stopped without evidence: its power is off for longer than a wheel rolls."""
    runaway: bool = False
    """It was seen not to brake: the relay opens."""
    too_fast_samples: int = 0
    """Samples in a row that were faster than braking allows."""
    sampled_at: float = -math.inf
    off_since: float = math.inf
    """Since when its feedback shows that it has no power; infinity: it does not."""

    @property
    def defied(self) -> bool:
        """It has shown that it does not brake, or that it keeps its power: nothing but a relay is left."""
        return self.runaway or self.step is Step.RESET_NODE


def first(feedback: NodeFeedback, now_s: float) -> LadderPosition:
    """The foot of the ladder."""
    return LadderPosition(Step.QUICK_STOP, now_s, feedback.begin_mps)


def advance(before: LadderPosition, feedback: NodeFeedback, braking: Braking, now_s: float) -> LadderPosition:
    """The place of a node after this look at it. Rules, the first that fits:

    1. stopped, and enabled again: next rung, somebody works against us; but no reset before the power was ordered off;
    2. stopped, and moving, or its sensor is found faulty after that: not stopped, same rung from the start, or the
       one before the reset. How long its power is off goes on counting: a look without evidence drives no wheel. With
       power for HELD_S: power off, or the next rung, for what holds a wheel by a sensor that stays may drive it;
    3. not enabled and standing, by feedback that came on this rung: stopped. Where the sensor cannot be trusted, its
       power must be off as well, for as long as a wheel may roll: then a stand is assumed;
    4. no frame ever, and not known to have power: stays, there is nothing to climb for;
    5. a sensor that cannot be trusted: power off at once, for quick stop closes its loop on that sensor;
    6. powered and faster than braking allows, `samples` in a row, or not slower than a moment ago: power off at once,
       or the next rung; the relay opens;
    7. what the rung orders is not done, or not seen, within `obey_s`: next rung. The last one only for a drive that was
       seen to have power on the rung before: one that sends nothing may be off, and a reset makes it forget 1016h;
    8. stays. A wheel that rolls without power is waited for: no rung can brake it.
    """
    position = _judged(before, feedback, braking, now_s)
    if position.stopped:
        return _stopped(position, feedback, now_s)
    if feedback.standing and feedback.seen_at > position.since and _holds(position, feedback, braking, now_s):
        return replace(position, stopped=True, stopped_at=now_s, assumed=not feedback.trusted)
    if not feedback.present:
        return position
    if not feedback.trusted and position.step < Step.DISABLE_VOLTAGE:
        return _to(Step.DISABLE_VOLTAGE, position, feedback, now_s)
    if position.too_fast_samples >= braking.samples or feedback.unslowed:
        return replace(_to(max(position.step + 1, Step.DISABLE_VOLTAGE), position, feedback, now_s), runaway=True)
    return _up(position, feedback, now_s) if _disobeys(position, feedback, now_s) else position


def _stopped(position: LadderPosition, feedback: NodeFeedback, now_s: float) -> LadderPosition:
    if feedback.enabled:
        return _to(min(position.step + 1, Step.HEARTBEAT_WITHHELD), position, feedback, now_s)
    if not feedback.standing or not (feedback.trusted or position.assumed):
        step = min(position.step, Step.HEARTBEAT_WITHHELD)
        return replace(first(feedback, now_s), step=step, runaway=position.runaway, off_since=position.off_since)
    if not feedback.powered or now_s < position.stopped_at + HELD_S:
        return position
    return _to(min(max(position.step + 1, Step.DISABLE_VOLTAGE), Step.HEARTBEAT_WITHHELD), position, feedback, now_s)


def _judged(position: LadderPosition, feedback: NodeFeedback, braking: Braking, now_s: float) -> LadderPosition:
    """Count this look's sample, if it is a new one that came on this rung, and note since when the power is off."""
    if feedback.seen_at <= max(position.since, position.sampled_at):
        return position
    too_fast = feedback.speed_mps > max(0.0, braking.allowed_mps(position.begin_mps, feedback.seen_at - position.since))
    samples = position.too_fast_samples + 1 if feedback.powered and too_fast and not feedback.standing else 0
    off_since = math.inf if feedback.powered else min(position.off_since, now_s)
    since, stopped_at, seen_at = position.since, position.stopped_at, feedback.seen_at
    step, begin_mps, stopped = position.step, position.begin_mps, position.stopped
    return LadderPosition(
        step, since, begin_mps, stopped, stopped_at, position.assumed, position.runaway, samples, seen_at, off_since
    )


def _holds(position: LadderPosition, feedback: NodeFeedback, braking: Braking, now_s: float) -> bool:
    """Nothing drives it, and the sign of its standstill is evidence, or needs none any more."""
    return not feedback.enabled if feedback.trusted else now_s >= position.off_since + braking.coasting_s


def _disobeys(position: LadderPosition, feedback: NodeFeedback, now_s: float) -> bool:
    obey_s = max(RUNGS[position.step].obey_s, READINGS * feedback.reading_s)
    if position.step is Step.HEARTBEAT_WITHHELD:
        return feedback.powered and feedback.seen_at > position.since and now_s >= position.since + obey_s
    if now_s >= max(position.since, feedback.seen_at) + obey_s:
        return True
    asked = feedback.powered if position.step >= Step.DISABLE_VOLTAGE else feedback.enabled
    return asked and now_s >= position.since + obey_s


def _up(position: LadderPosition, feedback: NodeFeedback, now_s: float) -> LadderPosition:
    return _to(position.step + 1, position, feedback, now_s)


def _to(step: int, position: LadderPosition, feedback: NodeFeedback, now_s: float) -> LadderPosition:
    """The last rung is the end: there it stays as it is. No rung gives power to a wheel that has none."""
    if position.step is Step.RESET_NODE and not position.stopped:
        return position
    off_since = math.inf if feedback.powered else position.off_since
    return LadderPosition(
        Step(min(step, Step.RESET_NODE)), now_s, feedback.begin_mps, runaway=position.runaway, off_since=off_since
    )
