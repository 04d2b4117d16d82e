"""What the guests have left: a table, and the part of docs/stop_times.md that `make vm-test` writes."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from exit_matrix.page_table import NOTHING, Key, PageTable, Row
from support.marked_page import rewritten, section
from vm.guest.main import BEGINS

COMMAND = "make vm-test"
"""Names our part of the page."""
PAGE = Path(__file__).resolve().parents[2] / "docs" / "stop_times.md"
MEASURED = "measured"
FAILED = "; failed "
TABLE = PageTable(
    ("scenario",),
    ("what", "how", "who caught it", "stood after", "distance", "limit", "again after", "then", MEASURED),
    ("what", "how", "who caught it", "then", MEASURED),
)

Result = dict[str, Any]
"""A line of guest/main.py: name, failure, took_s, row."""
ROW_BEGINS = '{"name": '
LAST_LINES = 25


def results(job: Path, wanted: Sequence[str], ended: str = "") -> list[Result]:
    """What one guest has left, in its order, from its live output. Each of `wanted` that came to no end is a failure;
    `ended`: why the host has ended the guest, if it had to."""
    out = job / "out.txt"
    lines = out.read_text(errors="replace").splitlines() if out.exists() else []
    found = [json.loads(line) for line in lines if line.startswith(ROW_BEGINS)]
    told = {result["name"] for result in found}
    begun = {line.removeprefix(BEGINS) for line in lines if line.startswith(BEGINS)}
    why = f": {ended}" if ended else ""
    for name in [name for name in wanted if name not in told]:
        found.append(_failed(name, f"began and came to no end{why}" if name in begun else f"was not reached{why}"))
    if not (job / "code").exists():
        found.append(_failed(job.name, f"the guest died{why}"))
    return found


def last_words(job: Path) -> str:
    """The end of what a guest has said, on its two serial ports."""
    files = [job / "console.log", job / "out.txt", job / "journal.txt"]
    tails = {file: file.read_text(errors="replace").splitlines()[-LAST_LINES:] for file in files if file.exists()}
    return "\n".join(line for file, tail in tails.items() for line in (f"---- the end of {file}", *tail))


def _failed(name: str, failure: str) -> Result:
    return {"name": name, "failure": failure, "took_s": 0.0, "row": None}


def report(found: Sequence[Result], took_s: float, skipped: Mapping[str, str]) -> int:
    """Print it. Exit code 0: every scenario that ran came out as promised, and one did run. `skipped`: by name, why."""
    for result in found:
        print(f"{result['name']}: {result['failure'] or _told(result['row'])} [{result['took_s']:.0f} s in the guest]")
    for name, why in skipped.items():
        print(f"SKIPPED, nothing is known of it: {name}: {why}")
    bad = [result for result in found if result["failure"]]
    counts = f"{len(found)} scenarios, {len(bad)} failed, {len(skipped)} skipped"
    print(f"{counts}, {took_s / 60.0:.1f} minutes", file=sys.stderr)
    return int(bool(bad) or not found)


def write(page: Path, found: Sequence[Result], names: Sequence[str], today: str) -> None:
    """Our part of the page: a row of `found` takes the place of the one before, all others stay, with their dates.

    A scenario that failed keeps the figures that it had, and says when it failed. Rows whose name is none of `names`,
    all scenarios in their order, are of scenarios that are gone.
    """
    text = page.read_text(encoding="utf-8")
    old = TABLE.rows(section(text, COMMAND))
    known: dict[Key, Row] = {(name,): old[name,] for name in names if (name,) in old}
    now_s: dict[Key, Row] = {
        (result["name"],): _row(result, known, today) for result in found if result["name"] in names
    }
    merged = TABLE.merged(TABLE.merged("", known), now_s, [(name,) for name in names])
    page.write_text(rewritten(text, COMMAND, merged), encoding="utf-8")


def _row(result: Result, known: Mapping[Key, Row], today: str) -> Row:
    if not result["failure"]:
        return dict(zip(TABLE.columns, (*_cells(result["row"]), today), strict=True))
    before = known.get((result["name"],), {}).get(MEASURED, NOTHING).partition(FAILED)[0]
    return {MEASURED: f"{before}{FAILED}{today}"}


def _told(row: dict[str, Any]) -> str:
    return ", ".join(cell for cell in _cells(row) if cell != NOTHING)


def _cells(row: dict[str, Any]) -> Iterator[str]:
    yield from (row["what"], row["how"], row["caught"] or NOTHING)
    yield _number(row["stands_s"], "{:.2f} s", 1.0)
    yield _number(row["way_m"], "{:.0f} mm", 1000.0)
    yield _number(row["limit_s"], "{:.2f} s", 1.0)
    yield _number(row["again_s"], "{:.1f} s", 1.0)
    yield row["then"]


def _number(value: float | None, form: str, factor: float) -> str:
    return NOTHING if value is None else form.format(value * factor)
