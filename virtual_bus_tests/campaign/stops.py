"""`python -m campaign.stops`: how fast and how far until the base stands, for each failure, over many runs.

Virtual time, ground truth of the plant, measured as the exit matrix measures its single run of real processes, and put
beside that into the table of docs/stop_times.md. Exit code 1: a base did not stop.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import os
import pickle
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random

from rich.console import Console
from rich.progress import Progress

from campaign.robots import DrawnRobot, campaign_robot
from campaign.scenario import Start
from campaign.twins import GOAL, JOYSTICK, TWINS, Twin
from campaign.world import World
from canbase_config.robot import Rates
from canbase_sim.plant.base import PlantParameters
from canbase_velocity.twist import ZERO, Twist
from exit_matrix.page_table import Key, Row
from exit_matrix.stop_limits import SPEED_MPS
from exit_matrix.stop_table import COMMANDS, TABLE, VIRTUAL
from support.marked_page import rewritten, section

CRUISES_S, LONGEST_S, RESTS_S, LOOK_S = 1.5, 8.0, 0.6, 0.002
"""Until the base drives steadily; longer than any stop; a base that stood this long has stopped; period of looks."""
GOAL_M, JOYSTICK_S = 4.5, 0.02
RATES = ("standard", "small_computer")
PHASE_S = 0.1
"""The failure comes up to so much later: SYNCs, leases and heartbeats are anywhere in their periods then."""
RUNS = 100
_cruises: dict[str, Cruise] = {}


@dataclass(frozen=True, slots=True)
class Run:
    """One run. `time_s`: from the failure until the lasting standstill of the base, infinity: it never came.

    `power_off_s`: until no motor had power, infinity: some always had. `peak_mps`: of the fastest rim.
    """

    time_s: float
    distance_m: float
    power_off_s: float
    peak_mps: float


class Cruise:
    """A world whose base drives steadily. The joystick orders `ordered`, for ever; None: it publishes nothing."""

    def __init__(self, by: str, speed_mps: float = SPEED_MPS, rates: str = "standard") -> None:
        """`rates`: a profile of rates in robot.yaml."""
        robot = campaign_robot().model_copy(update={"rates": Rates.model_validate({"profile": rates})})
        start = Start(DrawnRobot(0, robot, PlantParameters()))
        self.world, self.around = start.world, start.around
        self.ordered: Twist | None = Twist(speed_mps, 0.0) if by == JOYSTICK else None
        if by == GOAL:
            self.world.action.send_goal(GOAL_M, speed_mps)
        self._push()
        self.world.clock.run_until(self.world.clock.now_s + CRUISES_S)

    def _push(self) -> None:
        if self.ordered is not None:
            self.world.topics.publish("cmd_vel_joy", self.ordered)
        self.world.clock.after(JOYSTICK_S, self._push)

    def fork(self, twin: Twin, seed: int) -> Run:
        """One run in a copy of this process: the base goes on driving here."""
        reader, writer = os.pipe()
        pid = os.fork()
        if pid == 0:
            try:
                os.write(writer, pickle.dumps(self.run(twin, seed)))
            finally:
                os._exit(0)
        os.close(writer)
        with os.fdopen(reader, "rb") as pipe:
            told = pipe.read()
        os.waitpid(pid, 0)
        run = pickle.loads(told)
        assert isinstance(run, Run)
        return run

    def run(self, twin: Twin, seed: int) -> Run:
        """One run in this very world, which is spent then."""
        world, clock, random = self.world, self.world.clock, Random(f"{twin.key} {seed}")
        world.random.seed(seed)
        clock.run_until(clock.now_s + random.uniform(0.0, PHASE_S))
        watch = _Watch(self.world)
        twin.begin(world, self.around, random)
        if twin.then_zero_s:
            watch.look_for(twin.then_zero_s)
            self.ordered = ZERO
            watch.begin()
        watch.until_it_rests()
        return watch.run


class _Watch:
    """Looks at the ground truth, from now on."""

    def __init__(self, world: World) -> None:
        self._world, self._peak_mps, self._power_off_at = world, 0.0, math.inf
        self.begin()

    def begin(self) -> None:
        """What is measured begins now; the fastest wheel and the power are watched since this was made."""
        base = self._world.drives.bench.base
        self._began = self._moved_at = self._world.clock.now_s
        self._from_m = (base.x_m, base.y_m)

    def look_for(self, seconds: float) -> None:
        """Let time pass."""
        end = self._world.clock.now_s + seconds
        while self._world.clock.now_s < end - LOOK_S / 2.0:
            self._look()

    def until_it_rests(self) -> None:
        """Until it has been standing for a while, or LONGEST_S."""
        while self._world.clock.now_s < min(self._moved_at + RESTS_S, self._began + LONGEST_S):
            self._look()

    def _look(self) -> None:
        clock, drives = self._world.clock, self._world.drives.bench
        clock.run_until(clock.now_s + LOOK_S)
        rim_mps = max(abs(drives.base.v_left_mps), abs(drives.base.v_right_mps))
        self._peak_mps = max(self._peak_mps, rim_mps)
        if rim_mps > self._world.robot.base.standstill_mps:
            self._moved_at = clock.now_s
        if any(axis.motor.powered for node in drives.nodes.values() for axis in node.axes):
            self._power_off_at = math.inf
        else:
            self._power_off_at = min(self._power_off_at, clock.now_s)

    @property
    def run(self) -> Run:
        """What was seen."""
        base = self._world.drives.bench.base
        stood = self._world.clock.now_s >= self._moved_at + RESTS_S - LOOK_S
        distance_m = math.dist(self._from_m, (base.x_m, base.y_m))
        time_s = self._moved_at - self._began if stood else math.inf
        return Run(time_s, distance_m, self._power_off_at - self._began, self._peak_mps)


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
    runs: int, workers: int, twins: Sequence[Twin] = TWINS, rates: str = "standard"
) -> Iterator[tuple[Twin, list[Run]]]:
    """Each row in one of `workers` processes, in their order."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(workers, _begin, (rates,)) as pool:
        indexes = [TWINS.index(twin) for twin in twins]
        for index, found in zip(indexes, pool.imap(partial(_measure, runs), indexes), strict=True):
            yield TWINS[index], found


def _begin(rates: str) -> None:
    _cruises.update({by: Cruise(by, rates=rates) for by in (GOAL, JOYSTICK)})


def _measure(runs: int, index: int) -> list[Run]:
    twin = TWINS[index]
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
    twins = [twin for twin in TWINS if given.only in f"{twin.what}: {twin.how}"]
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
