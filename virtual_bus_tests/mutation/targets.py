"""What is mutated, and which tests have to notice: the watchdog's policy, and the driver's tables of CiA 402.

`first`: the tests that are about the module, which kill nearly all mutants in no time. `then`: what looks at it
together with the others, run only for a mutant that is still alive.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from mutation.mutants import behaviour

ROOT = Path(__file__).resolve().parents[2]
UNIT = Path("virtual_bus_tests/unit")
STORIES = ("watchdog/story_trips", "watchdog/story_ladder", "watchdog/story_reset", "watchdog/trips")
"""Tests of the watchdog as a whole."""
LONG = "noise or minutes or minute"
"""Tests that are left out: long, and about exceptions and false trips, which the others notice as well."""


@dataclass(frozen=True, slots=True)
class Target:
    """One mutated module. `path`: from the root of the project; `first`, `then`: of the tests (watchdog/policy)."""

    path: str
    first: tuple[str, ...]
    then: tuple[str, ...]

    @property
    def module(self) -> str:
        """Its dotted name."""
        return ".".join(Path(self.path).with_suffix("").parts[1:])

    @property
    def source(self) -> str:
        """Its text."""
        return (ROOT / self.path).read_text(encoding="utf-8")

    @property
    def sha256(self) -> str:
        """Of what it does: comments, docstrings and layout may change."""
        return hashlib.sha256(behaviour(self.source).encode()).hexdigest()


def files(names: tuple[str, ...]) -> list[str]:
    """Paths of test files, from the root of the project."""
    return [str(UNIT / folder / f"test_{name}.py") for folder, name in (name.split("/") for name in names)]


def _watchdog(name: str, *first: str, then: tuple[str, ...] = STORIES) -> Target:
    return Target(f"watchdog/canbase_watchdog/{name}.py", first or (f"watchdog/{name}",), then)


def _driver(name: str, *then: str) -> Target:
    return Target(f"driver/canbase_driver/{name}.py", (f"driver/{name}",), then)


TARGETS = (
    _watchdog("policy", "watchdog/policy", "watchdog/policy_motion"),
    _watchdog("trip_cause", "watchdog/policy", "watchdog/latch"),
    _watchdog("power_and_motion", "watchdog/policy"),
    _watchdog("envelope", then=("watchdog/trips", "watchdog/envelope_limiter")),
    _watchdog("plausibility"),
    _watchdog("motion_evidence", then=("watchdog/observer",)),
    _watchdog("torque"),
    _watchdog("standing", "watchdog/standing", "watchdog/stopping_distance", then=("watchdog/observer",)),
    _watchdog("stopping_distance"),
    _watchdog("twist", then=("watchdog/observer",)),
    _watchdog("tally", then=("watchdog/observer",)),
    _watchdog("pair"),
    _watchdog("copies", "watchdog/second_master"),
    _watchdog("second_master"),
    _watchdog("lease"),
    _watchdog("ladder"),
    _watchdog("view", "watchdog/policy", "watchdog/observer"),
    _watchdog("bus_health"),
    _driver("cia402", "driver/axis", "chain/layouts_agree"),
)
