"""How long and how far the base goes on after an order to stop, worked out from robot.yaml. Pure numbers, no state.

Ordinary stop: the driver's ramp. The slower of linear and angular velocity sets its time, both shrink together, and
jerk_mps3 rounds its begin and its end (an S-curve; an acceleration that was under way ends at once). A turn in place
has no jerk limit. Emergency stop: the same ramp, shorter by deceleration_mps2 / emergency_deceleration_mps2, without a
jerk limit. Quick stop: each drive brakes its own wheel with 6085h, emergency_deceleration_mps2 at the rim.
The driver's ramp itself is canbase_driver/motion/limiter.py; a test compares both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from canbase_config.units import mps_per_bit
from canbase_config.watchdog import STATE_PERIOD_S

if TYPE_CHECKING:
    from canbase_config.drive import Drive
    from canbase_config.robot import Limits, Robot

CYCLES_TO_SETPOINT: Final = 2
"""An order waits for the driver's next cycle, and its end is seen in the one after."""
BRAKING_SHARE: Final = 0.5
"""A wheel that loses less speed than this share of its stated deceleration does not brake as it must: half is left to
double payload, slopes and slow current limits."""
SLOPE_SHARE: Final = 0.25
"""A wheel in a quick stop that is seen to lose less than this share of deceleration_mps2 does not brake at all."""
SLOPE_S: Final = 0.15
"""The shortest time between two speeds that are compared for that: a ramp that grows for 0.4 s is steep enough then."""
HELD_S: Final = 0.25
"""A threshold holds a wheel for at most this long, its return to the ramp of its drive included [s]."""
SEEN_LATE_S: Final = 0.1
"""The longest time for which a SYNC waits for the watchdog's process [s]."""
SETTLE_S: Final = 0.5
"""Until a wheel that has braked is seen to stand."""
ROLLING_MPS2: Final = 0.1
"""What a wheel without power loses at least: rolling resistance 0.01 × 9.81 m/s² of a hard wheel on a hard, level floor
(soft floors, gears and motors brake more; on a slope nothing is known)."""

SLOWEST_RAMP_SHARE: Final = 0.25
"""Of the limits' acceleration, where watchdog.slowest_ramp_mps2 is not given."""
HARDEST_SHARE: Final = 2.0
"""A drive brakes at most this many times as hard as its stated ramp: overshoot of its loop, light loads, noise."""
GRIP_MPS2: Final = 8.0
"""What the floor takes from a wheel at most: a rubber tyre on a dry floor (friction 0.8) slips beyond that. A brake or
a worm gear may stop a wheel harder: such a standstill is not taken for measured."""


@dataclass(frozen=True, slots=True)
class Stop:
    """From the order to stop until the base stands. Magnitudes: no signs."""

    time_s: float
    distance_m: float = 0.0
    """Of the middle between the wheels, along its path."""
    turn_rad: float = 0.0


def ramp(limits: Limits, linear_mps: float, angular_radps: float = 0.0, *, emergency: bool = False) -> Stop:
    """The setpoints on their way to zero, from this velocity (signs do not matter). No lag of driver and drives."""
    linear, angular = abs(linear_mps), abs(angular_radps)
    straight_s = max(linear / limits.deceleration_mps2, angular / limits.angular_deceleration_radps2)
    if emergency:
        time_s = straight_s * limits.deceleration_mps2 / limits.emergency_deceleration_mps2
    else:
        time_s = _rounded_s(straight_s, linear, limits.jerk_mps3)
    return _symmetrical(time_s, linear, angular)


def stop(robot: Robot, linear_mps: float, angular_radps: float = 0.0, *, emergency: bool = False) -> Stop:
    """From an order to stop at the driver until the wheels stand: `ramp`, after `lag_s` at full speed."""
    braking = ramp(robot.limits, linear_mps, angular_radps, emergency=emergency)
    return _after(lag_s(robot), braking, linear_mps, angular_radps)


def quick_stop(robot: Robot, wheel_mps: float) -> Stop:
    """The drives' own ramp, from the controlword on, for a wheel that is so fast. `distance_m`: of its rim."""
    braking_s = abs(wheel_mps) / robot.limits.emergency_deceleration_mps2
    return _after(robot.watchdog.drive_lag_s, _symmetrical(braking_s, abs(wheel_mps), 0.0), wheel_mps, 0.0)


def lag_s(robot: Robot) -> float:
    """From an order at the driver until the wheels do it: the driver's cycles and watchdog.drive_lag_s [s]."""
    return CYCLES_TO_SETPOINT / robot.rates.control_hz + robot.watchdog.drive_lag_s


def max_wheel_mps(robot: Robot) -> float:
    """The fastest that the driver lets a wheel's rim turn [m/s]: straight on or in place, each at its limit."""
    return max(robot.limits.linear_mps, robot.limits.angular_radps * robot.base.track_m / 2.0)


def longest_ramp_s(robot: Robot) -> float:
    """No ordinary stop takes longer [s]: from all limits at once, with the lag."""
    return stop(robot, robot.limits.linear_mps, robot.limits.angular_radps).time_s


def longest_quick_stop_s(robot: Robot) -> float:
    """No quick stop takes longer [s]: from the fastest speed that is no overspeed yet."""
    return quick_stop(robot, robot.watchdog.overspeed_factor * max_wheel_mps(robot)).time_s


def standstill_s(robot: Robot) -> float:
    """The driver gives up its ramp after this [s]: timeouts.standstill_s, or twice the longest ramp and SETTLE_S."""
    given_s = robot.timeouts.standstill_s
    if given_s is not None:
        return given_s
    longest = ramp(robot.limits, robot.limits.linear_mps, robot.limits.angular_radps)
    return lag_s(robot) + longest.time_s / BRAKING_SHARE + SETTLE_S


def given_up_s(robot: Robot) -> float:
    """After this the driver has taken the power, whatever the wheels do: ramp, then quick stop [s]."""
    wheel = robot.watchdog
    fastest_mps = wheel.overspeed_factor * max_wheel_mps(robot)
    begin_mps = fastest_mps * (1.0 + wheel.motion_tolerance_share) + wheel.motion_tolerance_mps
    return standstill_s(robot) + lag_s(robot) + begin_mps / (BRAKING_SHARE * robot.limits.deceleration_mps2)


def stuck_s(robot: Robot) -> float:
    """The time for which a driver that repeats its setpoints is followed after an order of zero [s].

    Until no other order may be under way, and the jerk-limited ramp has lost the tolerance of the fastest wheel, also
    on a curve or in place. Setpoints within the tolerance count as creeping (watchdog/setpoint_at_rest.py).
    """
    limits = robot.limits
    slack_mps = robot.watchdog.target_tolerance_mps + max(abs(bit) for bit in _bits_mps(robot))
    turning_mps2 = limits.angular_deceleration_radps2 * robot.base.track_m / 2.0
    soft_s = math.sqrt(2.0 * slack_mps / limits.jerk_mps3)
    straight_s = slack_mps / min(limits.deceleration_mps2, turning_mps2)
    return order_wait_s(robot) + SEEN_LATE_S + max(soft_s, straight_s + soft_s / 2.0)


def _bits_mps(robot: Robot) -> list[float]:
    return [mps_per_bit(drive, robot.base.radius_m(drive.side)) for drive in robot.drives]


def stuck_otherwise_s(robot: Robot) -> float:
    """The same after an order that is lower and not zero [s]: until the range of what may be ordered has fallen."""
    limits, watchdog = robot.limits, robot.watchdog
    slack_mps = watchdog.target_tolerance_mps + watchdog.target_tolerance_share * limits.linear_mps
    return order_wait_s(robot) + jerk_adds_s(limits) + slack_mps / limits.deceleration_mps2


def order_wait_s(robot: Robot) -> float:
    """When the last order that another one has replaced gets into the driver's setpoints [s].

    Its command timeout, two cycles, and the latency on the way to it.
    """
    return robot.timeouts.command_s + CYCLES_TO_SETPOINT / robot.rates.control_hz + robot.watchdog.latency_s


def emergency_wait_s(robot: Robot) -> float:
    """From "brakes hard" in a lease until the driver's setpoints fall so [s].

    One state frame of the watchdog may be lost: the next one has it too. Then two cycles, and the latency on the way.
    """
    return STATE_PERIOD_S + CYCLES_TO_SETPOINT / robot.rates.control_hz + robot.watchdog.latency_s


def jerk_adds_s(limits: Limits) -> float:
    """How much longer the jerk limit makes a change of speed, up to the whole of linear_mps [s]."""
    straight = (limits.linear_mps / rate for rate in (limits.acceleration_mps2, limits.deceleration_mps2))
    return max(_rounded_s(time_s, limits.linear_mps, limits.jerk_mps3) - time_s for time_s in straight)


def coasting_s(wheel_mps: float) -> float:
    """How long a wheel that was so fast may roll when its power is off, on a level floor [s]."""
    return abs(wheel_mps) / ROLLING_MPS2


def hardest_stop_mps2(robot: Robot) -> float:
    """A wheel without power, or braked by a ramp that is not known, loses no more [m/s²]."""
    return max(HARDEST_SHARE * robot.limits.emergency_deceleration_mps2, GRIP_MPS2)


def hardest_braking_mps2(robot: Robot, drive: Drive) -> float:
    """With power its drive brakes it no harder [m/s²]: by 6085h where that is known."""
    kind = drive.kind
    if kind.options.ramps == "no" or kind.is_unproven("options.ramps") or kind.is_unproven("units.acceleration"):
        return hardest_stop_mps2(robot)
    return HARDEST_SHARE * robot.limits.emergency_deceleration_mps2


def slowest_ramp_mps2(robot: Robot) -> float:
    """How fast a wheel gets to its setpoint at least, where robot.yaml does not give it [m/s²].

    A share of what the driver's setpoints do: soft drives, slopes and payload take the rest.
    """
    limits = robot.limits
    turning_mps2 = limits.angular_acceleration_radps2 * robot.base.track_m / 2.0
    return SLOWEST_RAMP_SHARE * min(limits.acceleration_mps2, turning_mps2)


def _rounded_s(straight_s: float, linear: float, jerk: float) -> float:
    """Time of an S-curve whose steepest slope is that of a straight line of `straight_s`, or less where jerk lets it
    not get so steep. Without a linear part, or with one too small for a float, there is no jerk limit."""
    if linear / jerk == 0.0:
        return straight_s
    slope_s = max(straight_s, math.sqrt(linear / jerk))
    return slope_s + linear / slope_s / jerk


def _symmetrical(time_s: float, linear: float, angular: float) -> Stop:
    """Speeds that fall as they would rise, so that their mean is one half."""
    return Stop(time_s, linear * time_s / 2.0, angular * time_s / 2.0)


def _after(delay_s: float, braking: Stop, linear: float, angular: float) -> Stop:
    """`delay_s` without any braking first."""
    return Stop(
        delay_s + braking.time_s,
        abs(linear) * delay_s + braking.distance_m,
        abs(angular) * delay_s + braking.turn_rad,
    )
