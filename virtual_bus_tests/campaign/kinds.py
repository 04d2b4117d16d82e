"""`python -m campaign.kinds`: each kind of drive without its masters: what stops it, and how fast.

Virtual time, two simulated drives of one kind, ground truth of the plant. The table is a part of docs/stop_times.md.
Exit code 1: a drive that its boot reports to stop by itself did not.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Final

from campaign.stops import quantile
from canbase_campaign.cruise import Cruise, Run
from canbase_campaign.outside import Surroundings
from canbase_campaign.robots import DrawnRobot, campaign_robot
from canbase_campaign.twins import JOYSTICK, Twin
from canbase_campaign.world import World
from canbase_sim.faults import apply
from canbase_sim.personality import PERSONALITIES
from canbase_sim.plant.base import PlantParameters
from exit_matrix.page_table import PageTable
from support.crews import robot_with
from support.marked_page import rewritten

COMMAND: Final = "make kinds"
"""Names its part of docs/stop_times.md."""
RUNS: Final = 20
GOES_ON: Final = "goes on"


def _die(*names: str) -> Callable[[World, Surroundings, Random], None]:
    """SIGKILL, without a restart."""

    def begin(world: World, around: Surroundings, random: Random) -> None:
        for name in names or tuple(world.processes):
            world.processes[name].die()

    return begin


def _cut(number: int) -> Callable[[World, Surroundings, Random], None]:
    """Both ways, of so many nodes."""

    def begin(world: World, around: Surroundings, random: Random) -> None:
        nodes = world.drives.bench.nodes
        for node_id in random.sample(sorted(nodes), min(number, len(nodes))):
            apply(nodes, node_id, "cut", world.clock.now_s, {})

    return begin


FAILURES: Final = (
    Twin("computer", "dies", _die(), JOYSTICK),
    Twin("driver and watchdog", "die", _die("driver", "watchdog"), JOYSTICK),
    Twin("watchdog", "dies", _die("watchdog"), JOYSTICK),
    Twin("driver", "dies", _die("driver"), JOYSTICK),
    Twin("cable", "cut", _cut(8), JOYSTICK),
    Twin("cable of one drive", "cut", _cut(1), JOYSTICK),
)
"""The rows of the exit matrix in which a drive has nothing but itself, and those in which one process is left."""
MASTERS_ARE_GONE: Final = ("computer", "driver and watchdog", "cable", "cable of one drive")
TABLE: Final = PageTable(("kind", "stops by itself by"), tuple(f"{twin.what} {twin.how}" for twin in FAILURES))


@dataclass(frozen=True, slots=True)
class Row:
    """One kind of drive. `by`: what its boot has set and confirmed; empty: nothing."""

    kind: str
    by: str
    runs: tuple[tuple[Twin, tuple[Run, ...]], ...]

    @property
    def problem(self) -> str:
        """What it did though its boot reports otherwise; empty: nothing."""
        gone_on = [twin for twin, runs in self.runs if twin.what in MASTERS_ARE_GONE and not _stood(runs)]
        if self.by and gone_on:
            return f"{self.kind}: {self.by}, and it goes on: {', '.join(twin.what for twin in gone_on)}"
        return ""


def measured(kind: str, runs: int = RUNS) -> Row:
    """Two drives of this kind, at 0.4 m/s, in every failure."""
    robot = campaign_robot().model_copy(update={"drives": robot_with(kind).drives})
    cruise = Cruise(JOYSTICK, drawn=DrawnRobot(0, robot, PlantParameters()))
    by = cruise.world.driver.core.snapshot(cruise.world.clock.now_s).drives[0].self_stop
    found = [(twin, tuple(cruise.fork(twin, seed) for seed in range(runs))) for twin in FAILURES]
    return Row(kind, by, tuple(found))


def cells(row: Row) -> dict[str, str]:
    """The columns of a kind: p50 and max of the time to standstill."""
    return {f"{twin.what} {twin.how}": _shown(runs) for twin, runs in row.runs}


def _stood(runs: Sequence[Run]) -> bool:
    return all(math.isfinite(run.time_s) for run in runs)


def _shown(runs: Sequence[Run]) -> str:
    if not _stood(runs):
        return GOES_ON
    times = [run.time_s for run in runs]
    return f"{quantile(times, 0.5):.2f}, {max(times):.2f} s"


def main() -> int:
    """Print the rows; with --write put the table into a page."""
    parser = argparse.ArgumentParser(prog="campaign.kinds", description=__doc__)
    parser.add_argument("--runs", type=int, default=RUNS, help="of each failure")
    parser.add_argument("--only", default="", help="kinds with this in their name; nothing is written then")
    parser.add_argument("--write", type=Path, help="the page")
    given = parser.parse_args()
    rows = []
    for kind in sorted(PERSONALITIES):
        if given.only in kind:
            rows.append(measured(kind, given.runs))
            print(f"{kind} ({rows[-1].by or 'nothing'}): {cells(rows[-1])}", flush=True)
    problems = [row.problem for row in rows if row.problem]
    print("\n".join(problems) or "each kind does what its boot reports")
    if given.write is not None and not given.only:
        table = TABLE.merged("", {(row.kind, row.by or "–"): cells(row) for row in rows})
        page = given.write.read_text(encoding="utf-8")
        given.write.write_text(rewritten(page, COMMAND, table), encoding="utf-8")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
