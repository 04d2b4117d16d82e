"""`python -m campaign.regressions`: the scenarios of regressions.yaml again. Exit code 1: a property did not hold."""

from __future__ import annotations

import sys
from pathlib import Path

from pydantic import BaseModel, ConfigDict, TypeAdapter
from ruamel.yaml import YAML

from canbase_campaign.faults import FAULTS
from canbase_campaign.plan import draw_plan
from canbase_campaign.properties import PROPERTIES
from canbase_campaign.runner import start_of
from canbase_campaign.scenario import Result

FILE = Path(__file__).with_suffix(".yaml")


class Regression(BaseModel):
    """One row: a scenario, and the property that it violated, where that was noted."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    seed: int
    violated: str = ""
    from_rest: bool = False
    faults: tuple[str, ...] = ()
    open: str = ""
    """Why it still violates; empty: it holds."""

    def run(self) -> Result:
        """The scenario, in a copy of this process."""
        return start_of(self.seed).fork(draw_plan(self.seed, self.faults, self.from_rest))

    @property
    def command(self) -> str:
        """That tells it step by step."""
        return repeats(self.seed, self.faults, self.from_rest)


def repeats(seed: int, faults: tuple[str, ...] = (), from_rest: bool = False) -> str:
    """The command that tells a scenario step by step."""
    given = "".join(f" --fault {fault}" for fault in faults) + " --from-rest" * from_rest
    return f"python -m campaign --seed {seed}{given}" if given else f"make campaign SEED={seed}"


def load() -> list[Regression]:
    """All rows. Raises ValueError: one names a property or a fault that does not exist."""
    rows = TypeAdapter(list[Regression]).validate_python(YAML(typ="safe").load(FILE.read_text(encoding="utf-8")))
    for row in rows:
        if row.violated not in {"", *PROPERTIES} or not set(row.faults) <= FAULTS.keys():
            raise ValueError(f"{FILE.name}: seed {row.seed} names a property or a fault that does not exist")
    return rows


def open_ones() -> set[tuple[int, str]]:
    """Seed and property of each row of the campaign that still violates."""
    return {(row.seed, row.violated) for row in load() if row.open and not row.faults and not row.from_rest}


def main() -> int:
    """Each row with what it shows now."""
    failed = 0
    for row in load():
        violations = row.run().violations
        failed += bool(violations) and not row.open
        print(f"{row.seed}, {row.name}: {', '.join(each.name for each in violations) or 'holds'} {row.open}")
        if violations:
            print(f"  {row.command}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
