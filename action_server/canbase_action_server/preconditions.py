"""Whether the robot can start a goal now: each reason against it, with what to do next."""

from __future__ import annotations

from dataclasses import replace

from canbase_action_server.inputs import Inputs, age_s
from canbase_config.robot import Robot
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import SCAN_LOST, StopCause
from canbase_runtime.watchdog_view import WatchdogView

STATE_TIMEOUT_S = 1.5
"""An older state is no evidence: three periods of the slowest one (velocity_mux/state, 2 Hz)."""


NO_SOURCE = (
    "mux.sources has no stamped source with topic cmd_vel_action: the mux would receive no command of a goal; add it"
)


def action_source(robot: Robot) -> str:
    """Name under mux.sources of the source on topic cmd_vel_action; empty when there is none."""
    ours = ("cmd_vel_action", "geometry_msgs/msg/TwistStamped")
    sources = robot.mux.sources.items()
    return next((name for name, source in sources if (source.topic, source.message_type) == ours), "")


def commanding_program(robot: Robot, inputs: Inputs) -> str:
    """Name of the source that has the base, if it is a program (neutral_after_s) and not of the goals; else empty."""
    active = inputs.mux.active if inputs.mux else ""
    source = robot.mux.sources.get(active)
    is_program = source is not None and source.neutral_after_s is not None
    return active if is_program and active != action_source(robot) else ""


def is_moving(robot: Robot, inputs: Inputs) -> bool:
    """By the newest odometry, as `standstill.py` sees it."""
    odometry = inputs.odometry
    if odometry is None:
        return False
    rim_mps = abs(odometry.angular_radps) * robot.base.track_m / 2.0
    return max(abs(odometry.linear_mps), rim_mps) > robot.base.standstill_mps


def state_reason(robot: Robot, inputs: Inputs, now_s: float, waits_for_program: bool = False) -> str | None:
    """Why the robot cannot start a goal now; None: it can. `waits_for_program`: a program may have the base still."""
    if inputs.shutdown:
        return "the action server is shutting down"
    if not action_source(robot):
        return NO_SOURCE
    if waits_for_program and inputs.mux is not None and commanding_program(robot, inputs):
        inputs = replace(inputs, mux=replace(inputs.mux, active=""))
    return _silence(robot, inputs, now_s) or _condition(robot, inputs)


def _silence(robot: Robot, inputs: Inputs, now_s: float) -> str | None:
    odometry, safety, driver, mux = inputs.odometry, inputs.safety, inputs.driver, inputs.mux
    for topic, node, received, timeout_s in (
        ("odom", "motor_driver", odometry.received if odometry else None, robot.timeouts.odometry_s),
        ("motor_driver/status", "motor_driver", driver.received if driver else None, STATE_TIMEOUT_S),
        ("safety_filter/state", "safety_filter", safety.received if safety else None, STATE_TIMEOUT_S),
        ("velocity_mux/state", "velocity_mux", mux.received if mux else None, STATE_TIMEOUT_S),
    ):
        if received is None:
            return f"nothing received on {topic} yet; is {node} running?"
        if age_s(received, now_s) > timeout_s:
            return (
                f"no message on {topic} for {age_s(received, now_s):.2f} s (timeout {timeout_s} s); is {node} running?"
            )
    return None


def _condition(robot: Robot, inputs: Inputs) -> str | None:
    safety, driver = inputs.safety, inputs.driver
    if safety and (safety.estop or safety.cause.is_estop):
        return f"emergency stop holds: {safety.detail}; release it and reset"
    if driver and driver.watchdog is not WatchdogView.OK:
        return f"watchdog is {driver.watchdog.value} (cause {driver.watchdog_cause}); start or reset it"
    if driver and driver.state is not DriverState.ENABLED:
        return f"motor_driver is {driver.state.word}, not enabled: {driver.detail}"
    if driver and not driver.hears_command:
        return "motor_driver receives no cmd_vel; is safety_filter running? After a start try again in a second"
    return _not_followed(robot, inputs)


def _not_followed(robot: Robot, inputs: Inputs) -> str | None:
    """The drives have power, and the commands of a goal would not reach them."""
    safety, mux = inputs.safety, inputs.mux
    if mux and mux.active not in ("", action_source(robot)):
        return f"{mux.active} drives now; release it first"
    if safety and safety.stops and safety.cause in SCAN_LOST:
        return f"laser scan lost: {safety.detail}; is the scanner running?"
    if safety and safety.stops and safety.cause is not StopCause.OBSTACLE:  # the way back from one is free
        return f"the safety filter stops the base ({safety.cause.value}): {safety.detail}"
    if mux and mux.held_back:
        return f"velocity_mux holds {action_source(robot)} back: {mux.held_back}; unlock it first"
    return None
