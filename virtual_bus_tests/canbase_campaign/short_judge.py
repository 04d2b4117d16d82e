"""Is an emergency stop short? From the press of the stop button until the base stands, by distance and by turn.

The base goes on for the time in which the healthy chain carries the command to the wheels, and brakes then as
limits.emergency_deceleration_mps2 says: v·t + v²/(2·a). Whatever makes that longer is an excuse that is active while
the base brakes, or a violation.
"""

from __future__ import annotations

from canbase_campaign.allowance import is_late
from canbase_campaign.envelope import TICK_S, moving_s
from canbase_campaign.excuses import STEP_S, Ledger
from canbase_campaign.judged_by import CYCLES, hard_ramp_s, lag_s
from canbase_campaign.shown import Shown
from canbase_campaign.world import World
from canbase_hazards.stated_times import stated_s

SHARE, FLOOR_M, FLOOR_RAD = 0.05, 0.01, 0.03
"""What the velocity loop of a drive is behind its ramp at the end: of the distance, and at low speeds."""
TOPIC_S = 0.01
"""A message between two processes, and the datagram of its lease."""


class ShortJudge:
    """To be called every step. Distances in the measure of the encoders, like all that is ordered."""

    def __init__(self, world: World, shown: Shown, ledger: Ledger) -> None:
        self._world, self._shown, self._ledger = world, shown, ledger
        robot = world.robot
        chain_s = stated_s("estop_pressed", robot) + CYCLES / robot.rates.control_hz + lag_s(world.drawn.body)
        self._wait_s = TOPIC_S + chain_s + TICK_S + STEP_S
        self.brakes = False
        """A command to brake hard has been received, and the base was not at standstill since."""
        self._since = self._from_mps = self._from_radps = self._went_m = self._turned_rad = 0.0
        self._gives: dict[str, float] = {}

    def begin(self, now_s: float) -> None:
        """The emergency stop was pressed, and a filter that runs received it."""
        if not self.brakes:
            self.brakes, self._since, self._gives = True, now_s, {}
            self._from_mps = self._from_radps = self._went_m = self._turned_rad = 0.0

    def step(self, now_s: float, gives: dict[str, float]) -> str:
        """What is too long; empty: nothing. `gives`: by row, the seconds that it makes the reaction longer now."""
        linear_mps, angular_radps = abs(self._shown.linear_mps), abs(self._shown.angular_radps)
        if not self.brakes or moving_s(self._world.robot, linear_mps, angular_radps) == 0.0:
            self.brakes = False
            return ""
        self._gives |= {row: max(seconds, self._gives.get(row, 0.0)) for row, seconds in gives.items()}
        self._went_m += linear_mps * STEP_S
        self._turned_rad += angular_radps * STEP_S
        if now_s <= self._since + self._wait_s:  # it may get faster until the brakes act
            self._from_mps = max(self._from_mps, linear_mps)
            self._from_radps = max(self._from_radps, angular_radps)
        over_s = self._over_s()
        if not is_late("short", self._ledger, over_s, self._gives.items()):
            return ""
        return (
            f"{self._went_m:.3f} m and {self._turned_rad:.2f} rad since an emergency stop at {self._from_mps:.2f} m/s "
            f"and {self._from_radps:.2f} rad/s, {over_s:.2f} s too long"
        )

    def _over_s(self) -> float:
        """Beyond what is allowed, in seconds at the speed of the beginning."""
        braking_s = hard_ramp_s(self._world.robot.limits, self._from_mps, self._from_radps)
        ways = (
            (self._went_m, self._from_mps, self._from_mps * braking_s / 2.0, FLOOR_M),
            (self._turned_rad, self._from_radps, self._from_radps * braking_s / 2.0, FLOOR_RAD),
        )
        return max(
            (went - self._wait_s * fastest - (1.0 + SHARE) * brakes - floor) / max(fastest, floor)
            for went, fastest, brakes, floor in ways
        )
