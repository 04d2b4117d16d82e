"""What one fault is: its sentence, how long it lasts, what is drawn for it, how it begins and ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World

Arguments = Mapping[str, Any]
Change = Callable[["World", "Surroundings", Arguments], None]
WHEELS = 8
LONG, SHORT = (0.3, 1.5), (0.1, 1.0)
"""How long a fault lasts [s]."""


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """One fault of one scenario. Times from its start [s]."""

    name: str
    start_s: float
    duration_s: float
    arguments: Arguments

    def __str__(self) -> str:
        given = ", ".join(f"{key}={value}" for key, value in self.arguments.items())
        return f"{self.start_s:5.2f} s  fault {self.name}({given}), {self.duration_s:.2f} s"


@dataclass(frozen=True, slots=True)
class Kind:
    """One row of the table."""

    sentence: str
    lasts_s: tuple[float, float]
    draw: Callable[[Random], Arguments]
    begin: Change
    end: Change


def nothing(random: Random) -> Arguments:
    """Of a fault without arguments."""
    return {}


def stays(world: World, around: Surroundings, given: Arguments) -> None:
    """This fault does not end by itself."""


def wheel(random: Random) -> Arguments:
    """One of the robot's wheels; a robot with fewer counts on from the first one."""
    return {"wheel": random.randrange(WHEELS)}


def share(random: Random) -> Arguments:
    """Mostly all of it."""
    return {"share": random.choice((1.0, 1.0, random.uniform(0.1, 1.0)))}


def speed(random: Random) -> float:
    """Of the sample robot [m/s]."""
    return random.choice((-1.0, 1.0)) * random.uniform(0.15, 0.8)


def intruder(field: str, key: str, off: object) -> tuple[Change, Change]:
    """The intruder does with `given[key]`, and then `off`, what its `field` switches on."""

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.intruder, field, given[key])

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.intruder, field, off)

    return begin, end


def axis_fault(field: str, value: Callable[[Any], object], off: object) -> tuple[Change, Change]:
    """A field of the faults of an axis: its value at the begin, and `off`."""

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        axis = world.drives.axis(given["wheel"])
        setattr(axis.faults, field, value(axis))

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.drives.axis(given["wheel"]).faults, field, off)

    return begin, end
