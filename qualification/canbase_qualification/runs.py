"""Carries out one batch in this process: boots a world with its body, and forks it once for each run.

The same batch gives the same outcomes everywhere: nothing here knows what ran before. A process with threads must not
call it, because a forked run has none of them: `worker.py` is a process of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Final

from canbase_campaign.cruise import Cruise, Run, RunError
from canbase_campaign.plan import plan_for
from canbase_campaign.planned import Plan
from canbase_campaign.robots import GRAVITY_MPS2, DrawnRobot, body_for
from canbase_campaign.scenario import Start
from canbase_campaign.twins import GOAL, JOYSTICK, Twin
from canbase_qualification.driving import drive
from canbase_qualification.job import DRIVES_S, FAILURES, Batch, Job
from canbase_qualification.outcome import DRIVING, SCENARIO, STOP, MeasuredStop, Outcome, Violation
from canbase_qualification.simulated_robot import OF_GOALS
from canbase_sim.personality import GENERIC, PERSONALITIES

OWN_PROPERTIES: Final = {
    "stops": "after each single failure the base comes to a stand",
    "undisturbed": "a robot with which nothing is wrong is not stopped",
}
"""Beside those of canbase_campaign.properties: of stops, and of driving."""
ENOUGH: Final = 0.95
"""Of the ordered speed: a base this fast drives at it."""
NO_OWN_WATCH: Final = "; drives of this kind do not stop by themselves, so STO alone stops them: wire a safety relay"


def run(job: Job, batch: Batch) -> Iterator[Outcome]:
    """The outcomes of a batch, in the order of its seeds. RuntimeError: its drives cannot be enabled."""
    yield from _KINDS[batch.kind](job, batch, body(job, batch.body))


def body(job: Job, number: int) -> DrawnRobot:
    """The robot with the body of this number, on its slope."""
    return body_for(number, job.robot, job.load.payloads, job.load.slope)


def scenario_plan(job: Job, seed: int) -> Plan:
    """What happens in a scenario."""
    return plan_for(job.robot, seed, (job.robot.bus.bitrate,), job.faults)


def full_mps(job: Job, by: str = JOYSTICK) -> float:
    """The speed that is ordered before a failure."""
    fastest_mps = job.robot.limits.linear_mps
    return min(fastest_mps, job.robot.action.max_speed_mps) if by == GOAL else fastest_mps


def trial(job: Job, number: int) -> tuple[float, str]:
    """What the base drives when the joystick orders full speed [m/s], and why it is no faster; empty: it is.

    RuntimeError: its drives cannot be enabled.
    """
    world = Cruise(JOYSTICK, full_mps(job), body(job, number)).world
    decision, speed_mps = world.velocity.decision, abs(world.drives.bench.base.v_mps)
    if speed_mps >= ENOUGH * full_mps(job):
        return speed_mps, ""
    return speed_mps, f"{decision.cause.value}: {decision.detail}" if decision else "nothing was ordered"


def _empty(kind: str, seed: int, drawn: DrawnRobot) -> Outcome:
    b, wheels = drawn.body, len(drawn.robot.drives)
    slope = drawn.push_n / (GRAVITY_MPS2 * b.mass_kg * b.payload_factor)
    about = (
        f"{b.mass_kg:g} kg × {b.payload_factor:.2f}, slope {slope:+.1%}, {wheels} motors of {b.peak_force_n:g} N, "
        f"dry friction {b.coulomb_n:g} N a wheel"
    )
    return Outcome(kind, seed, about, round(b.payload_factor, 4), round(slope, 4) + 0.0)


def _scenarios(job: Job, batch: Batch, drawn: DrawnRobot) -> Iterator[Outcome]:
    start = Start(drawn)
    for seed in batch.seeds:
        result = start.fork(scenario_plan(job, seed))
        yield replace(
            _empty(SCENARIO, seed, drawn),
            faults=result.faults,
            violations=tuple(Violation(each.name, round(each.at_s, 4), each.detail) for each in result.violations),
            trips=result.trips,
            virtual_s=result.virtual_s,
            moved_m=result.moved_m,
        )


def _stops(job: Job, batch: Batch, drawn: DrawnRobot) -> Iterator[Outcome]:
    cruises: dict[str, Cruise] = {}
    for seed in batch.seeds:
        failure = by_joystick(FAILURES[seed % len(FAILURES)])
        if failure.by not in cruises:
            cruises[failure.by] = Cruise(failure.by, full_mps(job, failure.by), drawn)
        yield _stop(cruises[failure.by], failure, _empty(STOP, seed, drawn))


def by_joystick(failure: Twin) -> Twin:
    """The same failure while a joystick orders full speed, where it stops a base then as well."""
    return failure if failure.what in OF_GOALS else replace(failure, by=JOYSTICK)


def _stop(cruise: Cruise, failure: Twin, empty: Outcome) -> Outcome:
    name = f"{failure.what}: {failure.how}" if failure.what else ""
    empty = replace(empty, faults=(name,) if name else ())
    try:
        run = cruise.fork(failure, empty.seed)
    except RunError as error:
        return replace(empty, violations=(Violation("exception", 0.0, str(error)),))
    stop = MeasuredStop(name, run.cause, run.speed_mps, run.time_s, run.distance_m, run.power_off_s, run.peak_mps)
    goes_on = () if math.isfinite(run.time_s) else (Violation("stops", 0.0, _goes_on(cruise, run)),)
    return replace(empty, violations=goes_on, stops=(stop,))


def _goes_on(cruise: Cruise, run: Run) -> str:
    kind = PERSONALITIES.get(cruise.world.robot.drives[0].profile, GENERIC)
    alone = kind.alone_s(cruise.world.robot.timeouts.drive_heartbeat_s) < math.inf
    return f"it did not come to a stand from {run.speed_mps:.2f} m/s{'' if alone else NO_OWN_WATCH}"


def _drives(job: Job, batch: Batch, drawn: DrawnRobot) -> Iterator[Outcome]:
    for seed in batch.seeds:
        yield drive(_empty(DRIVING, seed, drawn), drawn, job.load.slope, DRIVES_S)


_KINDS: Final[Mapping[str, Callable[[Job, Batch, DrawnRobot], Iterator[Outcome]]]] = {
    STOP: _stops,
    SCENARIO: _scenarios,
    DRIVING: _drives,
}
