"""What the guests have left: a table, and the part of docs/stop_times.md that `make vm-test` writes."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from exit_matrix.marked import rewritten

COMMAND = "make vm-test"
"""Names our part of the page."""
PAGE = Path(__file__).resolve().parents[2] / "docs" / "stop_times.md"
HEAD = """| what | how | who caught it | stood after | way | limit | again after | then |
|---|---|---|---:|---:|---:|---:|---|"""

Result = dict[str, Any]
"""A line of guest/main.py: name, failure, took_s, row."""


def results(job: Path) -> list[Result]:
    """What one guest has left, in its order; that it died, too."""
    rows = job / "rows.jsonl"
    found = [json.loads(line) for line in rows.read_text().splitlines()] if rows.exists() else []
    if not (job / "code").exists():
        died = f"the guest died or was too slow; see {job}/console.log and out.txt there"
        found.append({"name": job.name, "failure": died, "took_s": 0.0, "row": None})
    return found


def report(found: Sequence[Result], took_s: float, *, complete: bool) -> int:
    """Print it; write the page if it is complete and nothing failed. Exit code 0: all came out as promised."""
    for result in found:
        print(f"{result['name']}: {result['failure'] or _told(result['row'])} [{result['took_s']:.0f} s in the guest]")
    bad = [result for result in found if result["failure"]]
    print(f"{len(found)} scenarios, {len(bad)} failed, {took_s / 60.0:.1f} minutes", file=sys.stderr)
    if bad or not found:
        return 1
    if complete:
        table = "\n".join([HEAD, *(_line(result["row"]) for result in found)])
        PAGE.write_text(rewritten(PAGE.read_text(encoding="utf-8"), COMMAND, table), encoding="utf-8")
    return 0


def _told(row: dict[str, Any]) -> str:
    return ", ".join(cell for cell in _cells(row) if cell != "–")


def _line(row: dict[str, Any]) -> str:
    return f"| {' | '.join(_cells(row))} |"


def _cells(row: dict[str, Any]) -> Iterator[str]:
    yield from (row["what"], row["how"], row["caught"] or "–")
    yield _number(row["stands_s"], "{:.2f} s", 1.0)
    yield _number(row["way_m"], "{:.0f} mm", 1000.0)
    yield _number(row["limit_s"], "{:.2f} s", 1.0)
    yield _number(row["again_s"], "{:.1f} s", 1.0)
    yield row["then"]


def _number(value: float | None, form: str, factor: float) -> str:
    return "–" if value is None else form.format(value * factor)
