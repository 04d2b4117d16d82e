"""One scenario from its seed to its result. The world is booted once; each scenario runs in a forked copy of it."""

from __future__ import annotations

import gc
import os
import pickle
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field

from canbase_campaign.fault import PlannedFault
from canbase_campaign.faults import FAULTS
from canbase_campaign.judge import Judge, Violation
from canbase_campaign.outside import Outside, Surroundings
from canbase_campaign.planned import Plan
from canbase_campaign.robots import DrawnRobot
from canbase_campaign.scanner import LIES
from canbase_campaign.world import World

LOOK_S = 0.1
"""How often it is checked whether anything is still to come."""
QUIET_S = 0.3
"""A base that is latched and stands is watched for this long after the last fault, reset and goal; then that is all."""
GOALS_END_S = 12.0
"""So long a scenario goes on at least until its goals have ended; longer where robot.yaml leaves them more time."""


UPTIMES_S = (100.0, 100.0, 2.0**31 / 1000.0 - 5.0, 100.0, 2.0**32 / 1000.0 - 5.0, 3e8)
"""Monotonic time when a world begins: also just before 2³¹ and 2³² ms, and after ten years."""


@dataclass(frozen=True, slots=True)
class Result:
    """What came out of one scenario."""

    seed: int
    faults: tuple[str, ...]
    violations: tuple[Violation, ...] = ()
    trips: tuple[str, ...] = ()
    lives: int = 1
    """How often the base drove in it, with a reset between."""
    goals: tuple[str, ...] = ()
    moved_m: float = 0.0
    moving_s: float = 0.0
    excused_s: tuple[tuple[str, str, float], ...] = ()
    """Property, row of canbase_campaign.excuses, and seconds in motion in which it held by that row alone."""
    virtual_s: float = 0.0
    processor_s: float = field(default=0.0, compare=False)


def uptime_s(drawn: DrawnRobot | None) -> float:
    """How long the computer of this robot has been running [s]: one number of UPTIMES_S for each."""
    return UPTIMES_S[drawn.number % len(UPTIMES_S)] if drawn is not None else UPTIMES_S[0]


class Start:
    """A world that is enabled and at rest, from which the scenarios of one robot begin; those with a boot make one."""

    def __init__(self, drawn: DrawnRobot | None = None, boots: bool = False) -> None:
        """`drawn`: None: the sample robot. `boots`: the world is not enabled yet."""
        self._drawn, self._boots = drawn, boots
        self.world = World(drawn=drawn, uptime_s=uptime_s(drawn))
        self.around = Surroundings(self.world, has_scanner=self.world.robot.safety.scan.required)
        if boots:
            return
        self.world.enable()
        gc.collect()
        gc.freeze()

    def run(self, plan: Plan, note: Callable[[float, str], None] | None = None) -> Result:
        """Run one scenario in this very world, which is spent then; or in a new one, where it begins with a boot."""
        if plan.boots and not self._boots:
            return Start(self._drawn, boots=True).run(plan, note)
        began = time.process_time()
        run = _Run(self.world, self.around, plan, note)
        return run.result(time.process_time() - began)

    def fork(self, plan: Plan, prepare: Callable[[], None] | None = None) -> Result:
        """Run one scenario in a copy of this process: the world stays as it is. The copy does `prepare` before."""
        reader, writer = os.pipe()
        pid = os.fork()
        if pid == 0:
            os.close(reader)
            self._tell(plan, prepare, writer)
        os.close(writer)
        with os.fdopen(reader, "rb") as pipe:
            told = pipe.read()
        os.waitpid(pid, 0)
        if told:
            result = pickle.loads(told)
            assert isinstance(result, Result)
            return result
        lost = Violation("exception", 0.0, "the scenario's process died")
        return Result(plan.seed, tuple(fault.name for fault in plan.faults), (lost,))

    def _tell(self, plan: Plan, prepare: Callable[[], None] | None, writer: int) -> None:
        """The child's whole life; it never returns."""
        status = 1
        gc.disable()
        try:
            if prepare is not None:
                prepare()
            with os.fdopen(writer, "wb") as pipe:
                pipe.write(pickle.dumps(self.run(plan)))
            status = 0
        finally:
            os._exit(status)


class _Run:
    """One scenario in one world."""

    def __init__(
        self, world: World, around: Surroundings, plan: Plan, note: Callable[[float, str], None] | None
    ) -> None:
        self._world, self._around, self._plan = world, around, plan
        self._start = world.clock.now_s
        world.random.seed(plan.seed)
        world.bus.bitrate = plan.bitrate
        if note is not None:
            world.note = lambda text: note(world.clock.now_s - self._start, text)
        self._moved_from_m = world.drives.bench.base.path_m
        if any(fault.name in LIES for fault in plan.faults):
            around.look_closely()
        outside = Outside(world, around, plan, self._start)
        self._judge = Judge(world, around, outside, plan)
        for fault in plan.faults:
            world.clock.at(self._start + fault.start_s, self._begin, fault)
            world.clock.at(self._start + fault.start_s + fault.duration_s, self._end, fault)
        last_s = max(
            0.0,
            *(fault.start_s + fault.duration_s for fault in plan.faults),
            *plan.resets_s,
            *(goal.start_s for goal in plan.goals),
        )
        self._quiet_at = self._start + last_s + QUIET_S
        self._crash = self._play()

    def _begin(self, fault: PlannedFault) -> None:
        self._world.note(f"fault begins: {fault}")
        FAULTS[fault.name].begin(self._world, self._around, fault.arguments)

    def _end(self, fault: PlannedFault) -> None:
        self._world.note(f"fault ends: {fault.name}")
        FAULTS[fault.name].end(self._world, self._around, fault.arguments)

    def _play(self) -> tuple[Violation, ...]:
        clock, end = self._world.clock, self._start + self._plan.duration_s
        try:
            while clock.now_s < end and not self._is_over():
                clock.run_until(clock.now_s + LOOK_S)
            while self._goals_run() and clock.now_s < end + max(GOALS_END_S, self._judge.longest_goal_s):
                clock.run_until(clock.now_s + LOOK_S)
            self._judge.finish()
        except Exception:  # noqa: BLE001 - whatever it is: that nothing raises is one of the properties
            return (Violation("exception", clock.now_s - self._start, traceback.format_exc(limit=-4)),)
        return ()

    def _is_over(self) -> bool:
        return self._world.clock.now_s > self._quiet_at and self._judge.at_rest

    def _goals_run(self) -> bool:
        return any(not goal.ends and not goal.died for goal in self._world.action.goals)

    def result(self, processor_s: float) -> Result:
        """The result of the whole."""
        ends = [end.code.name for goal in self._world.action.goals for end in goal.ends]
        return Result(
            self._plan.seed,
            tuple(fault.name for fault in self._plan.faults),
            (*self._judge.violations, *self._crash),
            tuple(self._judge.trips),
            self._judge.lives,
            tuple(ends),
            self._world.drives.bench.base.path_m - self._moved_from_m,
            self._judge.ledger.moving_s,
            tuple((*key, seconds) for key, seconds in self._judge.ledger.excused_s.items()),
            self._world.clock.now_s - self._start,
            processor_s,
        )
