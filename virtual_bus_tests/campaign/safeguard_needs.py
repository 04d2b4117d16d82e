"""What each safeguard is needed for: the faults in which a property does not hold without it.

Each name of removed_safeguards.py has a row. Where several layers hold the same, each of them has a row with the others
`beside` it: without all of them the property does not hold, with this one alone it does.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Need:
    """One row. `faults`: those that scenarios are drawn from. `beside`: layers that hold the same, with + between."""

    safeguard: str
    faults: tuple[str, ...]
    beside: str = ""
    quiet: bool = False
    """No source orders motion but in a fault."""
    proof: str = ""
    """Why no scenario can need it alone: then one has to show that all of them together are needed."""
    undrawn: str = ""
    """Why the campaign cannot show it: what it does not draw. teeth.json has no row of it."""

    @property
    def taken_out(self) -> str:
        """All of it."""
        return f"{self.safeguard}+{self.beside}" if self.beside else self.safeguard


_SILENT = ("feedback_lost", "cable_cut_from_drives", "drive_silent", "encoder_lost")
_MAD = ("straight_to_cmd_vel", "driver_repeats", "driver_ignores_zero")
_DRIVER_GONE = ("driver_dies", "driver_hangs")
_WATCHDOG_GONE = ("watchdog_dies", "watchdog_hangs")
_VELOCITY_GONE = ("velocity_dies", "velocity_hangs")
_HELD = ("stick_held", "drive_fault", "resets_too_early")
_LIES = (
    "encoder_frozen", "encoder_ghost", "frozen_encoder", "stuck_velocity", "encoder_jumping", "encoder_intermittent"
)  # fmt: skip
_OFF = ("drive_sto", "drive_fault")
_DRIVER_SEES = "driver:drive_fault+driver:drive_restarted+driver:drive_silent+driver:drive_disabled"
_DRIVER_HEEDS = "power:command_not_zero+driver:reset_needs_zero+driver:zero_before_motion"
_MISSING = "watchdog:motion_missing+driver:stalled"
_MOTION = f"watchdog:feedback_implausible+{_MISSING}+watchdog:twist_outside"
_SENSORS = (
    "watchdog:halted+watchdog:velocity_jumps+watchdog:ghost+watchdog:drift+watchdog:unseen+watchdog:vain+watchdog:strained+"
    "watchdog:behind+driver:stalled+watchdog:twist_outside+watchdog:motion_outside"
)
_NO_MOTION = ("encoder_lost", "wheel_blocked", "encoder_intermittent", "frozen_encoder")
_SLOW = ("wheel_limited", "motor_weak", "wheel_blocked")
_RUNGS = "ladder:pre_operational+ladder:disable_voltage+ladder:heartbeat_withheld"
_DEAF = "a watchdog that cannot send stops nothing; what it would trip for stays tripped until it can send again"
_AWAY = "driver:watchdog_missing+drives:heartbeat_consumer"

NEEDS: tuple[Need, ...] = (
    # watchdog: rows of canbase_watchdog.policy.CHECKS
    Need("watchdog:bus_failed", ("watchdog_bus_problem",), _AWAY, proof=f"{_DEAF}: driver and drives miss it"),
    Need("watchdog:loop_late", ("watchdog_starved", "encoder_lost")),
    Need("watchdog:foreign_master", ("second_master_setpoints",), "watchdog:setpoint_missing+watchdog:target_outside"),
    Need("watchdog:lease_lost", (*_VELOCITY_GONE, "lease_lost"), "driver:command_timeout"),
    Need("watchdog:driver_silent", _DRIVER_GONE, "watchdog:target_outside+drives:heartbeat_consumer"),
    Need("watchdog:drive_restarted", ("drive_power_cycle", "drive_resets"),
         f"watchdog:drive_silent+watchdog:drive_down+{_MOTION}+{_DRIVER_SEES}",
         proof="a drive that starts anew has no power, and its TPDOs and heartbeat end or say so: the rows for a "
         "silent, disabled or restarted drive, of both parts, see that too; this one is sooner and names the cause"),
    Need("watchdog:drive_silent", _SILENT, "driver:drive_silent"),
    Need("watchdog:answered_twice", ("twin_node", "drive_ignores_setpoints"),
         f"{_MOTION}+watchdog:motion_outside+driver:did_not_stop"),
    Need("watchdog:setpoint_missing", ("setpoints_not_sent", "stick_held")),
    Need("watchdog:drive_down", _OFF, "driver:drive_fault+driver:drive_disabled"),
    Need("watchdog:feedback_implausible", _LIES, _MISSING),
    Need("watchdog:motion_missing", ("encoder_lost", "wheel_blocked", "stick_held"), "driver:stalled"),
    Need("watchdog:power_at_stand", ("driver_never_lets_go", "encoder_lost", "stick_tapped")),
    Need("watchdog:target_outside", _MAD),
    Need("watchdog:overspeed", ("encoder_reversed", "driver_ignores_zero"), "watchdog:motion_outside"),
    Need("watchdog:motion_outside", ("drive_ignores_setpoints",), f"{_MOTION}+driver:did_not_stop"),
    Need("watchdog:twist_outside", ("wheel_limited", "motor_weak", "stick_held")),
    Need("watchdog:all", (*_MAD, "lease_lost")),
    Need("watchdog:latch", ("velocity_hangs", "lease_lost", "driver_hangs")),
    Need("watchdog:stop_record", ("all_processes_restart", "watchdog_dies", "encoder_lost", "lease_lost")),
    # watchdog: detectors of the rows above, of policy.OF_THE_SETPOINTS, IMPLAUSIBLE and MISSING
    Need("watchdog:ramp_to_zero", ("driver_ignores_zero", "driver_repeats"), "watchdog:setpoint_at_rest"),
    Need("watchdog:setpoint_at_rest", ("driver_ignores_zero", "driver_repeats"), "watchdog:ramp_to_zero"),
    Need("watchdog:left_right", _MAD),
    Need("watchdog:halted", _LIES, "watchdog:twist_outside+" + _MISSING),
    Need("watchdog:velocity_jumps", _LIES, _SENSORS.replace("watchdog:velocity_jumps+", "")),
    Need("watchdog:ghost", _LIES, _SENSORS.replace("watchdog:ghost+", "")),
    Need("watchdog:drift", _LIES, _SENSORS.replace("watchdog:drift+", "")),
    Need("watchdog:unseen", _NO_MOTION, _SENSORS.replace("watchdog:unseen+", "")),
    Need("watchdog:vain", _NO_MOTION, _SENSORS.replace("watchdog:vain+", "")),
    Need("watchdog:strained", (*_NO_MOTION, "encoder_scaled"), _SENSORS.replace("watchdog:strained+", "")),
    Need("watchdog:behind", _SLOW, _SENSORS.replace("watchdog:behind+", "")),
    Need("watchdog:unasked_torque", ("encoder_ghost",), "watchdog:ghost+driver:unasked_torque", quiet=True),
    # watchdog: rungs of ladder.RUNGS, and what climbs them
    Need("ladder:quick_stop", ("driver_repeats", *_VELOCITY_GONE, *_DRIVER_GONE),
         f"{_RUNGS}+drives:heartbeat_consumer"),
    Need("ladder:pre_operational", ("driver_repeats", "driver_ignores_zero", "encoder_lost"), "ladder:quick_stop"),
    Need("ladder:disable_voltage", ("encoder_lost", "drive_unbraked", "encoder_frozen"), "ladder:heartbeat_withheld"),
    Need("ladder:heartbeat_withheld", ("encoder_lost", "drive_unbraked", "encoder_frozen"), "ladder:disable_voltage"),
    Need("ladder:reset_node", ("encoder_lost", "drive_unbraked", "encoder_frozen"),
         "ladder:disable_voltage+ladder:heartbeat_withheld"),
    Need("ladder:braking", ("drive_unbraked", "encoder_scaled"), "ladder:slowing+driver:braking"),
    Need("ladder:slowing", ("drive_unbraked", "encoder_scaled"), "ladder:braking+driver:braking"),
    Need("ladder:faulty_sensor", ("encoder_lost", *_LIES), "ladder:braking+ladder:slowing"),
    Need("ladder:sudden", ("encoder_lost", *_LIES)),
    # watchdog: what leases and resets have to be
    Need("watchdog:hard_braking", ("obstacle", "estop_pressed"), "filter:obstacle"),
    Need("watchdog:lease_times", ("velocity_hangs", "velocity_hiccup", "lease_garbage")),
    Need("watchdog:lease_form", ("lease_garbage",)),
    Need("watchdog:reset_needs_stand", ("encoder_lost", "resets_too_early", "lease_lost")),
    Need("watchdog:reset_needs_end_of_cause", ("lease_lost", "resets_too_early", "drive_silent")),
    Need("watchdog:reset_needs_zero", ("stick_held", "resets_too_early"), _DRIVER_HEEDS + "+mux:neutral_start"),
    # driver: rows of canbase_driver.supervision.hazards.BLOCKERS
    Need("power:stop_requested", ("stop_requested",)),
    Need("power:bus_failed", ("bus_problem",)),
    Need("power:watchdog_tripped", ("lease_lost", "resets_too_early", "driver_hangs")),
    Need("power:not_configured", ("driver_deactivated", "driver_dies")),
    Need("power:drive_missing", ("drive_power_cycle", "drive_resets")),
    Need("power:booting", ("drive_power_cycle", "drive_resets", "driver_dies")),
    Need("power:stop_unproven", (), undrawn="every robot of the campaign is commissioned"),
    Need("power:drive_fault", ("drive_fault", "drive_sto")),
    Need("power:drive_silent", ("drive_silent", "feedback_lost", "cable_cut_one_drive")),
    Need("power:watchdog_missing", _WATCHDOG_GONE),
    Need("power:inactive", ("driver_deactivated",)),
    Need("power:resetting", ("resets_too_early", "drive_fault")),
    Need("power:not_standing", ("resets_too_early", "drive_power_cycle", "driver_dies")),
    # driver: rows of canbase_driver.supervision.hazards.HAZARDS
    Need("driver:bus_failed", ("bus_problem",), f"driver:watchdog_tripped+{_DRIVER_SEES}+{_AWAY}"),
    Need("driver:watchdog_tripped", ("lease_lost", "driver_repeats", "encoder_lost"), "driver:drive_disabled"),
    Need("driver:drive_fault", _OFF, "driver:drive_disabled+watchdog:drive_down"),
    Need("driver:drive_restarted", ("drive_power_cycle", "second_master_nmt", "drive_resets"),
         "driver:drive_disabled+driver:drive_silent+watchdog:foreign_master+watchdog:drive_silent+watchdog:drive_down"),
    Need("driver:drive_silent", _SILENT, "watchdog:drive_silent"),
    Need("driver:watchdog_missing", _WATCHDOG_GONE, "drives:heartbeat_consumer"),
    Need("driver:drive_disabled", _OFF, "driver:drive_fault+watchdog:drive_down"),
    Need("driver:stalled", ("encoder_lost", "wheel_blocked", "stick_held"), "watchdog:motion_missing"),
    Need("driver:did_not_stop", ("drive_ignores_setpoints",), f"{_MOTION}+watchdog:motion_outside",
         proof="it acts after the whole ramp and its reserve (timeouts.standstill_s); who has watched the bus "
         "meanwhile trips within feedback_samples of the first sample that is too fast"),
    Need("driver:feedback_implausible", (),
         undrawn="no counter wraps in the campaign; narrow_counter of make odd, and unit/chain/test_odometry.py do"),
    Need("driver:stop_requested", ("stop_requested", "stick_held")),
    Need("driver:shutdown", ("driver_asked_to_end", "stick_held")),
    Need("driver:inactive", ("driver_deactivated", "stick_held")),
    # driver: the others
    Need("driver:latch", ("watchdog_hangs", "drive_fault")),
    Need("driver:asks_for_watchdog", _WATCHDOG_GONE),
    Need("driver:command_timeout", _VELOCITY_GONE, "watchdog:lease_lost"),
    Need("driver:zero_before_motion", _HELD, "mux:neutral_start+power:command_not_zero+driver:reset_needs_zero"),
    Need("power:command_not_zero", _HELD, "mux:neutral_start+driver:zero_before_motion+driver:reset_needs_zero"),
    Need("driver:reset_needs_zero", _HELD, "mux:neutral_start+driver:zero_before_motion+power:command_not_zero"),
    Need("driver:command_is_finite", ("straight_to_cmd_vel",)),
    Need("driver:odometry_jump_guard", ("frozen_encoder",), f"{_MOTION}+watchdog:motion_outside"),
    Need("driver:release_test", ("encoder_lost", "stick_tapped"), f"watchdog:power_at_stand+{_MISSING}",
         quiet=True),
    Need("driver:unasked_torque", ("encoder_ghost",), "watchdog:ghost+watchdog:unasked_torque", quiet=True),
    Need("driver:stop_record", ("driver_dies", "drive_fault", "all_processes_restart")),
    Need("driver:switched_off", ("driver_switched_off_and_killed",)),
    Need("records:unreadable", ("driver_dies_torn", "watchdog_dies_torn", "lease_lost")),
    Need("driver:speed_limit", ("straight_to_cmd_vel", "two_hands", "stick_held"),
         "watchdog:target_outside+filter:speed"),
    Need("driver:acceleration_limit", ("straight_to_cmd_vel", "two_hands", "stick_held"),
         f"watchdog:target_outside+{_MOTION}+watchdog:motion_outside"),
    Need("driver:braking", ("drive_ignores_setpoints", "drive_unbraked"),
         f"driver:did_not_stop+{_MOTION}+watchdog:motion_outside"),
    # drives
    Need("drives:heartbeat_consumer", ("cable_cut", "cable_cut_to_drives", "cable_cut_one_drive")),
    # velocity
    Need("mux:timeout", ("action_dies", "action_hangs")),
    Need("mux:lock_publishers", ("two_on_a_lock", "stick_held")),
    Need("mux:neutral_start", _HELD, _DRIVER_HEEDS),
    Need("filter:zero_after_estop", ("estop_pressed", "stick_held"), "mux:neutral_start"),
    Need("filter:speed", ("two_hands", "stick_held", "button_tapped"), "driver:speed_limit"),
    Need("filter:growth", (), undrawn="no robot of the campaign has safety.ceiling"),
    Need("filter:limit_zones", (), undrawn="no robot of the campaign has safety.limit_zones"),
    Need("filter:speed_limit", (), undrawn="nobody publishes speed_limit"),
    Need("filter:uncommissioned", (), undrawn="every robot of the campaign is commissioned"),
    Need("filter:blind_mps", ("scanner_blind_ahead", "scanner_one_beam", "scanner_zero_ahead", "scan_stale")),
    Need("filter:scan", ("scan_stale", "obstacle")),
    Need("filter:brakes_hard", ("obstacle", "estop_pressed")),
    Need("mux:lock", ("two_on_a_lock",)),
    Need("mux:late_commands", ("orders_delayed", "topic_late")),
    Need("filter:late_scans", ("scanner_late",)),
    Need("filter:command", ("mux_lossy",)),
    Need("filter:estop", ("estop_pressed", "estop_stale")),
    Need("filter:obstacle", ("obstacle",)),
    Need("filter:blind", ("scanner_blind_ahead", "scanner_one_beam", "scanner_zero_ahead")),
    Need("filter:frozen", ("scanner_frozen", "scanner_by_turns")),
    Need("filter:repeated_stamp", ("scanner_old_stamps",), "filter:frozen+filter:late_scans"),
    Need("action:timeout_and_progress", ("cmd_vel_ends",)),
)  # fmt: skip
