"""`python -m campaign.odd --robots 2000`: robots with odd but legal drives drive 1 m, or a message cures them.

Each seed is a robot of two drives, each with up to three oddities of canbase_sim.odd. Where it does not drive, what the
driver's message names is done with the drives' manuals, and it is tried again. `--seed 7` tells one robot. Exit code 1:
a message sent a person the wrong way, or a property of the campaign did not hold. Ctrl-C: 130, with what was done.
"""

from __future__ import annotations

import argparse
import gc
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from canbase_campaign.odd_trial import Trial, try_out
from canbase_sim.odd.oddities import ODDITIES

BROKEN_OFF = 128 + signal.SIGINT
"""Exit code after Ctrl-C, as of a shell."""


def trials(seeds: Iterable[int], only: tuple[str, ...] = ()) -> Iterator[Trial]:
    """One robot after the other; the profiles that a person would write are files of a temporary folder."""
    gc.set_threshold(100_000)
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            yield try_out(seed, Path(folder), only)


def told(trial: Trial) -> str:
    """One robot: its drives, its messages, what was done, and what is wrong."""
    lines = [f"seed {trial.seed}: {trial.ended}", *(f"drive {node}: {odd}" for node, odd in trial.drives.items())]
    lines += [f"message: {message}" for message in trial.messages]
    lines += [f"done: {cure}" for cure in trial.cures]
    return "\n    ".join((*lines, *(f"WRONG: {what}" for what in trial.wrong)))


def main() -> int:
    """Seeds and oddities from the command line."""
    parser = argparse.ArgumentParser(prog="campaign.odd", description=__doc__)
    parser.add_argument("--robots", type=int, default=2000, help="how many")
    parser.add_argument("--first", type=int, default=0, help="seed of the first robot; the others follow it")
    parser.add_argument("--seed", type=int, help="tell this robot alone")
    parser.add_argument("--only", default="", help="oddities to draw from, joined by commas")
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.robots) if given.seed is None else range(given.seed, given.seed + 1)
    only = tuple(filter(None, given.only.split(",")))
    if unknown := set(only) - ODDITIES.keys():
        parser.error(f"there is no oddity {', '.join(sorted(unknown))}; expected {', '.join(ODDITIES)}")
    out, began = Console(soft_wrap=True, highlight=False, markup=False), time.process_time()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    done, broken_off = [], False
    columns = TextColumn("{task.fields[found]}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=out) as progress:
        task = progress.add_task("", total=len(seeds), found="")
        try:
            for trial in trials(seeds, only):
                done.append(trial)
                if trial.wrong or given.seed is not None:
                    out.print(told(trial))
                progress.update(task, advance=1, found=f"{_wrong(done)} wrong")
        except KeyboardInterrupt:
            broken_off = True
    _tell_sums(out, done, time.process_time() - began)
    return 1 if _wrong(done) else BROKEN_OFF if broken_off else 0


def _wrong(done: list[Trial]) -> int:
    return sum(bool(trial.wrong) for trial in done)


def _tell_sums(out: Console, done: list[Trial], processor_s: float) -> None:
    drawn = Counter(each.name for trial in done for odd in trial.drives.values() for each in odd.drawn)
    table = Table("oddity", "drives", "what is odd", "legal by")
    for name, oddity in ODDITIES.items():
        if drawn[name]:
            table.add_row(name, str(drawn[name]), oddity.sentence, oddity.clause)
    if table.row_count:
        out.print(table)
    ends = ", ".join(f"{count} {end}" for end, count in Counter(trial.ended for trial in done).most_common())
    messages = sum(len(trial.messages) for trial in done)
    virtual_s = sum(trial.virtual_s for trial in done)
    out.print(
        f"{len(done)} robots: {ends or 'none'}; {messages} messages, {_wrong(done)} robots with something wrong; "
        f"{virtual_s:.0f} s of virtual time in {processor_s:.0f} s of processor time"
    )


if __name__ == "__main__":
    sys.exit(main())
