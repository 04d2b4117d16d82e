"""Which part can catch a failure, within what time, and how the base brakes then: computed from robot.yaml.

A row of the matrix names the layers that may catch it; its limit follows from the one that did (`limit_s`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from canbase_config.derive import order_hold_s
from canbase_config.robot import Robot
from canbase_sim.world.bench import DEFAULT_BODY
from canbase_watchdog.plausibility import DRIFT_M, DRIFT_S
from canbase_watchdog.second_master import DISORDER_COUNT

ALLOWANCE_S = 0.25
"""On top of timeout and braking: signals, processes that wait for a processor, topics, one cycle."""

Seconds = Callable[[Robot, float], float]
"""A time [s] of a robot that drives at some speed [m/s]."""


@dataclass(frozen=True, slots=True)
class Layer:
    """`who` reports `cause`, at the latest `timeout` after the failure, and the base takes `braking` to stand."""

    who: str
    cause: str
    timeout: Seconds
    braking: Seconds

    def limit_s(self, robot: Robot, speed_mps: float) -> float:
        """From the failure until the base stands [s]."""
        return ALLOWANCE_S + self.timeout(robot, speed_mps) + self.braking(robot, speed_mps)


def ramp(robot: Robot, speed_mps: float) -> float:
    """The driver's own ramp, with its jerk limit."""
    limits = robot.limits
    return speed_mps / limits.deceleration_mps2 + limits.deceleration_mps2 / limits.jerk_mps3


def quick(robot: Robot, speed_mps: float) -> float:
    """The quick stop ramp of the drives."""
    return speed_mps / robot.limits.emergency_deceleration_mps2


def coast(robot: Robot, speed_mps: float) -> float:
    """A wheel whose drive has no power brakes by the friction of the simulated body alone."""
    body, wheels = DEFAULT_BODY, len(robot.drives)
    return speed_mps * (body.mass_kg / wheels + body.wheel_mass_kg) / body.coulomb_n


def sensor_dead(robot: Robot, speed_mps: float) -> float:
    """Until a wheel at speed whose sensor shows nothing, or the contrary, has shown it often enough."""
    return robot.watchdog.drive_lag_s + robot.watchdog.feedback_samples / robot.rates.control_hz


def coast_from_runaway(robot: Robot, speed_mps: float) -> float:
    """The simulated drive has pushed with its whole force until then, and the wheel coasts from what that made."""
    body, wheels = DEFAULT_BODY, len(robot.drives)
    push_mps2 = body.peak_force_n / (body.mass_kg / wheels + body.wheel_mass_kg)
    return coast(robot, speed_mps + push_mps2 * sensor_dead(robot, speed_mps))


def twisted(robot: Robot, speed_mps: float) -> float:
    """Until the base has turned without an order for this long."""
    return robot.watchdog.twist_s + robot.watchdog.drive_lag_s


def at_once(robot: Robot, speed_mps: float) -> float:
    """It acts by itself, on its way out."""
    return 0.0


def cycle(robot: Robot, speed_mps: float) -> float:
    """One cycle of the driver."""
    return 1.0 / robot.rates.control_hz


def source(name: str) -> Seconds:
    """Timeout of a source of the mux."""
    return lambda robot, _: robot.mux.sources[name].timeout_s


def kept_setpoint(robot: Robot, speed_mps: float) -> float:
    """Until a setpoint that stays, while zero is commanded, is outside of what the leases allow."""
    return order_hold_s(robot) + target_slack_mps(robot, speed_mps) / robot.limits.deceleration_mps2


def target_slack_mps(robot: Robot, speed_mps: float) -> float:
    """How far outside of the envelope a setpoint may be."""
    return robot.watchdog.target_tolerance_mps + robot.watchdog.target_tolerance_share * speed_mps


def kept_motion(robot: Robot, speed_mps: float) -> float:
    """Until a wheel that keeps its speed, while its setpoints ramp to zero, is outside of what they allow."""
    watchdog, limits = robot.watchdog, robot.limits
    slack_mps = watchdog.motion_tolerance_mps + watchdog.motion_tolerance_share * speed_mps
    falls_s = slack_mps / limits.deceleration_mps2 + limits.deceleration_mps2 / limits.jerk_mps3
    return watchdog.drive_lag_s + falls_s + watchdog.feedback_samples / robot.rates.control_hz


def drift(robot: Robot, speed_mps: float) -> float:
    """Until encoder and velocity, one of which shows a standstill, are too far apart."""
    forgotten = 1.0 / DRIFT_M + 1.0 / (DRIFT_S * speed_mps)
    way_m = -math.log(1.0 - robot.watchdog.travel_tolerance_m * forgotten) / forgotten
    return way_m / speed_mps + robot.watchdog.feedback_samples / robot.rates.control_hz


def disorder(robot: Robot, speed_mps: float) -> float:
    """Until setpoints of two masters have met often enough to exclude chance."""
    return DISORDER_COUNT / robot.rates.control_hz


MUX_JOYSTICK = Layer("velocity_mux", "joystick silent", source("joystick"), ramp)
MUX_ACTION = Layer("velocity_mux", "action silent", source("action"), ramp)

FILTER_SCAN = Layer("safety_filter", "scan_stale", lambda robot, _: robot.safety.scan.timeout_s, ramp)
FILTER_ESTOP = Layer("safety_filter", "estop", at_once, ramp)
FILTER_ESTOP_STALE = Layer("safety_filter", "estop_stale", lambda robot, _: robot.safety.estop.timeout_s, ramp)
FILTER_SHUTDOWN = Layer("safety_filter", "shutdown", at_once, ramp)

DRIVER_STALE = Layer("motor_driver", "command stale", lambda robot, _: robot.timeouts.command_s, ramp)
DRIVER_SHUTDOWN = Layer("motor_driver", "shutdown", at_once, ramp)
DRIVER_EXCEPTION = Layer("motor_driver", "exception", at_once, quick)
DRIVER_EXCEPTION_RAMP = Layer("motor_driver", "exception", at_once, ramp)
DRIVER_FAULT = Layer("motor_driver", "drive fault", cycle, quick)
DRIVER_DRIVE_SILENT = Layer("motor_driver", "drive silent", lambda robot, _: robot.timeouts.feedback_s, quick)
DRIVER_DRIVE_RESTARTED = Layer("motor_driver", "drive restarted", lambda robot, _: robot.timeouts.feedback_s, coast)
DRIVER_DRIVE_GONE = Layer("motor_driver", "drive silent", lambda robot, _: robot.timeouts.feedback_s, coast)
DRIVER_WATCHDOG = Layer("motor_driver", "watchdog missing", lambda robot, _: robot.timeouts.watchdog_s, ramp)

WATCHDOG_LEASE = Layer("watchdog", "lease lost", lambda robot, _: robot.timeouts.lease_s, quick)
WATCHDOG_DRIVER = Layer("watchdog", "driver silent", lambda robot, _: robot.timeouts.drive_heartbeat_s, quick)
WATCHDOG_DRIVE = Layer("watchdog", "drive silent", lambda robot, _: robot.timeouts.feedback_s, quick)
WATCHDOG_DRIVE_GONE = Layer("watchdog", "drive silent", lambda robot, _: robot.timeouts.feedback_s, coast)
WATCHDOG_KEPT = Layer("watchdog", "target outside", kept_setpoint, quick)
WATCHDOG_MOTION = Layer("watchdog", "motion outside", kept_motion, quick)
WATCHDOG_STUCK = Layer("watchdog", "motion outside", at_once, ramp)
"""Only the report is stuck: the base follows the order."""
WATCHDOG_FEEDBACK = Layer("watchdog", "feedback implausible", drift, coast)
"""A wheel whose sensor is no evidence loses its power: the drive's quick stop would close its loop on that sensor."""
WATCHDOG_SENSOR = Layer("watchdog", "feedback implausible", sensor_dead, coast_from_runaway)
WATCHDOG_BACKWARD = Layer("watchdog", "motion outside", sensor_dead, coast_from_runaway)
WATCHDOG_TWIST = Layer("watchdog", "twist outside", twisted, quick)
WATCHDOG_FOREIGN = Layer("watchdog", "foreign master", disorder, quick)
WATCHDOG_ENDED = Layer("watchdog", "ended", at_once, quick)
WATCHDOG_EXCEPTION = Layer("watchdog", "exception", at_once, quick)

DRIVES = Layer("drives", "heartbeat lost", lambda robot, _: robot.timeouts.drive_heartbeat_s, quick)


def server(code: str, timeout: Seconds = at_once) -> Layer:
    """The action server ends the goal with that error code."""
    return Layer("drive_distance_server", code, timeout, ramp)


SERVER_ODOMETRY = server("ODOMETRY_LOST", lambda robot, _: robot.timeouts.odometry_s)
SERVER_CLIENT = server("CLIENT_LOST", lambda robot, _: robot.action.client_lease_s)
SERVER_CANCELED = server("CANCELED")
SERVER_SHUTDOWN = server("SHUTDOWN")
SERVER_EXCEPTION = server("INTERNAL")
