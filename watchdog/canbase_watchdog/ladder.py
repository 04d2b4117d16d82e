"""How far the watchdog goes to stop a drive: the ladder as a table, and the rule that climbs it. No frames here.

Each node has a ladder of its own: a drive that brakes well is not made to coast because another one is silent.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace


class Step(enum.IntEnum):
    """Byte 2 of the state frame."""

    NONE = 0
    QUICK_STOP = 1
    PRE_OPERATIONAL = 2
    DISABLE_VOLTAGE = 3
    HEARTBEAT_WITHHELD = 4


@dataclass(frozen=True, slots=True)
class Rung:
    """One way to stop, and how long it may take.

    `obey_s`: until the drive, by fresh feedback, is no longer enabled [s].
    `stand_s`: until its wheels stand, on top of what braking from their speed takes [s].
    """

    step: Step
    obey_s: float
    stand_s: float


RUNGS = {
    Step.QUICK_STOP: Rung(Step.QUICK_STOP, obey_s=0.15, stand_s=0.3),
    Step.PRE_OPERATIONAL: Rung(Step.PRE_OPERATIONAL, obey_s=0.15, stand_s=0.3),
    Step.DISABLE_VOLTAGE: Rung(Step.DISABLE_VOLTAGE, obey_s=0.15, stand_s=0.3),
    Step.HEARTBEAT_WITHHELD: Rung(Step.HEARTBEAT_WITHHELD, obey_s=math.inf, stand_s=math.inf),
}


@dataclass(frozen=True, slots=True)
class Look:
    """What the feedback of one node says. `seen_at`: when the oldest of its values came (monotonic, s)."""

    enabled: bool
    powered: bool
    standing: bool
    speed_mps: float
    seen_at: float
    present: bool


@dataclass(frozen=True, slots=True)
class Climb:
    """Where on the ladder one node is. `since` [s] and `speed_mps`: when and how fast it came onto this rung."""

    step: Step
    since: float
    speed_mps: float
    stopped: bool = False


def first(look: Look, now: float) -> Climb:
    """The foot of the ladder."""
    return Climb(Step.QUICK_STOP, now, look.speed_mps)


def advance(climb: Climb, look: Look, deceleration_mps2: float, now: float) -> Climb:
    """The place of a node after this look at it. Rules, the first that fits:

    1. stopped, and enabled again: next rung, somebody works against us;
    2. stopped, and moving: not stopped, same rung from the start;
    3. not enabled and standing, by feedback that came on this rung: stopped;
    4. never heard of, and not told to have power: stays, there is nothing to climb for;
    5. still enabled or unseen when `obey_s` has passed: next rung;
    6. still powered and moving, or unseen, when braking time + `stand_s` has passed: next rung;
    7. stays. A wheel that rolls without power is waited for: no rung can brake it.
    """
    if climb.stopped:
        if look.enabled:
            return _up(climb, look, now)
        return climb if look.standing else replace(first(look, now), step=climb.step)
    if not look.enabled and look.standing and look.seen_at > climb.since:
        return replace(climb, stopped=True)
    if look.present and _overdue(climb, look, deceleration_mps2, now):
        return _up(climb, look, now)
    return climb


def _overdue(climb: Climb, look: Look, deceleration_mps2: float, now: float) -> bool:
    rung = RUNGS[climb.step]
    unseen = look.seen_at <= climb.since
    if now >= climb.since + rung.obey_s and (look.enabled or unseen):
        return True
    stand_at = climb.since + rung.stand_s + climb.speed_mps / deceleration_mps2
    return now >= stand_at and look.powered and not look.standing


def _up(climb: Climb, look: Look, now: float) -> Climb:
    step = Step(min(climb.step + 1, Step.HEARTBEAT_WITHHELD))
    return Climb(step, now, look.speed_mps)
