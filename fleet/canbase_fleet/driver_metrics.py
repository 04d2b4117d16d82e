"""The metrics of motor_driver/status: driver, watchdog, bus and drives. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from prometheus_client.core import Metric

from canbase_config.robot import Robot
from canbase_driver.causes import DriverCause
from canbase_driver.cia402 import DriveState
from canbase_driver.supervision.bus_health import ControllerState
from canbase_fleet.columns import Column, metrics, one_of
from canbase_runtime.driver_state import DriverState, driver_state
from canbase_runtime.watchdog_view import WatchdogView, watchdog_view

ENABLED: Final = DriveState.OPERATION_ENABLED.text
DRIVER: Final = (
    Column("standstill", "", "All wheels are measured at standstill (1), or not (0).", lambda m: m.standstill),
    Column("command_age", "seconds", "Age of the last velocity command at the driver.", lambda m: m.command_age_s),
    Column("commands_refused", "", "Velocity commands with NaN or infinity.", lambda m: m.commands_refused, True),
    Column("pose_resets", "", "How often the pose of the odometry was set.", lambda m: m.pose_resets, True),
    Column("cycles", "", "Cycles of the control loop.", lambda m: m.cycles, True),
    Column("cycle_overruns", "", "Cycles that began more than half a period late.", lambda m: m.overruns, True),
    Column(
        "cycle_lateness_max",
        "seconds",
        "Greatest lateness of a cycle in the last second.",
        lambda m: m.cycle_lateness_max_s,
    ),
    Column("watchdog_age", "seconds", "Age of the watchdog's last state frame.", lambda m: m.watchdog_age_s),
    Column("watchdog_lease_age", "seconds", "Age of the last lease at the watchdog.", lambda m: m.watchdog_lease_age_s),
    Column("watchdog_pause_max", "seconds", "Longest pause of the watchdog's loop.", lambda m: m.watchdog_pause_max_s),
    Column("watchdog_rung", "", "Step of the watchdog's ladder, 0 (none) to 5.", lambda m: m.watchdog_rung),
    Column("watchdog_trips", "", "Trips of the watchdog.", lambda m: m.watchdog_trips, True),
    Column("watchdog_leases_refused", "", "Datagrams that were no lease.", lambda m: m.watchdog_leases_refused, True),
    Column(
        "watchdog_frames_dropped",
        "",
        "Frames that the watchdog did not understand.",
        lambda m: m.watchdog_frames_dropped,
        True,
    ),
    Column("watchdog_bus_errors", "", "Bus errors at the watchdog.", lambda m: m.watchdog_bus_errors, True),
    Column("bus_load", "ratio", "Share of the bus's time that frames took, at most.", lambda m: m.bus_load),
    Column("bus_failed", "", "The bus does not work now (1), or does (0).", lambda m: bool(m.bus_problem)),
    Column("bus_frames_dropped", "", "Frames that were not understood.", lambda m: m.frames_dropped, True),
    Column("bus_send_errors", "", "Frames that were not sent in time.", lambda m: m.send_errors, True),
    Column("bus_receive_errors", "", "Receptions that failed.", lambda m: m.receive_errors, True),
    Column("bus_error_frames", "", "Error frames of the CAN controller.", lambda m: m.error_frames, True),
    Column("bus_failures", "", "How often the bus failed and was opened again.", lambda m: m.bus_failures, True),
)
DRIVE: Final = (
    Column("drive_target", "radians_per_second", "Setpoint at the wheel.", lambda d: d.target_radps),
    Column("drive_velocity", "radians_per_second", "Measured speed of the wheel.", lambda d: d.velocity_radps),
    Column("drive_feedback_age", "seconds", "Age of its last feedback.", lambda d: d.feedback_age_s),
    Column("drive_heartbeat_age", "seconds", "Age of its last heartbeat.", lambda d: d.heartbeat_age_s),
    Column("drive_voltage", "volts", "Its supply.", lambda d: d.voltage_v),
    Column("drive_current", "amperes", "Current of its motor.", lambda d: d.current_a),
    Column("drive_temperature", "celsius", "Its temperature.", lambda d: d.temperature_c),
    Column("drive_torque", "ratio", "Its torque as a share of the rated one.", lambda d: d.torque_share),
    Column("drive_enabled", "", "It is in operation enabled (1), or not (0).", lambda d: d.state == ENABLED),
    Column("drive_error_code", "", "CiA 402 error code, 603Fh; 0: none.", lambda d: d.error_code),
    Column("drive_boot_failed", "", "Its last boot failed (1), or did not (0).", lambda d: bool(d.boot_problem)),
    Column("drive_health_exceeded", "", "A value is beyond a limit of `health` (1).", lambda d: bool(d.health)),
    Column("drive_stops_by_itself", "", "It stops without this computer (1), or not (0).", lambda d: d.stops_by_itself),
)


def driver_metrics(message: Any, robot: Robot) -> Iterator[Metric]:
    """Of one DriverStatus. Drives that robot.yaml does not name are left out: their labels would have no bound."""
    yield one_of(
        "driver_state",
        "State of the motor driver.",
        (state.word for state in DriverState),
        driver_state(message.state).word,
    )
    causes = [_word(cause.value) for cause in DriverCause]
    yield one_of("driver_cause", "Why the drives have no power; none: they have.", causes, _word(message.cause))
    views = [view.value for view in WatchdogView]
    yield one_of("watchdog_state", "The watchdog as the driver sees it.", views, watchdog_view(message.watchdog).value)
    controllers = [_word(state.value) for state in ControllerState]
    yield one_of("bus_controller", "State of the CAN controller.", controllers, _word(message.controller))
    yield from metrics(DRIVER, (), [((), message)])
    known = {drive.joint: str(drive.node_id) for drive in robot.drives}
    drives = {drive.joint: drive for drive in message.drives if drive.joint in known}
    yield from metrics(DRIVE, ("joint", "node"), [((joint, known[joint]), drives[joint]) for joint in drives])


def _word(text: str) -> str:
    """As a label's value."""
    return text.replace(" ", "_").replace("-", "_")
