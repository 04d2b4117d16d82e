"""What `make compiled` compiles: what a robot in virtual time spends its time in, by profile. All else stays Python."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "compiled"
SOURCES = {
    "canbase_config": "can_config",
    "canbase_driver": "driver",
    "canbase_velocity": "velocity_mux",
    "canbase_watchdog": "watchdog",
    "canbase_action_server": "action_server",
    "canbase_base": "runtime",
    "canbase_runtime": "runtime",
    "canbase_sim": "virtual_bus_tests",
    "canbase_campaign": "virtual_bus_tests",
}
"""Packages of which a compiled world has a copy, and where each of them lies."""
HOT = {
    "canbase_config": "watchdog",
    "canbase_base": "latch_record",
    "canbase_runtime": "driver_state source_standing stop_cause watchdog_view",
    "canbase_watchdog": (
        "bad_cycles bus_health copies counts envelope frames ghost guarding ladder lease left_right "
        "motion_evidence observer overshoot plausibility policy power_and_motion ramp_to_zero second_master "
        "setpoint_at_rest slowing standstill stopper stopping_distance torque_evidence trip_cause twist "
        "unasked_torque view watchdog"
    ),
    "canbase_driver": (
        "causes cia402 core drive_units snapshot boot.node_boot boot.sdo_budget cia301.emcy cia301.frame cia301.nmt "
        "cia301.node_guarding cia301.pdo cia301.sdo_client drives.axis "
        "drives.canopen_node drives.drive_group drives.drive_snapshot drives.feedback_factor drives.release_test "
        "drives.odometry_feed "
        "drives.sdo_stop drives.signs_of_life drives.stall drives.standstill drives.stopping_distance drives.telemetry "
        "motion.braking motion.kinematics motion.limiter motion.odometry motion.velocity_command "
        "supervision.bus_health supervision.cycle_stats supervision.latch supervision.lifecycle "
        "supervision.phases supervision.hazards supervision.fault_reset supervision.reset_run supervision.situation "
        "supervision.stop_history supervision.state_machine "
        "supervision.watchdog_link"
    ),
    "canbase_velocity": (
        "base_ready changes clearance coverage decision delay estop filter_state frozen glitch lease lock motion mux "
        "neutral obstacle placement ramp safety_filter scan sole_publisher steady sweep twist"
    ),
    "canbase_action_server": (
        "along_track causes goal goal_queue goal_request goal_step inputs motion motion_limits outcome "
        "preconditions profile standstill straight turn"
    ),
    "canbase_sim": (
        "axis_parts command_watch frame line node cia301.dictionary cia301.emcy cia301.heartbeat cia301.nmt "
        "cia301.life_guarding "
        "cia301.pdo_rules cia301.rpdo cia301.tpdo cia402.axis cia402.states cia402.raw_units odd.odd_line odd.odd_node "
        "plant.base plant.battery plant.encoder plant.motor world.bench"
    ),
    "canbase_campaign": (
        "action_process allowance can_bus clock disk process driver_process watchdog_process velocity_process drives "
        "envelope excuses fault goal_judge hands intruder judged_by lidar outside pause_judge plan rest_judge "
        "wall_place wishes reach "
        "scanner shown strangers motion_judge odometry_judge judge"
    ),
}
"""The compiled modules of each package. Their order does not matter."""


def hot_modules() -> list[str]:
    """Dotted names of all that is compiled."""
    return [f"{package}.{name}" for package, names in HOT.items() for name in names.split()]
