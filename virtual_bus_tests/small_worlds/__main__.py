"""`python -m small_worlds`: everything that a few events can do to state machine, watchdog, drives, mux and filter."""

from __future__ import annotations

import enum
import signal
from collections.abc import Sequence
from typing import Annotated, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from campaign.removed_safeguards import SAFEGUARDS, remove
from small_worlds.explore import Bounds, Search, search, shortest
from small_worlds.properties import PROPERTIES
from small_worlds.world import STARTS

app = typer.Typer(add_completion=False)
out = Console(highlight=False, soft_wrap=True)
Safeguard = enum.Enum("Safeguard", {name: name for name in SAFEGUARDS}, type=str)  # type: ignore[misc]
BROKEN_OFF: Final = 128 + signal.SIGINT
"""Exit code after Ctrl-C, as of a shell."""
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
    """Exit code 1 when a property did not hold, or a world did not come to rest; 130 after Ctrl-C."""
    remove(without.value if without is not None else "")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    bounds = Bounds(faults, operator, every)
    found = _with_progress(bounds, [each.value for each in start or ()] or STARTS, workers)
    _tell(bounds, found)
    raise typer.Exit(1 if found.stories else BROKEN_OFF if found.broken_off else 0)


def _with_progress(bounds: Bounds, starts: Sequence[str], workers: int) -> Search:
    columns = TextColumn("first events"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[told]}")
    with Progress(*columns, console=out) as progress:
        task = progress.add_task("", total=None, told="")

        def on_news(found: Search) -> None:
            told = f"{found.states:,} states, {len(found.stories)} stories"
            progress.update(task, total=found.tasks, completed=found.done, told=told)

        return search(bounds, starts, workers, on_news)


def _tell(bounds: Bounds, found: Search) -> None:
    out.print(
        f"{bounds}: {found.states:,} states, {found.steps:,} steps, "
        f"{found.real_s:.0f} s, {found.cpu_s:.0f} s of processor time"
    )
    if found.broken_off:
        out.print(f"broken off after {found.done} of {found.tasks} first events")
    for name, sentence in PROPERTIES.items():
        violated = [story for story in found.stories if story.found.name == name]
        out.print(f"{name:9} {len(violated):4} stories   {sentence}")
    for story in shortest(found.stories).values():
        out.print("\n".join(["", *story.lines()]))


if __name__ == "__main__":
    app()
