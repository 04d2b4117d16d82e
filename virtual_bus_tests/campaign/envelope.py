"""How fast the base may be by the leases that were given: an oracle of its own, made apart from the watchdog's.

Measured in the time that the ordinary ramp needs to stop a motion, τ = max(|v| / deceleration, |w| / angular
deceleration) [s]. So the base may be beyond its leases for no longer than T_stop = T_react + τ, where T_react is the
time in which the slowest layer notices: `react_s`.
"""

from __future__ import annotations

import math

from canbase_config.robot import Robot

TICK_S = 0.005
"""Of the watchdog, and of the drives' own timers."""
BUS_S = 0.03
"""A frame that waits for its turn, and one that is lost."""
JERK_S = 0.1
"""The ordinary ramp begins and ends softly: limits.deceleration_mps2 / limits.jerk_mps3."""
ORDER_S = 0.05
"""An order is renewed every 20 ms (rates.command_hz)."""
TOLERANCE_MPS = 0.06
TOLERANCE_RADPS = 0.24
"""What no layer can tell from standing or from the ordered speed: tolerances of the layers, overshoot of a loop."""
ROUNDING_S = 1e-9
COASTING = 0.2
"""A wheel without power is braked by friction alone: its allowance shrinks this much slower."""


def notice_s(robot: Robot) -> float:
    """Longest time until one layer notices that it must stop the base [s]."""
    t = robot.timeouts
    return (
        max(t.command_s + 1.0 / robot.rates.control_hz, t.lease_s, t.watchdog_s, t.drive_heartbeat_s) + TICK_S + BUS_S
    )


def react_s(robot: Robot, layers: int) -> float:
    """From the last lease to the beginning of the braking [s], when `layers` layers fail one after the other."""
    return layers * notice_s(robot) + JERK_S


def braking_s(robot: Robot, linear_mps: float, angular_radps: float) -> float:
    """τ of an order [s]."""
    limits = robot.limits
    return max(abs(linear_mps) / limits.deceleration_mps2, abs(angular_radps) / limits.angular_deceleration_radps2)


def moving_s(robot: Robot, linear_mps: float, angular_radps: float) -> float:
    """τ of a motion as it is judged [s]: less the tolerance."""
    return braking_s(robot, max(0.0, abs(linear_mps) - TOLERANCE_MPS), max(0.0, abs(angular_radps) - TOLERANCE_RADPS))


class Envelope:
    """The greatest τ that is allowed now. Rules:

    1. The last order holds for ORDER_S, then it is zero; what was ordered before it fades by one second a second.
    2. From the moment on that the base is beyond that, it has `react_s`: until then it may be as fast as it was since.
    3. Then that fades too, by one second a second.
    """

    def __init__(self, react_s: float, now: float) -> None:
        self._react_s = react_s
        self._order_s, self._ordered_at = 0.0, -math.inf
        self._ordered_bound_s = self._peak_s = 0.0
        self._beyond_since = math.inf
        self._at = now

    def order(self, tau_s: float, now: float) -> None:
        """An order with this τ is given."""
        self._order_s, self._ordered_at = tau_s, now

    def bound_s(self, tau_s: float, now: float, coasting: bool = False) -> float:
        """The greatest τ allowed now, when the base has `tau_s`. To be asked again and again.

        `coasting`: some wheel has no power.
        """
        fades_s = (now - self._at) * (COASTING if coasting else 1.0)
        self._at = now
        ordered_s = self._order_s if now <= self._ordered_at + ORDER_S else 0.0
        self._ordered_bound_s = max(ordered_s, self._ordered_bound_s - fades_s)
        if tau_s <= self._ordered_bound_s + ROUNDING_S:
            self._beyond_since, self._peak_s = math.inf, 0.0
            return self._ordered_bound_s + ROUNDING_S
        self._beyond_since = min(self._beyond_since, now)
        if now <= self._beyond_since + self._react_s:
            self._peak_s = max(self._peak_s, tau_s)
        else:
            self._peak_s -= fades_s
        return max(self._ordered_bound_s, self._peak_s)
