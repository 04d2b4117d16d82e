"""`python -m campaign.teeth`: takes one safeguard out after the other, and looks for a scenario that shows it missing.

A safeguard whose absence no scenario shows is either doubly covered, then `COVERED` says by what, or not proven.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from dataclasses import dataclass

from rich.console import Console
from rich.progress import track
from rich.table import Table

from campaign.plan import draw_plan
from campaign.scenario import Start
from campaign.without import SAFEGUARDS, remove

SCENARIOS = 400
"""So many scenarios are tried for each."""
DRAWN_FROM: dict[str, tuple[str, ...]] = {}
COVERED: dict[str, str] = {}


@dataclass(frozen=True, slots=True)
class Bite:
    """The first scenario that shows a safeguard missing; none of those `tried` did when `found` is empty."""

    safeguard: str
    found: str
    seed: int
    tried: int


def look(safeguard: str, scenarios: int = SCENARIOS) -> Bite:
    """Take a safeguard out of this process, which is spent then, and look for a violation."""
    remove(safeguard)
    start = Start()
    for seed in range(scenarios):
        result = start.fork(draw_plan(seed, DRAWN_FROM.get(safeguard, ())))
        if result.violations:
            return Bite(safeguard, result.violations[0].name, seed, seed + 1)
    return Bite(safeguard, "", -1, scenarios)


def look_at_all(workers: int) -> Iterator[Bite]:
    """Each safeguard in a process of its own."""
    with multiprocessing.get_context("spawn").Pool(workers, maxtasksperchild=1) as pool:
        yield from pool.imap(look, SAFEGUARDS)


def main() -> int:
    """Exit code 1 when a safeguard is neither found missing nor explained."""
    table = Table("taken out", "found by", "seed", "scenarios", "otherwise covered by")
    gaps = 0
    for bite in track(look_at_all(2), total=len(SAFEGUARDS), description="safeguards"):
        gaps += not bite.found and bite.safeguard not in COVERED
        seed = str(bite.seed) if bite.found else ""
        table.add_row(bite.safeguard, bite.found, seed, str(bite.tried), COVERED.get(bite.safeguard, ""))
    Console().print(table)
    return 1 if gaps else 0


if __name__ == "__main__":
    raise SystemExit(main())
