"""The result of a benchmark, and how a set of durations is reported. And sections of pages that benchmarks write."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

MS = 1000.0


NOISE = 0.25
"""Two runs of one benchmark on one computer differ by this part of their ratio, unless a figure has its own noise."""


@dataclass(frozen=True, slots=True)
class Figure:
    """One line of docs/performance.md. `beside`: the floor or the peer that was measured in the same run."""

    what: str
    measured: str
    beside: str
    ratio: float | None
    budget: str
    kept: bool
    more_is_better: bool = False
    """Of the ratio."""
    noise: float = NOISE
    """By how much of itself the ratio differs between two runs when nothing was changed."""


def quantile(values: Sequence[float], share: float) -> float:
    """The value below which that share of them lies. Raises IndexError without any."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def spread(values_s: Sequence[float]) -> str:
    """p50, p99 and maximum of durations [s], in ms."""
    p50, p99, most = (quantile(values_s, share) * MS for share in (0.5, 0.99, 1.0))
    return f"p50 {p50:.2f}, p99 {p99:.2f}, max {most:.2f} ms"


def raise_priority(priority: int) -> None:
    """SCHED_FIFO for this thread, as the processes of the chain have it; without the right to it, nothing."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        print(f"no real-time priority: {error}")


def replace_section(page: Path, text: str) -> None:
    """`text` in place of the section of `page` with the same heading, its first line."""
    before, heading, old = page.read_text(encoding="utf-8").partition(f"{text.splitlines()[0]}\n")
    if not heading:
        raise ValueError(f"{page} has no line {text.splitlines()[0]!r}: the section goes there")
    after = min((old.find(mark) for mark in ("\n## ", "\n### ") if mark in old), default=len(old))
    page.write_text(before + text + old[after:], encoding="utf-8")
