"""Which points of a scan count: dust, rain and mixed pixels are seen once and alone. Delays a stop by one scan at most.

Rules:
1. Neighbouring beams that hit within `NEIGHBOUR_M` of each other are a group. One of min_points beams counts at once.
2. A smaller group counts when the scan before had any point where it can have been then, or when there was none.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canbase_velocity.clearance import Points
from canbase_velocity.sweep import Bools, Floats

NEIGHBOUR_M = 0.1
"""Two hits of neighbouring beams that are nearer to each other are of one thing [m]."""


class GlitchFilter:
    """Remembers the scan before, for one scanner."""

    def __init__(self, min_points: int) -> None:
        self._min_points = min_points
        self._before_m: Floats | None = None

    def genuine(self, points: Points, linear_m: float, turned_rad: float) -> Floats:
        """The points that count, as rows in base_link [m].

        `linear_m`, `turned_rad`: how far the base can have moved since the scan before; so far a point may have gone.
        """
        before_m, self._before_m = self._before_m, points.at_m
        if self._min_points == 1 or before_m is None or points.at_m.shape[0] == 0:
            return points.at_m
        counts = _group_sizes(points) >= self._min_points
        alone = np.flatnonzero(~counts)
        counts[alone] = _were_there(points.at_m[alone], before_m, linear_m, turned_rad)
        genuine_m: Floats = points.at_m[counts]
        return genuine_m


def _group_sizes(points: Points) -> npt.NDArray[np.intp]:
    """For each point the number of points in its group. The first and the last beam of a full circle are neighbours."""
    at_m, beams = points.at_m, points.beams
    gaps_m = np.hypot(*(at_m - np.concatenate((at_m[-1:], at_m[:-1]))).T)
    steps = np.mod(beams - np.concatenate((beams[-1:], beams[:-1])), points.beam_count)
    breaks = (steps > 1) | (gaps_m > NEIGHBOUR_M)
    if not breaks.any():
        return np.full(beams.size, beams.size)
    first = int(breaks.argmax())
    groups = np.roll(np.cumsum(np.roll(breaks, -first)), first) - 1
    sizes: npt.NDArray[np.intp] = np.bincount(groups)[groups]
    return sizes


def _were_there(at_m: Floats, before_m: Floats, linear_m: float, turned_rad: float) -> Bools:
    reach_m = NEIGHBOUR_M + linear_m + turned_rad * np.hypot(at_m[:, 0], at_m[:, 1])
    apart_m2 = ((at_m[:, np.newaxis, :] - before_m[np.newaxis, :, :]) ** 2).sum(axis=2)
    nearest_m2 = apart_m2.min(axis=1, initial=np.inf)
    seen: Bools = nearest_m2 <= reach_m**2
    return seen
