"""One run as a log: a scenario with everything that happens in it, or a single failure until the base stands."""

from __future__ import annotations

import math
from collections.abc import Callable

from canbase_campaign.cruise import Cruise
from canbase_campaign.replay import replay, tell
from canbase_qualification.job import A_BODY, FAILURES, Job
from canbase_qualification.runs import body, by_joystick, full_mps, scenario_plan

Say = Callable[[str], None]


def log_scenario(job: Job, seed: int, say: Say, *, frames: bool) -> bool:
    """Whether every property held."""
    return not replay(body(job, seed // A_BODY), scenario_plan(job, seed), frames, say).violations


def log_stop(job: Job, seed: int, say: Say, *, frames: bool) -> bool:
    """Whether the base came to a stand. Times count from when the base drove steadily."""
    number, place = divmod(seed, len(FAILURES))
    failure, drawn = by_joystick(FAILURES[place]), body(job, number)
    say(f"stop {seed}: {failure.what or 'the source orders zero'}{': ' if failure.how else ''}{failure.how}")
    say(str(drawn))
    cruise = Cruise(failure.by, full_mps(job, failure.by), drawn)
    tell(cruise.world, frames, lambda at_s, text: say(f"{at_s:8.4f} {text}"))
    run = cruise.run(failure, seed)
    stood = math.isfinite(run.time_s)
    ends = f"at standstill after {run.time_s:.3f} s" if stood else "it goes on"
    power = f"without power after {run.power_off_s:.3f} s" if math.isfinite(run.power_off_s) else "with power"
    say(f"from {run.speed_mps:.3f} m/s: {ends}, {run.distance_m:.3f} m, {power}; {run.cause or 'no part stopped it'}")
    return stood
