"""Safeguards that a small world misses when they are taken out, and what it then finds."""

from __future__ import annotations

import multiprocessing
from dataclasses import dataclass

from campaign.without import remove
from small_worlds.explore import Bounds, Story, search, shortest


@dataclass(frozen=True, slots=True)
class Tooth:
    """Without `safeguard`, a search from `start` finds that `found` does not hold."""

    safeguard: str
    start: str
    bounds: Bounds
    found: str


def _with(*events: str) -> Bounds:
    """Only these events, each at most once."""
    return Bounds(faults=2, operator=1, every=4, only=events)


TEETH = (
    Tooth("driver:watchdog_missing+drives:heartbeat_consumer", "driving", _with("watchdog dies"), "alive"),
    Tooth("drives:heartbeat_consumer", "driving", _with("cable for good"), "latched"),
    Tooth("watchdog:all+driver:command_timeout", "driving", _with("velocity dies"), "alive"),
    Tooth("watchdog:latch+driver:latch", "driving", _with("lease lost", "stick"), "latched"),
    Tooth("mux:timeout", "driving", _with("radio lost"), "fresh"),
    Tooth("filter:estop", "driving", _with("press"), "latched"),
    Tooth("driver:stop_record", "stopped", _with("driver restarts"), "latched"),
)
"""Each alone would be missed by no story where another layer covers it: those are taken out together."""


def bite(tooth: Tooth) -> dict[str, Story]:
    """The shortest stories by property without the safeguard, which is taken out of a process of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_search_without, (tooth,))


def _search_without(tooth: Tooth) -> dict[str, Story]:
    remove(tooth.safeguard)
    return shortest(search(tooth.bounds, [tooth.start], workers=1).stories)
