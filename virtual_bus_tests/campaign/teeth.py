"""`python -m campaign.teeth [SAFEGUARD …]`: takes each safeguard out, and looks for a scenario that needs it.

A scenario needs a safeguard when a property does not hold without it and does hold with it, all else being equal. Where
other layers hold the same (`Need.beside`), those are taken out in both runs: so it is shown what this one adds to none.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import count, islice
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress
from rich.table import Table

from campaign.removed_safeguards import remove
from campaign.safeguard_needs import NEEDS, Need
from canbase_campaign.plan import draw_plan
from canbase_campaign.robots import SCENARIOS as SEEDS_A_ROBOT
from canbase_campaign.robots import draw_robot
from canbase_campaign.scenario import Result, Start

MOST = 200
"""This many scenarios are tried for each row."""
A_ROBOT = 5
"""This many in a row have one robot, which is booted once."""
BOOTED = 40
"""A process keeps this many robots."""
app = typer.Typer(add_completion=False)
out = Console()


@dataclass(frozen=True, slots=True)
class Bite:
    """The first scenario that needs a safeguard; none of the `tried` did when `found` is empty."""

    need: Need
    found: str
    seed: int
    tried: int
    seconds: float


def look(need: Need, most: int = MOST) -> Bite:
    """Try scenarios until one needs the safeguard."""
    began = time.perf_counter()
    tried = 0
    for tried, seed in enumerate(islice(_seeds(need), most), start=1):
        found = missed(need, seed)
        if found:
            return Bite(need, found, seed, tried, time.perf_counter() - began)
    return Bite(need, "", -1, tried, time.perf_counter() - began)


def missed(need: Need, seed: int) -> str:
    """The property that holds in this scenario with the safeguard alone; empty: there is none."""
    start, plan = _start(seed // SEEDS_A_ROBOT), draw_plan(seed, need.faults)
    if need.quiet:
        plan = replace(plan, segments=(), goals=())
    found = _properties(start.fork(plan, partial(remove, need.taken_out)))
    if found:
        found -= _properties(start.fork(plan, partial(remove, "" if need.proof else need.beside)))
    return min(found) if found else ""


def _properties(result: Result) -> set[str]:
    return {violation.name for violation in result.violations}


def _seeds(need: Need) -> Iterator[int]:
    """Of the robots that can show it."""
    for number in count():
        if need.robots(draw_robot(number).robot):
            yield from range(number * SEEDS_A_ROBOT, number * SEEDS_A_ROBOT + A_ROBOT)


@lru_cache(maxsize=BOOTED)
def _start(number: int) -> Start:
    return Start(draw_robot(number))


def look_at(needs: Sequence[Need], most: int, workers: int) -> Iterator[Bite]:
    """As they are found. A safeguard leaves the copy of a process alone: the robots of a worker stay whole."""
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(partial(look, most=most), needs)


def table(bites: Sequence[Bite]) -> Table:
    """In the order of NEEDS."""
    rows = Table(
        "safeguard", "taken out too", "found after", "property", "seed", "s", title="what each one is needed for"
    )
    for bite in sorted(bites, key=lambda each: NEEDS.index(each.need)):
        found = (str(bite.tried), bite.found, str(bite.seed)) if bite.found else (f"NOT IN {bite.tried}", "", "")
        rows.add_row(bite.need.safeguard, bite.need.beside.replace("+", "\n"), *found, f"{bite.seconds:.1f}")
    return rows


@app.command()
def main(
    safeguards: Annotated[
        list[str] | None, typer.Argument(help="names in campaign/removed_safeguards.py; default: all")
    ] = None,
    scenarios: Annotated[int, typer.Option(min=1, help="tried for each row at most")] = MOST,
    workers: Annotated[int, typer.Option(min=1, help="processes")] = 2,
) -> None:
    """Take each safeguard out and find the scenario that needs it. Exit code 1 when one is not found missing."""
    needs = [need for need in NEEDS if not safeguards or need.safeguard in safeguards]
    unknown = set(safeguards or ()) - {need.safeguard for need in needs}
    if unknown:
        raise typer.BadParameter(f"no such safeguard: {', '.join(sorted(unknown))}")
    bites: list[Bite] = []
    with Progress("{task.description}", BarColumn(), MofNCompleteColumn(), console=out) as bar:
        task = bar.add_task("safeguards", total=len(needs))
        for bite in look_at(needs, scenarios, min(workers, len(needs))):
            bites.append(bite)
            found = f"{bite.found} after {bite.tried}" if bite.found else f"NOT FOUND IN {bite.tried}"
            bar.console.print(f"without {bite.need.safeguard}: {found}", highlight=False)
            bar.advance(task)
    out.print(table(bites))
    for need in needs:
        if need.proof:
            out.print(f"{need.safeguard}: no scenario can need it alone: {need.proof}", highlight=False)
    missing = sum(not bite.found for bite in bites)
    out.print(f"{len(bites) - missing} of {len(bites)} safeguards are found missing")
    raise typer.Exit(1 if missing else 0)


if __name__ == "__main__":
    app()
