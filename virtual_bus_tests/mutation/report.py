"""What the last run found: `report.json`, with the hash of each source that it holds for; and why survivors may live.

`explained.yaml`: `because` for groups of survivors, each named by its module and its lines before and after.
`unmeasured.yaml`: modules whose mutants were not tried since they changed; the report does not contain them.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from ruamel.yaml import YAML

from mutation.targets import TARGETS

HERE = Path(__file__).parent
REPORT, EXPLAINED, UNMEASURED = HERE / "report.json", HERE / "explained.yaml", HERE / "unmeasured.yaml"


@dataclass(frozen=True, slots=True)
class Survivor:
    """A mutant that no test noticed."""

    operator: str
    line: int
    before: str
    after: str


@dataclass(frozen=True, slots=True)
class Entry:
    """The result of one module."""

    sha256: str
    mutants: int
    survivors: tuple[Survivor, ...]


Report = dict[str, Entry]
"""By dotted name of the module."""


def load() -> Report:
    """The committed report; empty when there is none."""
    if not REPORT.exists():
        return {}
    entries = json.loads(REPORT.read_text(encoding="utf-8"))
    return {
        module: Entry(entry["sha256"], entry["mutants"], tuple(Survivor(**each) for each in entry["survivors"]))
        for module, entry in entries.items()
    }


def save(report: Report) -> None:
    """Write the report, modules in the order of `TARGETS`."""
    listed = {target.module: asdict(report[target.module]) for target in TARGETS if target.module in report}
    REPORT.write_text(json.dumps(listed, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def outdated(report: Report) -> list[str]:
    """Modules whose sources are not the ones that the report is about."""
    return [
        target.module
        for target in TARGETS
        if target.module not in report or report[target.module].sha256 != target.sha256
    ]


def unmeasured() -> list[str]:
    """Modules that `unmeasured.yaml` admits to be untried since they changed."""
    return [str(module) for module in YAML(typ="safe").load(UNMEASURED) or []]


def explanations() -> dict[tuple[str, str, str], str]:
    """Why it is no gap that a mutant lives: (module, before, after) → because."""
    groups = YAML(typ="safe").load(EXPLAINED) or []
    return {
        (group["module"], mutant["before"], mutant["after"]): str(group["because"])
        for group in groups
        for mutant in group["mutants"]
    }


def unexplained(report: Report) -> list[tuple[str, Survivor]]:
    """Survivors without an explanation, with their module."""
    known = explanations()
    return [
        (module, survivor)
        for module, entry in report.items()
        for survivor in entry.survivors
        if (module, survivor.before, survivor.after) not in known
    ]
