"""`python -m campaign.teeth [SAFEGUARD …]`: takes each safeguard out, and looks for a scenario that needs it.

A scenario needs a safeguard when a property does not hold without it and does hold with it, all else being equal. Where
other layers hold the same (`Need.beside`), those are taken out in both runs: so it is shown what this one adds to none.

Scenarios are those of `make campaign` that begin from rest, from seed 0 on; those without one of a row's faults are
counted, and not run. Where none of them needs a safeguard, scenarios are drawn from the row's faults alone.
`teeth.json` has the number of scenarios that it took, the seed and the property.
"""

from __future__ import annotations

import json
import multiprocessing
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from campaign.removed_safeguards import remove
from campaign.safeguard_needs import NEEDS, Need
from canbase_campaign.plan import draw_plan
from canbase_campaign.robots import SCENARIOS
from canbase_campaign.runner import start_of
from canbase_campaign.scenario import Result

MOST = 2000
"""A safeguard has to be found missing within this many scenarios of the campaign, or within the next number ..."""
MOST_DIRECTED = 200
"""... of scenarios that are drawn from its faults alone."""
DIRECTED_A_ROBOT = 5
MEASURED = Path(__file__).with_name("teeth.json")
app = typer.Typer(add_completion=False)
out = Console()


@dataclass(frozen=True, slots=True)
class Bite:
    """The first scenario that needs a safeguard: the `scenarios`-th. `directed`: drawn from its faults alone.

    `property` empty: none of so many did.
    """

    safeguard: str
    scenarios: int
    seed: int
    property: str
    directed: bool = False


def load() -> dict[str, Bite]:
    """The last measurement, by safeguard."""
    rows = json.loads(MEASURED.read_text(encoding="utf-8")) if MEASURED.exists() else []
    return {row["safeguard"]: Bite(**row) for row in rows}


def save(bites: dict[str, Bite]) -> None:
    """In the order of NEEDS; what has no row there any more is dropped."""
    rows = [asdict(bites[need.safeguard]) for need in NEEDS if need.safeguard in bites]
    lines = ",\n".join(json.dumps(row) for row in rows)
    MEASURED.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def missed(need: Need, seed: int, directed: bool = False) -> str:
    """The property that holds in this scenario with the safeguard alone; empty: there is none."""
    start, plan = start_of(seed), draw_plan(seed, need.faults if directed else (), from_rest=True)
    if not directed and need.faults and not {fault.name for fault in plan.faults} & set(need.faults):
        return ""
    if directed and need.quiet:
        plan = replace(plan, segments=(), goals=())
    found = _properties(start.fork(plan, partial(remove, need.taken_out)))
    if found:
        found -= _properties(start.fork(plan, partial(remove, "" if need.proof else need.beside)))
    return min(found) if found else ""


def _properties(result: Result) -> set[str]:
    return {violation.name for violation in result.violations}


def recheck(bite: Bite) -> str:
    """What the measured scenario of a safeguard shows now: the property; empty: nothing."""
    need = next(need for need in NEEDS if need.safeguard == bite.safeguard)
    return missed(need, bite.seed, bite.directed)


def of_day(ordinal: int, days: int = 3) -> list[Need]:
    """The rows whose turn it is on this day (datetime.date.toordinal): each one every `days` days."""
    return [need for number, need in enumerate(NEEDS) if number % days == ordinal % days and not need.undrawn]


def _on_robot(robot: int, needs: Sequence[Need], directed: bool) -> list[Bite]:
    """The first scenario of one robot that needs it, for each row that has one."""
    bites = []
    for need in needs:
        for place in range(DIRECTED_A_ROBOT if directed else SCENARIOS):
            seed = robot * SCENARIOS + place
            found = missed(need, seed, directed)
            if found:
                count = robot * DIRECTED_A_ROBOT + place + 1 if directed else seed + 1
                bites.append(Bite(need.safeguard, count, seed, found, directed))
                break
    return bites


def search(needs: Iterable[Need], most: int, workers: int, directed: bool = False) -> Iterator[Bite]:
    """Robot by robot: each is booted once for all rows that are still open. A safeguard leaves the copy of a process
    alone: the robots of a worker stay whole."""
    left = list(needs)
    robots = -(-most // (DIRECTED_A_ROBOT if directed else SCENARIOS))
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        for first in range(0, robots, workers):
            some = range(first, min(first + workers, robots))
            for bites in pool.map(partial(_on_robot, needs=left, directed=directed), some, chunksize=1):
                for bite in bites:
                    if any(need.safeguard == bite.safeguard for need in left) and bite.scenarios <= most:
                        left = [need for need in left if need.safeguard != bite.safeguard]
                        yield bite
    yield from (Bite(need.safeguard, most, -1, "", directed) for need in left)


def look_at(needs: Sequence[Need], workers: int, known: dict[str, Bite]) -> Iterator[Bite]:
    """Of rows that were found missing: the measured scenario first; what that one does not show any more is searched
    for in scenarios from the row's faults."""
    measured = [known[need.safeguard] for need in needs if need.safeguard in known and known[need.safeguard].property]
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        found = pool.map(recheck, measured, chunksize=1)
    yield from (bite for bite, shows in zip(measured, found, strict=True) if shows)
    lost = {bite.safeguard for bite, shows in zip(measured, found, strict=True) if not shows}
    if lost:
        yield from search([need for need in needs if need.safeguard in lost], MOST_DIRECTED, workers, directed=True)


def search_all(needs: Sequence[Need], most: int, workers: int, directed: bool = True) -> Iterator[Bite]:
    """In the campaign's own scenarios; then, `directed`, what is left in those drawn from its faults."""
    left = {need.safeguard: need for need in needs if not need.undrawn}
    for bite in search(list(left.values()), most, workers):
        if bite.property or not directed:
            del left[bite.safeguard]
            yield bite
    if directed:
        yield from search(list(left.values()), min(most, MOST_DIRECTED), workers, directed=True)


def table(bites: dict[str, Bite]) -> Table:
    """In the order of NEEDS."""
    rows = Table("safeguard", "taken out too", "found after", "drawn", "property", "seed", title="what needs each one")
    for need in NEEDS:
        bite = bites.get(need.safeguard)
        if bite is not None:
            drawn = "from its faults" if bite.directed else "as in the campaign"
            count = str(bite.scenarios) if bite.property else f"NOT IN {bite.scenarios}"
            found = (count, drawn, bite.property, str(bite.seed))
            rows.add_row(need.safeguard, need.beside.replace("+", "\n"), *found)
    return rows


@app.command()
def main(
    safeguards: Annotated[
        list[str] | None, typer.Argument(help="names in campaign/removed_safeguards.py; default: all")
    ] = None,
    scenarios: Annotated[int, typer.Option(min=1, help="of the campaign, for each row at most")] = MOST,
    workers: Annotated[int, typer.Option(min=1, help="processes")] = 2,
    write: Annotated[bool, typer.Option(help="write teeth.json")] = False,
    directed: Annotated[str, typer.Option(help="scenarios from the faults of a row: after, only or never")] = "after",
) -> None:
    """Take each safeguard out and find the scenario that needs it. Exit code 1 when one is not found missing."""
    needs = [need for need in NEEDS if not safeguards or need.safeguard in safeguards]
    unknown = set(safeguards or ()) - {need.safeguard for need in needs}
    if unknown:
        raise typer.BadParameter(f"no such safeguard: {', '.join(sorted(unknown))}")
    drawn = [need for need in needs if not need.undrawn]
    if directed == "only":
        found = search(drawn, min(scenarios, MOST_DIRECTED), workers, directed=True)
    else:
        found = search_all(drawn, scenarios, workers, directed == "after")
    bites = _watch(found, write)
    out.print(table(bites))
    _tell_reasons(needs)
    missing = sum(not bites[need.safeguard].property for need in drawn)
    out.print(f"{len(drawn) - missing} of {len(drawn)} safeguards are found missing")
    raise typer.Exit(1 if missing else 0)


def _watch(found: Iterable[Bite], write: bool) -> dict[str, Bite]:
    """Print each as it is found; `write`: teeth.json has it at once."""
    began, known, bites = time.monotonic(), load(), dict[str, Bite]()
    for bite in found:
        known[bite.safeguard] = bites[bite.safeguard] = bite
        drawn = " from its faults" if bite.directed else ""
        shows = f"{bite.property} after {bite.scenarios}" if bite.property else f"NOT IN {bite.scenarios}"
        out.print(f"{time.monotonic() - began:5.0f} s  without {bite.safeguard}: {shows}{drawn}", highlight=False)
        if write:
            save(known)
    return bites


def _tell_reasons(needs: Sequence[Need]) -> None:
    for need in needs:
        if need.proof:
            out.print(f"{need.safeguard}: no scenario can need it alone: {need.proof}", highlight=False)
        if need.undrawn:
            out.print(f"{need.safeguard}: not drawn: {need.undrawn}", highlight=False)


if __name__ == "__main__":
    app()
