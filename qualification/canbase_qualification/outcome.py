"""What one run came to, and its line in results.jsonl. Pure; times in s, lengths in m.

Three kinds of runs: a *stop* is one failure of a base that drives steadily, measured until it stands; a *scenario* has
overlapping failures, and its properties hold or do not; *driving* has no failure at all, so nothing may stop it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

from pydantic import BeforeValidator, ConfigDict, Field, TypeAdapter, ValidationError

SCENARIO, STOP, DRIVING = "scenario", "stop", "driving"
KINDS: Final = (STOP, SCENARIO, DRIVING)
"""In this order they are in results.jsonl."""


Span = Annotated[float, BeforeValidator(lambda value: math.inf if value is None else value)]
"""[s]. Infinity is null in JSON."""


class BrokenLineError(ValueError):
    """A line of results.jsonl that is no outcome."""


@dataclass(frozen=True, slots=True)
class MeasuredStop:
    """From the failure until the base stands for good, by the ground truth of the plant."""

    fault: str
    """What failed; empty: an ordinary stop, the source orders zero."""
    cause: str
    """Which part stopped the base, and why, such as `watchdog: lease lost`; empty: none of them reports a cause."""
    speed_mps: float
    """Of the base when the failure began."""
    time_s: Span
    """Until its lasting standstill; infinity: it never came."""
    way_m: float
    """Between where it was then and where it stands, straight."""
    power_off_s: Span
    """Until no motor had power any more; infinity: some always had, a stop does not need that."""
    peak_mps: float = 0.0
    """Of the fastest rim."""


@dataclass(frozen=True, slots=True)
class Violation:
    """A property that did not hold (its sentence: canbase_campaign.properties). `at_s`: since the run began."""

    property: str
    at_s: float
    detail: str


@dataclass(frozen=True, slots=True)
class Ages:
    """The longest age of something that a timeout watches, in a run without a failure. `limit_s`: the timeout."""

    key: str
    """The key of robot.yaml, such as `timeouts.lease_s`."""
    longest_s: float
    limit_s: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """One run. `kind` and `seed` say which: `canbase prove qualify FILE --scenario SEED` tells a scenario as a log."""

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", ser_json_inf_nan="null")

    kind: Annotated[str, Field(pattern=f"^({'|'.join(KINDS)})$")]
    seed: int
    robot: str
    """The body that was drawn for it: mass, payload, slope, …"""
    payload: float
    """Load: mass and yaw inertia are this many times those of the empty robot."""
    slope: float
    """Of the floor, as a share: 0.06 is 6 %; positive: downhill ahead."""
    faults: tuple[str, ...] = ()
    """Names; of a stop: what failed, and how."""
    violations: tuple[Violation, ...] = ()
    trips: tuple[str, ...] = ()
    """Causes of the watchdog's trips, in their order."""
    stops: tuple[MeasuredStop, ...] = ()
    ages: tuple[Ages, ...] = ()
    virtual_s: float = 0.0
    moved_m: float = 0.0

    @property
    def key(self) -> tuple[int, int]:
        """Its place in results.jsonl: no two outcomes of one qualification have the same."""
        return KINDS.index(self.kind), self.seed

    def line(self) -> str:
        """As one line of JSON, without the end of the line. Infinity is null."""
        return _LINE.dump_json(self).decode()

    @staticmethod
    def of_line(line: str) -> Outcome:
        """The outcome of a line. Raises BrokenLineError: it is cut off, or no outcome."""
        try:
            return _LINE.validate_json(line)
        except ValidationError as error:
            raise BrokenLineError(f"no outcome of a run: {line[:80]!r}: {error}") from error


_LINE: Final = TypeAdapter(Outcome)
