"""At zero order the base comes to rest, and stays. `envelope` bounds what is faster than its tolerance; this the rest.

Within that tolerance a wheel could creep for ever: at 6 cm/s a base that is "stopped" is a metre further in 17 s. So
the seconds are counted in which a wheel creeps while zero is commanded, even with pauses, until motion is.
"""

from __future__ import annotations

from typing import Final

from canbase_campaign.allowance import is_late
from canbase_campaign.envelope import ORDER_S
from canbase_campaign.excuses import STEP_S, Ledger
from canbase_campaign.judged_by import hard_ramp_s, jerk_adds_s, lag_s, tolerance_mps
from canbase_campaign.shown import Shown
from canbase_campaign.world import World
from canbase_hazards.stated_times import QUICK_STOP_S, stated_s

REST_MPS: Final = 0.01
"""A wheel that is slower is at rest: 1 cm/s is the swing of a velocity loop, and a few encoder increments a second."""


class RestJudge:
    """To be called every step. Times in seconds, virtual."""

    def __init__(self, world: World, shown: Shown, ledger: Ledger) -> None:
        robot = world.robot
        self._shown, self._ledger = shown, ledger
        creeps_s = stated_s("slow_setpoint_without_a_lease", robot) + QUICK_STOP_S
        ends_s = hard_ramp_s(robot.limits, tolerance_mps(robot), 0.0) + lag_s(world.drawn.body)
        self.allowed_s = creeps_s + ends_s + jerk_adds_s(robot.limits)
        """So long a wheel may creep at zero order: the watchdog notices, the first rung brakes."""
        self._ordered_at = world.clock.now_s
        self._creeps_s = 0.0

    def order(self, is_zero: bool, now_s: float) -> None:
        """The filter ordered this."""
        if not is_zero:
            self._ordered_at = now_s

    def step(self, now_s: float, stands: bool, gives: dict[str, float]) -> str:
        """What creeps for too long; empty: nothing. `stands`: for `envelope` the base is at standstill.

        `gives`: by row, the seconds that it makes the time longer now; infinity: nothing can hold the wheel now.
        """
        if now_s <= self._ordered_at + ORDER_S:
            self._creeps_s = 0.0
            return ""
        fastest_mps = self._shown.fastest_mps
        if not stands or fastest_mps <= REST_MPS:
            return ""
        self._creeps_s += STEP_S
        over_s = self._creeps_s - self.allowed_s
        if not is_late("rest", self._ledger, over_s, gives.items()):
            return ""
        return f"a wheel turns at {fastest_mps:.3f} m/s, for {self._creeps_s:.2f} s in all, while zero is commanded"
