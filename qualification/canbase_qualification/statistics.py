"""Order statistics of what many runs measured, and how far so many runs can be trusted. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

SHARES: Final = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}
"""The quantiles of the report."""
CONFIDENCE: Final = 0.95


@dataclass(frozen=True, slots=True)
class Distribution:
    """Of one quantity over the runs of one failure, in its own unit. Infinity: it never came to an end."""

    values: tuple[float, ...]
    """In ascending order; at least one."""

    @classmethod
    def of(cls, values: Sequence[float]) -> Distribution:
        """Raises ValueError without a value."""
        if not values:
            raise ValueError("a distribution needs at least one value")
        return cls(tuple(sorted(values)))

    @property
    def greatest(self) -> float:
        """The worst of the runs."""
        return self.values[-1]

    def quantile(self, name: str) -> float | None:
        """One of SHARES; None: there are fewer runs than `runs_needed`, and the greatest value would stand for it."""
        return quantile(self.values, SHARES[name]) if len(self.values) >= runs_needed(SHARES[name]) else None


def covered_share(draws: int) -> float:
    """With CONFIDENCE, at least this share of all such draws is not beyond the greatest one of `draws` ones.

    The one-sided tolerance limit without an assumed distribution (Wilks 1941): 1 - confidence = share ** draws.
    """
    return math.pow(1.0 - CONFIDENCE, 1.0 / draws)


def quantile(ordered: Sequence[float], share: float) -> float:
    """The least of the `ordered` values that `share` of them do not exceed (nearest rank)."""
    return ordered[max(0, math.ceil(share * len(ordered) - 1e-9) - 1)]


def runs_needed(share: float) -> int:
    """From so many runs on at least one of them is expected beyond this quantile: 2, 100, 1000 for SHARES."""
    return math.ceil(1.0 / (1.0 - share) - 1e-6)


def runs_covering(share: float) -> int:
    """From so many independent runs on the greatest one covers this share with CONFIDENCE: 299 for 99 %."""
    return math.ceil(math.log(1.0 - CONFIDENCE) / math.log(share))


def thinned(ordered: Sequence[float], most: int, tail: int = 10) -> tuple[float, ...]:
    """About `most` of the `ordered` values, evenly by rank, and the `tail` greatest ones: enough to draw them."""
    count = len(ordered)
    if count <= most + tail:
        return tuple(ordered)
    ranks = {round(step * (count - 1) / (most - 1)) for step in range(most)} | set(range(count - tail, count))
    return tuple(ordered[rank] for rank in sorted(ranks))
