"""`python -m small_worlds`: everything that a few events can do to supervisor, watchdog, drives, mux and filter."""

from __future__ import annotations

import enum
from typing import Annotated

import typer
from rich.console import Console

from campaign.without import SAFEGUARDS, remove
from small_worlds.explore import Bounds, Search, search, shortest
from small_worlds.properties import PROPERTIES
from small_worlds.world import STARTS

app = typer.Typer(add_completion=False)
out = Console(highlight=False, soft_wrap=True)
Safeguard = enum.Enum("Safeguard", {name: name for name in SAFEGUARDS}, type=str)  # type: ignore[misc]
Start = enum.Enum("Start", {name: name for name in STARTS}, type=str)  # type: ignore[misc]


@app.command()
def main(
    faults: Annotated[int, typer.Option(min=0, max=3, help="at most so many failures")] = 1,
    operator: Annotated[int, typer.Option(min=0, max=2, help="at most so many actions of the operator")] = 1,
    every: Annotated[int, typer.Option(min=1, max=10, help="events at each so-manieth multiple of 0.2 s")] = 4,
    start: Annotated[list[Start] | None, typer.Option(help="only from here; may be repeated")] = None,
    workers: Annotated[int, typer.Option(min=1, help="processes")] = 2,
    without: Annotated[Safeguard | None, typer.Option(help="take this safeguard out before")] = None,
) -> None:
    """Exit code 1 when a property did not hold, or a world did not come to rest."""
    remove(without.value if without is not None else "")
    bounds = Bounds(faults, operator, every)
    found = search(bounds, [each.value for each in start or ()] or STARTS, workers)
    _tell(bounds, found)
    raise typer.Exit(1 if found.stories else 0)


def _tell(bounds: Bounds, found: Search) -> None:
    out.print(
        f"{bounds}: {found.states:,} states, {found.steps:,} steps, "
        f"{found.real_s:.0f} s, {found.cpu_s:.0f} s of processor time"
    )
    for name, sentence in PROPERTIES.items():
        violated = [story for story in found.stories if story.found.name == name]
        out.print(f"{name:9} {len(violated):4} stories   {sentence}")
    for story in shortest(found.stories).values():
        out.print("\n".join(["", *story.lines()]))


if __name__ == "__main__":
    app()
