"""What can go wrong: each fault by its name.

Faults are plain switches of the processes, the bus and the drives. Several may hold at once; each end undoes its own.
"""

from __future__ import annotations

from canbase_campaign.bus_faults import BUS_FAULTS
from canbase_campaign.drive_faults import DRIVE_FAULTS
from canbase_campaign.fault import Kind
from canbase_campaign.faulty_drives import FAULTY_DRIVES
from canbase_campaign.mechanics_faults import MECHANICS_FAULTS
from canbase_campaign.operator_faults import PEOPLE
from canbase_campaign.process_faults import PROCESS_FAULTS
from canbase_campaign.received_faults import RECEIVED_FAULTS
from canbase_campaign.sensor_faults import SENSOR_FAULTS
from canbase_campaign.topic_faults import TOPIC_FAULTS

FAULTS: dict[str, Kind] = {
    **PROCESS_FAULTS,
    **BUS_FAULTS,
    **DRIVE_FAULTS,
    **FAULTY_DRIVES,
    **MECHANICS_FAULTS,
    **SENSOR_FAULTS,
    **TOPIC_FAULTS,
    **RECEIVED_FAULTS,
    **PEOPLE,
}
"""Every fault that a scenario may draw."""
ADDED = (
    "cmd_vel_ends",
    "drive_unbraked",
    "driver_asked_to_end",
    "driver_deactivated",
    "driver_dies_torn",
    "driver_never_lets_go",
    "driver_switched_off_and_killed",
    "scanner_clock_slewed",
    "scanner_delayed",
    "scanner_late",
    "scanner_restarts",
    "setpoints_not_sent",
    "source_ends_before_stop",
    "stick_tapped",
    "stop_requested",
    "topic_contradicted",
    "topic_doubled",
    "topic_late",
    "topic_lost",
    "topic_replayed",
    "two_on_a_lock",
    "watchdog_dies_torn",
    "watchdog_starved",
)
"""Drawn beside the others, each by itself: a new one here leaves the scenarios without it as they were."""
ADDED_LATER = (
    "action_crashes",
    "adapter_batches",
    "adapter_fails",
    "all_hang",
    "babbling_node",
    "backlash",
    "brake_drags",
    "brownout",
    "controller_restarts",
    "coupling_broken",
    "derating",
    "disk_returns_old_data",
    "disk_hangs",
    "drive_frozen",
    "drive_stuck_on",
    "driver_crashes",
    "driver_thread_stalls",
    "enables_slowly",
    "encoder_ghost",
    "lease_of_older_version",
    "leaves_operational",
    "lifted",
    "loss_bursts",
    "no_acknowledge",
    "overvoltage",
    "partition",
    "pushed",
    "scanner_clock_ahead",
    "sender_clock_slewed",
    "settings_lost",
    "slip",
    "status_stuck",
    "suspend",
    "torque_lies",
    "velocity_crashes",
    "watchdog_crashes",
    "wheel_size",
)
"""The same, and rarer: with many faults at once the judge has to allow for more."""
