"""What a qualification runs, as plain values that any process or computer can carry out. Pure.

It is cut into batches: each has one body, and comes out the same wherever it runs. A stop has the seed
`number of the body × number of failures + place of the failure`, a scenario and a drive have seeds of their own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from canbase_campaign.twins import JOYSTICK, TWINS, Twin
from canbase_config.robot import Robot
from canbase_qualification.outcome import DRIVING, SCENARIO, STOP

A_BODY: Final = 25
"""So many scenarios in a row have one body, which boots once."""
DRIVES_S: Final = 60.0
"""One drive without a failure takes this long, of virtual time [s]."""
ORDINARY: Final = Twin("", "", lambda world, around, random: None, JOYSTICK, then_zero_s=0.01)
"""Nothing fails: the source orders zero."""
FAILURES: Final = (ORDINARY, *TWINS)
"""Each is tried once on a body."""


@dataclass(frozen=True, slots=True)
class Load:
    """What robot.yaml does not have. `payloads`: from, to, in multiples of the empty robot; `slope`: a share."""

    payloads: tuple[float, float] = (0.5, 2.0)
    slope: float = 0.03


@dataclass(frozen=True, slots=True)
class Amount:
    """How much is run. `stops`: bodies on which each single failure is tried once; `first`: the first seed."""

    scenarios: int = 1000
    stops: int = 20
    drives: int = 20
    first: int = 0


@dataclass(frozen=True, slots=True)
class Batch:
    """Runs of one kind with one body."""

    kind: str
    body: int
    seeds: tuple[int, ...]

    def without(self, done: frozenset[tuple[str, int]]) -> Batch | None:
        """What is left of it; None: nothing."""
        seeds = tuple(seed for seed in self.seeds if (self.kind, seed) not in done)
        return Batch(self.kind, self.body, seeds) if seeds else None


@dataclass(frozen=True, slots=True)
class Job:
    """`robot`: as simulated. It comes out the same in every process of this version of canbase."""

    robot: Robot
    faults: tuple[str, ...]
    """Those that scenarios are drawn from."""
    failures: tuple[int, ...]
    """Places in FAILURES: those that stop a robot of this kind."""
    load: Load
    profiles: tuple[tuple[str, str], ...] = ()
    """The user's own drive profiles: path and text."""


def batches(job: Job, amount: Amount) -> Iterator[Batch]:
    """Everything, in the order of results.jsonl."""
    first, last = amount.first, amount.first + amount.stops
    for body in range(first, last):
        yield Batch(STOP, body, tuple(body * len(FAILURES) + place for place in job.failures))
    last = first + amount.scenarios
    for body in range(first // A_BODY, (last - 1) // A_BODY + 1 if amount.scenarios else 0):
        seeds = range(max(first, body * A_BODY), min(last, (body + 1) * A_BODY))
        yield Batch(SCENARIO, body, tuple(seeds))
    for seed in range(first, first + amount.drives):
        yield Batch(DRIVING, seed, (seed,))
