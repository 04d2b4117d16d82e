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
    "canbase_bench": "virtual_bus_tests",
    "campaign": "virtual_bus_tests",
}
"""Packages of which a compiled world has a copy, and where each of them lies."""
HOT = {
    "canbase_watchdog": (
        "bus_health creep envelope evidence feedback foreign frames ladder latch lease observer pair policy standing "
        "stopper tally torque twist view watchdog"
    ),
    "canbase_driver": (
        "axis braking cia301 cia402 command core cycle_stats drives frame let_go measures "
        "node_boot odometry odometry_feed pdo remote_node report snapshot stillness stop_record stops supervisor units "
        "watchdog_link"
    ),
    "canbase_velocity": (
        "base_ready clearance decision estop filter_state frozen glitch lease motion mux neutral obstacle ramp "
        "safety_filter sweep twist"
    ),
    "canbase_bench": (
        "axis_parts command_watch frame line node cia301.dictionary cia301.emcy cia301.heartbeat cia301.nmt "
        "cia301.pdo_rules cia301.rpdo cia301.tpdo cia402.axis cia402.states cia402.units plant.base plant.encoder "
        "plant.motor world.bench"
    ),
    "campaign": (
        "action_process can_bus clock process driver_process watchdog_process velocity_process drives envelope wishes "
        "reach shown strangers motion_judge odometry_judge judge"
    ),
}
"""The compiled modules of each package. Their order does not matter."""


def hot_modules() -> list[str]:
    """Dotted names of all that is compiled."""
    return [f"{package}.{name}" for package, names in HOT.items() for name in names.split()]
