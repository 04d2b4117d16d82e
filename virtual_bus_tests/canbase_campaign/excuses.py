"""Every excuse of the judge: what no software can do, as a state of the world at one moment, never by a fault's name.

A row counts for a property while the property would not hold without it. The seconds in which that is so, and the base
moves, are counted; one use that lasts longer than its row allows is a violation. `make campaign` prints all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_campaign.fault import stays
from canbase_campaign.faults import FAULTS
from canbase_campaign.operator_faults import PEOPLE
from canbase_campaign.planned import Plan

STEP_S = 0.01
"""The judge looks so often."""
MOST_SHARE, MOST_STOP_SHARE = 0.05, 0.01
"""Of the time in motion a property is excused for less than this; one that is about the stop for less than that."""
STOPS = ("envelope", "sources", "held", "estop", "latched", "short", "rest", "pauses")
"""Properties that are about the stop."""


@dataclass(frozen=True, slots=True)
class Excuse:
    """One row. `longest_s`: of one use without a pause; infinity: the reason says why nothing ends it."""

    reason: str
    longest_s: float


EXCUSES = {
    "rolls out": Excuse(
        "no motor brakes or drives a side without power or coupling, or whose drive sees no motion: friction and slope "
        "alone slow it down, and the other side turns the base about it",
        20.0,
    ),
    "unreachable": Excuse(
        "no process has a line to a drive that turns, and it cannot stop by itself: it watches nothing, or its own "
        "quick stop closes its loop on a sensor that lies, or it is in its fault reaction and takes no controlword "
        "(CiA 402-2). Only STO stops it. A process that hangs for less than watchdog_s is there",
        math.inf,
    ),
    "second fault": Excuse(
        "two faults overlap, or have just done so: the layer that would notice the first is the one that is disturbed, "
        "and the next one has its own time",
        5.0,
    ),
    "one fault": Excuse(
        "the layer that would brake hard first is the one that is disturbed: the next one acts within its own time", 5.0
    ),
    "late states": Excuse(
        "the network holds a state back without a trace: who has the base is known so much later", 5.0
    ),
    "late frames": Excuse("the bus holds each frame back: the command and its answer come so much later", 5.0),
    "second master": Excuse(
        "somebody sends commands to the drives past all layers: each rung that they undo has its time", 5.0
    ),
    "strange hands": Excuse(
        "who commands the drives, or publishes to cmd_vel, past all layers asks no watchdog, moves them again after a "
        "stop, and makes the way longer than the free one, until that is stopped too",
        5.0,
    ),
    "deaf watchdog": Excuse(
        "it cannot keep a standing base from starting; driver and drives miss it within the time of one layer", 5.0
    ),
    "lying sensor": Excuse(
        "a drive with power cannot know the motion, or does not brake as its settings say: its wheel may turn again, "
        "and roll out, for the time that this takes to be noticed",
        10.0,
    ),
    "acts alone": Excuse(
        "one drive of several is cut off, or reached again, and turns the base until its own watch or a rung stops it",
        math.inf,
    ),
    "late ramp": Excuse("one drive of several is on its own ramp still, when those that held it have released", 1.0),
    "swing": Excuse("a loaded base swings back with the velocity loops of its drives, after the ramp has ended", 0.5),
    "no watch": Excuse(
        "a drive that watches neither heartbeats nor setpoints, or that a stranger's reset made forget them, or that "
        "does not brake, goes on turning: only STO stops it",
        math.inf,
    ),
    "unheard button": Excuse("a filter that never received the button knows of no emergency stop", math.inf),
    "sped up": Excuse(
        "behind an old scan the base became faster than there was room for when the wall came: the filter knows the "
        "world of then until it notices",
        5.0,
    ),
    "turned away": Excuse("what was ahead of a base that has turned by 20° is beside it", math.inf),
    "creeps": Excuse("where the scanner says that it sees nothing, the base may creep and so touch what is there",
                     math.inf),
    "encoder lies": Excuse(
        "position, velocity and loop hang on one encoder: a pose from it cannot be right, nor a distance", math.inf
    ),
    "counter restarted": Excuse(
        "a drive that starts again counts from another place: what its wheel rolled meanwhile is known to nobody", 1.0
    ),
    "unread": Excuse(
        "a driver without a line from a drive cannot know whether that one counts anew: it counts the "
        "loss in pose_resets, and goes on from the last pose",
        math.inf,
    ),
    "unasked": Excuse(
        "without a driver there is no SYNC and no drive reports: the driver is missed first; so is the watchdog when a "
        "stranger's setpoints move the base",
        3.0,
    ),
    "pushed": Excuse(
        "a force beyond that of the floor acts on the body: a drive yields until its loop holds against it, and "
        "without power friction alone holds",
        math.inf,
    ),
    "no motor follows": Excuse(
        "no drive follows setpoints: all brake by ramps of their own, and a turn ends when the base stands", 10.0
    ),
    "unproven standstill": Excuse(
        "a dead encoder shows standstill, and its drive may push for stand_impulse_s before the power goes off; a "
        "motor without its coupling shows nothing of the wheel, which rolls out",
        10.0,
    ),
}  # fmt: skip
"""Name → row."""

HARMLESS = PEOPLE.keys() | {"obstacle", "estop_pressed"}
"""What people do, and what stands in the way, disturbs no layer."""


class Faults:
    """Which faults of a plan hold at a moment. One that ends by nothing holds until a reset is done."""

    def __init__(self, plan: Plan, start_s: float, react_s: float) -> None:
        """`react_s`: of one layer. It has that from the moment on in which it is disturbed no more."""
        self._react_s = react_s
        self._spans = [
            (start_s + fault.start_s, start_s + fault.start_s + (math.inf if FAULTS[fault.name].end is stays
                                                                  else fault.duration_s))
            for fault in plan.faults
            if fault.name not in HARMLESS
        ]  # fmt: skip
        self.overlap_at = self._one_at = -math.inf
        """When two of them held last, or one."""

    def step(self, now_s: float) -> None:
        """To be called every step."""
        holding = sum(begin_s <= now_s < end_s for begin_s, end_s in self._spans)
        self._one_at = now_s if holding else self._one_at
        self.overlap_at = now_s if holding > 1 else self.overlap_at

    def one(self, now_s: float) -> bool:
        """One holds, or did so less than one reaction ago."""
        return now_s <= self._one_at + self._react_s

    def overlap(self, now_s: float) -> bool:
        """Two hold, or did so less than one reaction ago."""
        return now_s <= self.overlap_at + self._react_s

    def on_reset(self, now_s: float) -> None:
        """An accepted reset: the cause of each latch is over."""
        self._spans = [span for span in self._spans if now_s < span[0] or span[1] < math.inf]


class Ledger:
    """Seconds in motion, and of them those in which a property held by an excuse alone."""

    def __init__(self) -> None:
        self.moving_s = 0.0
        self.excused_s: dict[tuple[str, str], float] = {}
        """By property and row."""
        self._uses: dict[tuple[str, str], tuple[float, float]] = {}
        """Begin and newest moment of the last use."""
        self._now_s, self._moves = -math.inf, False

    def step(self, moves: bool, now_s: float) -> None:
        """The next look; `moves`: the base does."""
        self._now_s, self._moves = now_s, moves
        self.moving_s += STEP_S * moves

    @property
    def moves(self) -> bool:
        """The base does, now."""
        return self._moves

    def add(self, name: str, row: str, seconds: float) -> None:
        """A row was needed for the last `seconds` in motion, as is known only now."""
        if seconds > 0.0:
            self.excused_s[name, row] = self.excused_s.get((name, row), 0.0) + seconds

    def excuse(self, name: str, row: str) -> bool:
        """The property `name` holds by this row alone. False: for longer than the row allows."""
        key, now_s = (name, row), self._now_s
        if not self._moves:
            return True
        begin_s, last_s = self._uses.get(key, (now_s, -math.inf))
        if last_s < now_s:
            self.excused_s[key] = self.excused_s.get(key, 0.0) + STEP_S
        self._uses[key] = begin_s, _ = (now_s if last_s < now_s - 2.5 * STEP_S else begin_s), now_s
        return now_s - begin_s <= EXCUSES[row].longest_s
