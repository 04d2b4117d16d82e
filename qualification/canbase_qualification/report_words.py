"""Times, distances, quantiles and commands as the report writes them."""

from __future__ import annotations

import math
import shlex

from canbase_qualification.hazard_figures import Run
from canbase_qualification.outcome import Outcome
from canbase_qualification.qualified import Setup
from canbase_qualification.statistics import SHARES, Distribution, runs_needed
from canbase_qualification.tally import OPTIONS, command

NOTHING = "—"
NEVER = "never"


def seconds(value: float) -> str:
    """A time."""
    return f"{value:.2f} s" if math.isfinite(value) else NEVER


def metres(value: float) -> str:
    """A distance."""
    return f"{value:.3f} m" if math.isfinite(value) else NEVER


def quantile_text(distribution: Distribution, name: str, metric: str) -> str:
    """One of SHARES; with too few runs a dash and how many it needs. `metric`: `time` or `distance`."""
    value = distribution.quantile(name)
    if value is None:
        return f"{NOTHING} (needs {runs_needed(SHARES[name]):,})"
    return seconds(value) if metric == "time" else metres(value)


def share(value: float) -> str:
    """Rounded down: it is a lower limit."""
    return f"{math.floor(1000.0 * value) / 10.0:.1f} %"


def plain(text: str) -> str:
    """A failure without an underscore: `driver_dies` as `driver dies`."""
    return text.replace("_", " ") or "ordinary stop"


def told_by(setup: Setup, outcome: Outcome) -> str:
    """The command that tells this run again step by step, in backquotes; of a drive, which has none, its seed."""
    told = command(outcome, shlex.quote(setup.robot_file), setup.load)
    return f"`{told}`" if outcome.kind in OPTIONS else told


def run(one: Run) -> str:
    """A measured stop with its robot."""
    stop = one.stop
    cause = f", stopped by {stop.cause}" if stop.cause else ""
    return f"{plain(stop.fault)} at {stop.speed_mps:.2f} m/s{cause}; {one.outcome.robot}"
