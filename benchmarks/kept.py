"""The figures of a run as JSON, from which pages take theirs, and which of a later run are worse.

A ratio depends little on the computer.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from figures import Figure


def machine() -> str:
    """This computer, as pages name it."""
    return f"{os.cpu_count()} processors ({platform.machine()}), Python {platform.python_version()}"


def write(path: Path, figures: Sequence[Figure]) -> None:
    """By what was measured. Those of an earlier run that this one did not measure stay."""
    found = {figure.what: figure for figure in (*(read(path)[1] if path.exists() else ()), *figures)}
    text = json.dumps(
        {"machine": machine(), "figures": [asdict(figure) for figure in found.values()]}, indent=1, ensure_ascii=False
    )
    path.write_text(f"{text}\n", encoding="utf-8")


def read(path: Path) -> tuple[str, list[Figure]]:
    """The computer, and the figures that `write` has kept. Raises ValueError for any other file."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return str(kept["machine"]), [Figure(**figure) for figure in kept["figures"]]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path} was not written by `canbase prove benchmark --json`: {error!r}") from error


def ratios(path: Path) -> Mapping[str, float]:
    """The ratios of `read`, by what was measured."""
    return {figure.what: figure.ratio for figure in read(path)[1] if figure.ratio is not None}


def losses(figures: Sequence[Figure], before: Mapping[str, float]) -> list[str]:
    """A sentence for each ratio that is worse than before by more than its noise."""
    found = []
    for figure in figures:
        ratio, earlier = figure.ratio, before.get(figure.what)
        if ratio is None or earlier is None:
            continue
        worse_by = (earlier / ratio if figure.more_is_better else ratio / earlier) - 1.0
        if worse_by > figure.noise:
            told = f"{figure.what}: ratio {ratio:.3g}, it was {earlier:.3g}"
            found.append(f"{told}: worse by {worse_by:.0%}, of which {figure.noise:.0%} may be noise")
    return found
