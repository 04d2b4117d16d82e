"""`make nightly`: seeds that never ran before, drawn from the date, and Hypothesis with new examples.

Prints the first seed, and for each failure one command that repeats it. Exit code 1: something failed. `--date` repeats
a night, `--share` runs a part of it.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timezone
from pathlib import Path

from campaign import odd, regressions, soak
from campaign.regressions import repeats
from canbase_campaign.runner import run
from canbase_campaign.scanner import LIES
from canbase_campaign.sensor_faults import SENSOR_FAULTS

FIRST_DAY, FIRST_SEED, SEEDS_A_NIGHT = date(2026, 11, 26), 1_000_000, 10_000
"""No two nights have a seed in common, nor one with reports before."""
SCENARIOS, SCENARIOS_WITH_LIES, ROBOTS, SOAKED = 2000, 500, 300, 60
"""Scenarios of the campaign, those of sensors that lie, robots with odd drives, and robots of soak.RUN_S each."""
WORKERS = 2
TESTS = Path(__file__).parents[1]
FAILED = re.compile(r"^FAILED (\S+)", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Night:
    """`first`: its first seed. `share`: of its scenarios and robots, 0 to 1."""

    first: int
    share: float = 1.0

    def seeds(self, count: int) -> range:
        """So many, or the share of them, at least one."""
        return range(self.first, self.first + max(1, round(self.share * count)))


def first_seed(day: date) -> int:
    """Of the night of this day."""
    return FIRST_SEED + SEEDS_A_NIGHT * (day - FIRST_DAY).days


def _campaign(night: Night, count: int, only: Sequence[str] = ()) -> Iterator[str]:
    for seed, violation in run(night.seeds(count), WORKERS, only).violations:
        yield f"{violation.name}: {repeats(seed, tuple(only))}"


def scenarios(night: Night) -> Iterator[str]:
    """Faults of all kinds."""
    return _campaign(night, SCENARIOS)


def lies(night: Night) -> Iterator[str]:
    """Sensors that lie, and nothing else."""
    return _campaign(night, SCENARIOS_WITH_LIES, sorted(SENSOR_FAULTS.keys() | LIES.keys()))


def named(night: Night) -> Iterator[str]:
    """What failed before."""
    return (f"{row.name}: {row.command}" for row in regressions.load() if not row.open and row.run().violations)


def odd_drives(night: Night) -> Iterator[str]:
    """Each drives 1 m, or its message helps."""
    return (f"{trial.wrong[0]}: make odd SEED={trial.seed}" for trial in odd.trials(night.seeds(ROBOTS)) if trial.wrong)


def ordinary(night: Night) -> Iterator[str]:
    """Driving without a fault: each trip is a false one."""
    for driven in soak.drive_all(night.seeds(SOAKED), soak.RUN_S, WORKERS):
        if driven.trip is not None:
            yield f"{driven.trip.what}: make soak SEED={driven.seed}"


def explained(night: Night) -> Iterator[str]:
    """`canbase explain` on recordings whose truth is known: no wrong claim at all."""
    from campaign import explain_score  # which draws its seeds as this module does

    wrong = [answer for answer in explain_score.answers(night.seeds(explain_score.SCENARIOS)) if answer.wrong]
    for answer in wrong:
        yield f"{answer.wrong[0]}: python -m campaign.explain_score --seed {answer.seed}"


def doctored(night: Night) -> Iterator[str]:
    """`canbase doctor` before robots whose truth is known: nothing that is well is accused."""
    from campaign import doctor_score

    for answer in doctor_score.answers(night.seeds(doctor_score.ROBOTS)):
        if answer.wrong:
            yield f"{answer.wrong[0]}: python -m campaign.doctor_score --seed {answer.seed}"


def examples(night: Night) -> Iterator[str]:
    """Hypothesis: new examples, and each failing one as short as it can be."""
    files = [str(path) for path in sorted(TESTS.rglob("test_*.py")) if "hypothesis" in path.read_text(encoding="utf-8")]
    command = ["pytest", "-q", "-rf", "--numprocesses", str(WORKERS), f"--hypothesis-seed={night.first}"]
    own_time = [path for path in files if not {"bus", "ros", "vm"} & set(Path(path).relative_to(TESTS).parts)]
    with_profile = {**os.environ, "HYPOTHESIS_PROFILE": "nightly"}
    done = subprocess.run([*command, *own_time], env=with_profile, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stdout[-20_000:], done.stderr[-5_000:], sep="\n")
    for test in FAILED.findall(done.stdout) or ([""] if done.returncode else []):
        yield f"HYPOTHESIS_PROFILE=nightly pytest --hypothesis-seed={night.first} {test}"


STEPS: dict[str, Callable[[Night], Iterator[str]]] = {
    "campaign": scenarios,
    "lies": lies,
    "regressions": named,
    "odd": odd_drives,
    "soak": ordinary,
    "explain": explained,
    "doctor": doctored,
    "hypothesis": examples,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """The night of today, or of a date."""
    parser = argparse.ArgumentParser(prog="campaign.nightly", description=__doc__)
    parser.add_argument("--date", type=date.fromisoformat, default=datetime.now(timezone.utc).date())
    parser.add_argument("--share", type=float, default=1.0, help="of the scenarios and robots, 0 to 1")
    parser.add_argument("--only", choices=STEPS, action="append", help="this step; may be repeated")
    given = parser.parse_args(arguments)
    night = Night(first_seed(given.date), given.share)
    print(f"the night of {given.date}: seeds from {night.first} on", flush=True)
    failures = 0
    for name in given.only or STEPS:
        count = 0
        for failure in STEPS[name](night):
            count += 1
            print(f"{name}: FAILED: {failure}", flush=True)
        print(f"{name}: {count} failures", flush=True)
        failures += count
    if failures:
        print("a seed that fails becomes a row of virtual_bus_tests/campaign/regressions.yaml")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
