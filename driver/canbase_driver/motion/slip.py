"""Slip that wheels show by themselves. No ROS, no clock.

Two signs: a rim changes its speed harder than the floor can move the base, or wheels of one side disagree.

Encoders measure wheels and not the floor: a base that is held while its wheels spin evenly shows nothing of this. An
IMU or a scanner in a filter does.
"""

from __future__ import annotations

from collections.abc import Sequence

TOLERANCE_MPS = 0.05
"""So far a rim may be from the speed that the floor allows: noise of 606Ch, cycles that come early and late [m/s]."""
DISAGREE_SHARE = 0.1
"""Of their speed: tyres of one side that differ by more would be replaced."""


class SideSlip:
    """The wheels of one side."""

    __slots__ = ("_floor_mps", "_grip_mps2", "speed_mps")

    def __init__(self, grip_mps2: float) -> None:
        self._grip_mps2 = grip_mps2
        self._floor_mps: float | None = None
        self.speed_mps = 0.0
        """So fast may this side slip now (1 σ) [m/s]; 0: it shows no slip."""

    def forget(self) -> None:
        """Nothing is known of the speed any more: the next one is taken for that of the floor."""
        self._floor_mps, self.speed_mps = None, 0.0

    def update(self, rims_mps: Sequence[float], dt_s: float) -> float:
        """Take in the speeds of the rims of this side [m/s]; how far it may have slipped in `dt_s` (1 σ) [m].

        The speed over the floor follows that of the rims, no harder than `grip_mps2`. What is beyond the tolerances is
        taken for slip, all of it.
        """
        mean_mps = sum(rims_mps) / len(rims_mps)
        apart_mps = (max(rims_mps) - min(rims_mps)) / 2.0
        if apart_mps <= TOLERANCE_MPS + DISAGREE_SHARE * abs(mean_mps):
            apart_mps = 0.0
        self.speed_mps = max(apart_mps, self._beyond_grip_mps(mean_mps, dt_s))
        return self.speed_mps * dt_s

    def _beyond_grip_mps(self, mean_mps: float, dt_s: float) -> float:
        floor_mps, most_mps = self._floor_mps, self._grip_mps2 * dt_s
        if floor_mps is None or abs(mean_mps - floor_mps) <= most_mps:
            self._floor_mps = mean_mps
            return 0.0
        self._floor_mps = floor_mps = floor_mps + (most_mps if mean_mps > floor_mps else -most_mps)
        beyond_mps = abs(mean_mps - floor_mps)
        return beyond_mps if beyond_mps > TOLERANCE_MPS else 0.0
