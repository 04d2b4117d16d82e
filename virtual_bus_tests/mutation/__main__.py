"""`python -m mutation`: tries mutants and writes the report. A module whose text has not changed since the last run is
not measured again: of it only the survivors are tried again, as a new test may kill them.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn
from rich.table import Table

from mutation import report, trial
from mutation.mutants import Mutant, mutants
from mutation.report import Entry, Report, Survivor
from mutation.targets import TARGETS, Target

app = typer.Typer(add_completion=False)
out = Console()


@app.command()
def main(
    module: Annotated[list[str] | None, typer.Option(help="only modules with this in their name; may repeat")] = None,
    anew: Annotated[bool, typer.Option("--all", help="every mutant, of unchanged sources too")] = False,
    workers: Annotated[int, typer.Option(min=1, help="processes")] = os.cpu_count() or 1,
) -> None:
    """Exit code 1 when a mutant lives that explained.yaml does not name."""
    began = time.monotonic()
    chosen = [target for target in TARGETS if not module or any(word in target.module for word in module)]
    known = report.load()
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=trial.preload) as pool:
        for target in chosen:
            known[target.module] = _try(target, None if anew else known.get(target.module), pool)
            report.save(known)
    _tell(known, time.monotonic() - began)
    raise typer.Exit(1 if report.unexplained(known) else 0)


def _try(target: Target, before: Entry | None, pool: ProcessPoolExecutor) -> Entry:
    everything = mutants(target.source)
    chosen: Sequence[Mutant] = everything
    if before is not None and before.sha256 == target.sha256:
        alive = {(survivor.before, survivor.after) for survivor in before.survivors}
        chosen = [mutant for mutant in everything if (mutant.before, mutant.after) in alive]
    if chosen and not pool.submit(trial.passes_unchanged, target).result():
        raise SystemExit(f"the tests of {target.path} fail without any mutation: mend that first")
    survivors = []
    columns = ("{task.description:32}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=out) as progress:
        results = pool.map(trial.survives, [target] * len(chosen), chosen)
        for mutant, survives in zip(progress.track(chosen, description=target.module), results, strict=True):
            if survives:
                survivors.append(Survivor(mutant.operator, mutant.line, mutant.before, mutant.after))
    return Entry(target.sha256, len(everything), tuple(survivors))


def _tell(known: Report, took_s: float) -> None:
    table = Table("module", "mutants", "alive", title=f"{took_s / 60.0:.1f} min")
    for name, entry in known.items():
        table.add_row(name, str(entry.mutants), str(len(entry.survivors)))
    alive = sum(len(entry.survivors) for entry in known.values())
    table.add_row("all", str(sum(entry.mutants for entry in known.values())), str(alive))
    out.print(table)
    for name, survivor in report.unexplained(known):
        out.print(
            f"alive: {name}:{survivor.line}  {survivor.before}\n    →  {survivor.after}", highlight=False, markup=False
        )


if __name__ == "__main__":
    app()
