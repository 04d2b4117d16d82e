"""Measured figures in the sentences of pages: `<!-- figure NAME -->320 MB<!-- end -->`, from the file of a benchmark.

`make structure` writes them, and a test compares them with what was measured.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

_MARK = re.compile(r"(<!-- figure (?P<name>[^>]*?) -->)[^<]*(<!-- end -->)")
_GOALS = "### drive_distance\n"


def figures(root: Path) -> dict[str, str]:
    """Text by the name of the figure. Raises KeyError, ValueError or AttributeError when a source lacks one."""
    measured = _benchmarks(root)
    goals = _row((root / "docs" / "odometry.md").read_text(encoding="utf-8").partition(_GOALS)[2], "canbase")
    teeth = json.loads((root / "virtual_bus_tests" / "campaign" / "teeth.json").read_text(encoding="utf-8"))
    scores = json.loads((root / "virtual_bus_tests" / "campaign" / "scores.json").read_text(encoding="utf-8"))
    whole_chain = _number(measured["whole chain: processor while a goal drives"])
    reaction = re.search(r"p99 ([\d.]+)", measured[next(what for what in measured if what.startswith("mux, filter, "))])
    return {
        "chain processor": f"{round(whole_chain)} %",
        "chain memory": measured["whole chain: memory"],
        "reaction p99": f"{_number(reaction[1] if reaction else ''):.0f} ms",
        "goal error": f"{goals['error max']} mm",
        "goal too fast": f"{goals['too fast, max [mm/s]']} mm/s",
        **{f"{name} score": score for name, score in scores.items()},
        "teeth": f"{sum(not row['property'] for row in teeth)} of {len(teeth)}",
    }


def pages(root: Path) -> dict[Path, str]:
    """The pages that have figures, with those of `figures`. Raises KeyError for a name that is none."""
    known = figures(root)
    return {path: _filled(text, known) for path, text in _texts(root) if _MARK.search(text)}


def write(root: Path) -> None:
    """Puts the figures into the pages."""
    for path, text in pages(root).items():
        path.write_text(text, encoding="utf-8")


def _filled(text: str, known: dict[str, str]) -> str:
    return _MARK.sub(lambda found: f"{found[1]}{known[found['name']]}{found[3]}", text)


def _texts(root: Path) -> Iterator[tuple[Path, str]]:
    for path in (root / "README.md", *sorted((root / "docs").glob("*.md"))):
        yield path, path.read_text(encoding="utf-8")


def _benchmarks(root: Path) -> dict[str, str]:
    kept = json.loads((root / "benchmarks" / "kept.json").read_text(encoding="utf-8"))
    return {figure["what"]: figure["measured"] for figure in kept["figures"]}


def _row(text: str, first: str) -> dict[str, str]:
    """The row of the first table whose first cell is this, by the names of its columns."""
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    return dict(zip(lines[0], next(cells for cells in lines if cells[0] == first), strict=True))


def _number(text: str) -> float:
    return float(text.partition("%")[0])
