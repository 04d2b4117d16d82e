"""`python -m campaign`: runs scenarios and prints what came of them; `--seed` replays one of them step by step."""

from __future__ import annotations

import enum
import signal
from functools import partial
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn
from rich.table import Table

from campaign.regressions import open_ones, repeats
from campaign.removed_safeguards import SAFEGUARDS, refuse_compiled, remove
from canbase_campaign.excuses import MOST_SHARE, MOST_STOP_SHARE, STOPS
from canbase_campaign.faults import FAULTS
from canbase_campaign.judge import Violation
from canbase_campaign.plan import draw_plan
from canbase_campaign.properties import PROPERTIES
from canbase_campaign.replay import replay
from canbase_campaign.robots import robot_of
from canbase_campaign.runner import Tally, run
from canbase_campaign.scenario import Result

SHOWN = 50
"""Violations that are printed one by one, as they are found."""
BROKEN_OFF = 128 + signal.SIGINT
"""Exit code after Ctrl-C, as of a shell."""
app = typer.Typer(add_completion=False)
out = Console()
Fault = enum.Enum("Fault", {name: name for name in FAULTS}, type=str)  # type: ignore[misc]
Safeguard = enum.Enum("Safeguard", {name: name for name in SAFEGUARDS}, type=str)  # type: ignore[misc]


@app.command()
def main(
    scenarios: Annotated[int, typer.Option(min=1, help="how many scenarios")] = 10_000,
    first: Annotated[int, typer.Option(min=0, help="seed of the first one; the others follow it")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="processes")] = 2,
    seed: Annotated[int | None, typer.Option(min=0, help="tell this one alone, as a log")] = None,
    fault: Annotated[list[Fault] | None, typer.Option(help="draw only from these; may be repeated")] = None,
    frames: Annotated[bool, typer.Option(help="with --seed: every frame on the bus too")] = False,
    from_rest: Annotated[bool, typer.Option(help="with --seed: as drawn until 2026-11-26, no drive before")] = False,
    without: Annotated[Safeguard | None, typer.Option(help="take this safeguard out before")] = None,
) -> None:
    """Scenarios with 1 to 4 overlapping faults in virtual time. Exit code 1 when a property did not hold.

    Ctrl-C prints what was found until then, with exit code 130.
    """
    only = [name.value for name in fault or ()]
    taken_out = without.value if without is not None else ""
    if seed is not None:
        remove(taken_out)
        result = replay(robot_of(seed), draw_plan(seed, only, from_rest), frames, print)
        raise typer.Exit(1 if result.violations else 0)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    refuse_compiled(taken_out)
    tally = _run(range(first, first + scenarios), workers, only, taken_out)
    _tell_faults(tally)
    _tell_sums(tally)
    _tell_excuses(tally)
    _tell_violations(tally, only)
    if tally.broken_off:
        out.print(f"broken off after {tally.scenarios} of {scenarios} scenarios")
    known = open_ones()
    fresh = [violation for seed, violation in tally.violations if (seed, violation.name) not in known]
    if len(fresh) < len(tally.violations):
        out.print(f"{len(tally.violations) - len(fresh)} of them open in regressions.yaml, and no failure")
    raise typer.Exit(1 if fresh else BROKEN_OFF if tally.broken_off else 0)


def _run(seeds: range, workers: int, only: list[str], without: str) -> Tally:
    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), "{task.fields[found]}")
    with Progress(*columns, console=out) as progress:
        task = progress.add_task("scenarios", total=len(seeds), found="")
        found = 0

        def on_result(result: Result) -> None:
            nonlocal found
            before, found = found, found + len(result.violations)
            for violation in result.violations[: max(0, SHOWN - before)]:
                _tell(result.seed, violation, only)
            progress.update(task, advance=1, found=f"{found} violations")

        return run(seeds, workers, only, partial(remove, without), on_result)


def _tell(seed: int, violation: Violation, only: list[str]) -> None:
    """As soon as it is found."""
    out.print(f"[red]{violation.name}[/red] in seed {seed} at {violation.at_s:.2f} s: {violation.detail}")
    out.print(f"  {'; '.join(str(fault) for fault in draw_plan(seed, only).faults)}", highlight=False)
    out.print(f"  {repeats(seed, tuple(only))}", highlight=False)


def _tell_faults(tally: Tally) -> None:
    table = Table("fault", "times", "what happens", title=f"faults in {tally.scenarios} scenarios")
    for name, kind in FAULTS.items():
        if tally.faults[name]:
            table.add_row(name, str(tally.faults[name]), kind.sentence)
    if table.row_count:
        out.print(table)


def _tell_sums(tally: Tally) -> None:
    at_once = ", ".join(f"{count} with {faults}" for faults, count in sorted(tally.at_once.items()))
    trips = ", ".join(f"{name} {count}" for name, count in tally.trips.most_common())
    goals = ", ".join(f"{name} {count}" for name, count in tally.goals.most_common())
    out.print(f"scenarios by number of faults: {at_once}")
    lives = ", ".join(f"{count} with {lives}" for lives, count in sorted(tally.lives.items()))
    out.print(f"scenarios by lives, with a reset between: {lives}")
    out.print(f"trips of the watchdog: {trips or 'none'}")
    out.print(f"ends of goals: {goals or 'none'}")
    ratio = tally.virtual_s / tally.processor_s if tally.processor_s else 0.0
    count = max(1, tally.scenarios)
    out.print(f"on average {tally.virtual_s / count:.1f} s and {tally.moved_m / count:.2f} m a scenario")
    out.print(
        f"{tally.virtual_s:.0f} s of virtual time, {tally.moved_m:.0f} m driven, "
        f"{ratio:.0f} s for each second of processor time"
    )


def _tell_excuses(tally: Tally) -> None:
    """What held by an excuse alone, by property."""
    table = Table("property", "excused", "share", "by row", title=f"{tally.moving_s:.0f} s in motion: excused seconds")
    for name in PROPERTIES:
        rows = {row: seconds for (of, row), seconds in tally.excused_s.items() if of == name}
        excused_s = sum(rows.values())
        share = excused_s / tally.moving_s if tally.moving_s else 0.0
        colour = "red" if share >= (MOST_STOP_SHARE if name in STOPS else MOST_SHARE) else "default"
        by_row = ", ".join(f"{row} {seconds:.2f} s" for row, seconds in sorted(rows.items(), key=lambda item: -item[1]))
        table.add_row(name, f"{excused_s:.2f} s", f"[{colour}]{share:.2%}[/]", by_row)
    out.print(table)


def _tell_violations(tally: Tally, only: list[str]) -> None:
    table = Table("property", "violations", "what must hold")
    for name, sentence in PROPERTIES.items():
        count = sum(violation.name == name for _, violation in tally.violations)
        table.add_row(name, str(count), sentence)
    out.print(table)


if __name__ == "__main__":
    app()
