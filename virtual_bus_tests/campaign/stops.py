"""`python -m campaign.stops`: how fast and how far until the base stands, for each failure, over many runs.

Virtual time, ground truth of the plant, measured as the exit matrix measures its single run of real processes, and put
beside that into the table of docs/stop_times.md. Exit code 1: a base did not stop.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from canbase_campaign.cruise import Cruise, Run
from canbase_campaign.robots import DrawnRobot, campaign_robot
from canbase_campaign.twins import GOAL, JOYSTICK, MEASURED, Twin
from canbase_config.robot import Rates
from canbase_sim.plant.base import PlantParameters
from exit_matrix.page_table import Key, Row
from exit_matrix.stop_table import COMMANDS, TABLE, VIRTUAL
from support.marked_page import rewritten, section

RATES = ("standard", "small_computer")
RUNS = 100
_cruises: dict[str, Cruise] = {}


def quantile(values: Iterable[float], share: float) -> float:
    """The least value that `share` of them do not exceed."""
    ordered = sorted(values)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]


def cells(twin: Twin, runs: Sequence[Run]) -> Row:
    """The columns of docs/stop_times.md that are ours."""
    times, ways = [run.time_s for run in runs], [run.distance_m for run in runs]
    spread = (f"{_s(quantile(times, share))}, {quantile(ways, share) * 1000.0:.0f} mm" for share in (0.5, 0.99, 1.0))
    lies = ("–", "–")
    if twin.lies:
        lies = _s(max(run.power_off_s for run in runs)), f"{max(run.peak_mps for run in runs):.2f} m/s"
    return dict(zip(VIRTUAL, (str(len(runs)), *spread, *lies), strict=True))


def _s(seconds: float) -> str:
    return f"{seconds:.2f} s" if math.isfinite(seconds) else "never"


def measured(
    runs: int, workers: int, twins: Sequence[Twin] = MEASURED, rates: str = "standard"
) -> Iterator[tuple[Twin, list[Run]]]:
    """Each row in one of `workers` processes, in their order."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(workers, _begin, (rates,)) as pool:
        indexes = [MEASURED.index(twin) for twin in twins]
        for index, found in zip(indexes, pool.imap(partial(_measure, runs), indexes), strict=True):
            yield MEASURED[index], found


def _begin(rates: str) -> None:
    robot = campaign_robot().model_copy(update={"rates": Rates.model_validate({"profile": rates})})
    drawn = DrawnRobot(0, robot, PlantParameters())
    _cruises.update({by: Cruise(by, drawn=drawn) for by in (GOAL, JOYSTICK)})


def _measure(runs: int, index: int) -> list[Run]:
    twin = MEASURED[index]
    return [_cruises[twin.by].fork(twin, seed) for seed in range(runs)]


def main() -> int:
    """Print the rows; with --write put them into a page, between its marks."""
    parser = argparse.ArgumentParser(prog="campaign.stops", description=__doc__)
    parser.add_argument("--runs", type=int, default=RUNS, help="of each failure")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--only", default="", help="rows with this in their name")
    parser.add_argument("--rates", choices=RATES, default=RATES[0], help="profile of rates in robot.yaml")
    parser.add_argument("--write", type=Path, help="the page")
    given = parser.parse_args()
    if given.write is not None and given.rates != RATES[0]:
        parser.error(f"the page is about the rates {RATES[0]}")
    twins = [twin for twin in MEASURED if given.only in f"{twin.what}: {twin.how}"]
    out = Console()
    found: dict[Key, Row] = {}
    stood = True
    with Progress(console=out) as progress:
        task = progress.add_task("", total=len(twins))
        for twin, runs in measured(given.runs, given.workers, twins, given.rates):
            found[twin.key] = cells(twin, runs)
            stood = stood and all(math.isfinite(run.time_s) for run in runs)
            told = ", ".join(f"{name} {cell}" for name, cell in found[twin.key].items())
            out.print(f"{twin.what}: {twin.how}: {told}", highlight=False, soft_wrap=True)
            progress.update(task, advance=1, description=twin.what)
    if given.write is not None:
        page = given.write.read_text(encoding="utf-8")
        table = TABLE.merged(section(page, COMMANDS), found)
        given.write.write_text(rewritten(page, COMMANDS, table), encoding="utf-8")
    return 0 if stood else 1


if __name__ == "__main__":
    sys.exit(main())
