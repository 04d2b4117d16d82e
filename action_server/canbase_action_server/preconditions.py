"""Whether the robot can start a goal now: each reason against it, with what to do next."""

from __future__ import annotations

from dataclasses import replace

from canbase_action_server.inputs import Inputs
from canbase_action_server.state_topics import STATE_TOPICS, States
from canbase_config.robot import Robot
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import SCAN_LOST, StopCause, because
from canbase_runtime.watchdog_view import WatchdogView

NO_SOURCE = (
    "mux.sources has no stamped source with topic cmd_vel_action: the mux would receive no command of a goal; add it"
)
RESET = "; canbase reset ends it, when its cause is gone"


def commanding_program(robot: Robot, states: States) -> str:
    """Name of the source that has the base, if it is a program (neutral_after_s) and not of the goals; else empty."""
    active = states.mux.active if states.mux else ""
    source = robot.mux.sources.get(active)
    is_program = source is not None and source.neutral_after_s is not None
    return active if is_program and active != robot.mux.action_source else ""


def is_moving(robot: Robot, states: States) -> bool:
    """By the newest odometry, as `standstill.py` sees it."""
    odometry = states.odometry
    if odometry is None:
        return False
    rim_mps = abs(odometry.angular_radps) * robot.base.track_m / 2.0
    return max(abs(odometry.linear_mps), rim_mps) > robot.base.standstill_mps


def state_reason(robot: Robot, inputs: Inputs, now_s: float, waits_for_program: bool = False) -> str | None:
    """Why the robot cannot start a goal now; None: it can. `waits_for_program`: a program may have the base still."""
    if inputs.shutdown:
        return "the action server is shutting down"
    if not robot.mux.action_source:
        return NO_SOURCE
    silences = (topic.silence(robot, inputs, now_s) for topic in STATE_TOPICS)
    states = States.at(robot, inputs, now_s)
    if waits_for_program and states.mux is not None and commanding_program(robot, states):
        states = replace(states, mux=replace(states.mux, active=""))
    silent = next(filter(None, silences), None)
    return _condition(robot, states) if silent is None or _is_off(states) else silent


def _is_off(states: States) -> bool:
    """The driver reports that the drives are off, which is also why there is no odometry."""
    driver = states.driver
    return driver is not None and (driver.watchdog is not WatchdogView.OK or driver.state is not DriverState.ENABLED)


def _condition(robot: Robot, states: States) -> str | None:
    safety, driver = states.safety, states.driver
    if safety and (safety.estop or safety.cause.is_estop):
        return f"emergency stop holds: {safety.detail}; release it and reset"
    if driver and driver.watchdog is not WatchdogView.OK:
        remedy = RESET if driver.watchdog is WatchdogView.TRIPPED else "; does it run, and is its bus well?"
        return f"watchdog is {driver.watchdog.value}{because(driver.watchdog_cause)}{remedy}"
    if driver and driver.state is not DriverState.ENABLED:
        remedy = RESET if driver.state is DriverState.LATCHED else ""
        return f"motor_driver is {driver.state.word}, not enabled: {driver.detail}{remedy}"
    if driver and not driver.hears_command:
        return "motor_driver receives no cmd_vel; is safety_filter running? After a start try again in a second"
    return _not_followed(robot, states)


def _not_followed(robot: Robot, states: States) -> str | None:
    """The drives have power, and the commands of a goal would not reach them."""
    safety, mux = states.safety, states.mux
    if mux and mux.active not in ("", robot.mux.action_source):
        return f"{mux.active} has the base; release it first"
    if safety and safety.stops and safety.cause in SCAN_LOST:
        return f"laser scan lost: {safety.detail}; is the scanner running?"
    if safety and safety.stops and safety.cause is not StopCause.OBSTACLE:  # the way back from one is free
        return f"the safety filter stops the base ({safety.cause.value}): {safety.detail}"
    if mux and mux.held_back:
        return f"velocity_mux holds {robot.mux.action_source} back: {mux.held_back}; unlock it first"
    return None
