"""How fast the base may be by the leases that were given: an oracle of its own, made apart from the watchdog's.

Measured in the time that the ordinary ramp needs to stop a motion, τ = max(|v| / deceleration, |w| / angular
deceleration) [s]. So the base may be beyond its leases for no longer than T_stop = T_react + τ, where T_react is the
time in which the slowest layer notices: `react_s`.
"""

from __future__ import annotations

import math

from canbase_campaign import judged_by
from canbase_campaign.judged_by import CYCLES, MESSAGE_S, jerk_adds_s
from canbase_campaign.robots import DrawnRobot, rolls_out
from canbase_config.robot import Robot

TICK_S = 0.005
"""Of the watchdog, and of the drives' own timers."""
BUS_S = 0.03
"""A frame that waits for its turn, and one that is lost."""
ORDER_S = 0.05
"""An order is renewed every 20 ms (rates.command_hz)."""
ROUNDING_S = 1e-9
ROLLS_S = 0.002
"""Of τ: what a wheel that rolls out from one step to the next may differ by; 1 mm/s at 0.5 m/s²."""


class _Numbers:
    """Of one robot, computed once: they are needed at every step."""

    def __init__(self, robot: Robot) -> None:
        t, limits = robot.timeouts, robot.limits
        self.robot = robot
        self.tolerance_mps = judged_by.tolerance_mps(robot)
        self.tolerance_radps = 2.0 * self.tolerance_mps / robot.base.track_m
        hold_s = t.command_s + CYCLES / robot.rates.control_hz + MESSAGE_S
        self.notice_s = max(hold_s, t.lease_s, t.watchdog_s, t.drive_heartbeat_s) + TICK_S + BUS_S
        self.deceleration_mps2 = limits.deceleration_mps2
        self.angular_deceleration_radps2 = limits.angular_deceleration_radps2


_last: list[_Numbers] = []
"""Of the last robot, which is the same one for a whole scenario."""


def _numbers(robot: Robot) -> _Numbers:
    if not _last or _last[0].robot is not robot:
        _last[:] = [_Numbers(robot)]
    return _last[0]


def tolerance_mps(robot: Robot) -> float:
    """At the rim: what no layer can distinguish from standstill or from the ordered speed [m/s]."""
    return _numbers(robot).tolerance_mps


def tolerance_radps(robot: Robot) -> float:
    """The same of a turn in place [rad/s]."""
    return _numbers(robot).tolerance_radps


def coasting_share(drawn: DrawnRobot) -> float:
    """A wheel without power is braked by friction alone: its allowance shrinks so much slower, on its slope."""
    limits = drawn.robot.limits
    linear_mps2, angular_radps2 = rolls_out(drawn)
    return min(1.0, linear_mps2 / limits.deceleration_mps2, angular_radps2 / limits.angular_deceleration_radps2)


def pivot_share(robot: Robot) -> float:
    """A base of which one side is not driven turns about it, by what was ordered for both: so much is its τ greater.

    The driven wheel has |v| + |w|·track/2 at most, and its turn, that divided by the track, needs this share of τ.
    """
    limits = robot.limits
    share = 0.5 + limits.deceleration_mps2 / (limits.angular_deceleration_radps2 * robot.base.track_m)
    return max(1.0, share)


def notice_s(robot: Robot) -> float:
    """Longest time until one layer notices that it must stop the base [s]."""
    return _numbers(robot).notice_s


def react_s(robot: Robot, layers: int) -> float:
    """From the last lease to the beginning of the braking [s], when `layers` layers fail one after the other."""
    return layers * notice_s(robot) + jerk_adds_s(robot.limits)


def braking_s(robot: Robot, linear_mps: float, angular_radps: float) -> float:
    """τ of an order [s]."""
    of = _numbers(robot)
    return max(abs(linear_mps) / of.deceleration_mps2, abs(angular_radps) / of.angular_deceleration_radps2)


def moving_s(robot: Robot, linear_mps: float, angular_radps: float) -> float:
    """τ of a motion as it is judged [s]: less the tolerance."""
    of = _numbers(robot)
    linear, angular = abs(linear_mps) - of.tolerance_mps, abs(angular_radps) - of.tolerance_radps
    return braking_s(robot, max(0.0, linear), max(0.0, angular))


class Envelope:
    """The greatest τ that is allowed now. Rules:

    1. The last order holds for ORDER_S, then it is zero; what was ordered before it fades by one second a second.
    2. From the moment on that the base is beyond that, it has `react_s`: until then it may be as fast as it was since.
    3. Then that fades too, by one second a second.
    4. All moments beyond it count together until there is an order again, and the base keeps to it.
    """

    def __init__(self, react_s: float, now_s: float, coasting: float = 0.2) -> None:
        """`coasting`: of `coasting_share`; 0.2: of the sample robot."""
        self.react_s, self._coasting = react_s, coasting
        """`react_s` may change at any step: it is what the active faults leave to the layers."""
        self._order_s, self._ordered_at = 0.0, -math.inf
        self._most_s = 0.0
        """The greatest order since the last look: of two sources on one topic the driver may take either."""
        self._ordered_bound_s = self._peak_s = 0.0
        self._beyond_s, self._was_beyond = 0.0, False
        self._at = now_s

    def order(self, tau_s: float, now_s: float) -> None:
        """An order with this τ is given."""
        self._order_s, self._ordered_at = tau_s, now_s
        self._most_s = max(self._most_s, tau_s)

    def bound_s(self, tau_s: float, now_s: float, coasting: bool = False, lost: bool = False) -> float:
        """The greatest τ allowed now, when the base has `tau_s`. To be called again and again.

        `coasting`: some wheel has no power. `lost`: no process reaches a drive that turns, so nothing brakes it; one
        that reaches it again has `react_s` from there on.
        """
        elapsed_s, self._at = now_s - self._at, now_s
        fades_s = elapsed_s * (self._coasting if coasting else 1.0)
        ordered_s = self._order_s if now_s <= self._ordered_at + ORDER_S else 0.0
        self._ordered_bound_s = max(ordered_s, self._most_s, self._ordered_bound_s - fades_s)
        self._most_s = 0.0
        if tau_s <= self._ordered_bound_s + ROUNDING_S:
            self._was_beyond, self._peak_s = False, 0.0
            self._beyond_s = 0.0 if ordered_s > 0.0 else self._beyond_s
            return self._ordered_bound_s + ROUNDING_S
        self._beyond_s = 0.0 if lost else self._beyond_s + (elapsed_s if self._was_beyond else 0.0)
        self._was_beyond = True
        if self._beyond_s <= self.react_s + ROUNDING_S:
            self._peak_s = max(self._peak_s, tau_s)
        else:
            self._peak_s -= fades_s
        return max(self._ordered_bound_s, self._peak_s) + (ROLLS_S if coasting else 0.0)
