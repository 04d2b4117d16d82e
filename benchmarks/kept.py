"""The ratios of a run as JSON, and which of a later run are worse. A ratio depends little on the computer."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path

from figures import Figure


def write(path: Path, figures: Sequence[Figure]) -> None:
    """By what was measured. Those of an earlier run that this one did not measure stay."""
    found = dict(read(path)) if path.exists() else {}
    found |= {figure.what: figure.ratio for figure in figures if figure.ratio is not None}
    machine = f"{os.cpu_count()} processors ({platform.machine()}), Python {platform.python_version()}"
    text = json.dumps({"machine": machine, "ratios": found}, indent=2, ensure_ascii=False)
    path.write_text(f"{text}\n", encoding="utf-8")


def read(path: Path) -> Mapping[str, float]:
    """The ratios that `write` has kept, by what was measured. Raises ValueError for any other file."""
    try:
        ratios = json.loads(path.read_text(encoding="utf-8"))["ratios"]
        return {str(what): float(ratio) for what, ratio in ratios.items()}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path} was not written by `canbase prove benchmark --json`: {error!r}") from error


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
