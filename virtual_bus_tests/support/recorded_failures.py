"""Failures in virtual time, and the first cause that `canbase explain` names: by a black box, and by a listener."""

from __future__ import annotations

from random import Random

from canbase_campaign.outside import Surroundings
from canbase_campaign.twins import JOYSTICK, Begin, Twin, fault
from canbase_campaign.world import World
from canbase_recording.cause import Cause

NO_STOP = None
"""The drives brake as ordered: nothing to see for a listener, or nothing left in the black box of a dead driver."""

FAILURES = (
    # what fails, how, first cause by a black box, by a listener that has frames alone
    ("motor_driver", "SIGTERM", Cause.SHUTDOWN, NO_STOP),
    ("motor_driver", "SIGKILL", NO_STOP, Cause.DRIVER_SILENT),
    ("motor_driver", "SIGSTOP", NO_STOP, Cause.DRIVER_SILENT),
    ("motor_driver", "busy loop", Cause.COMMANDS_LOST, NO_STOP),
    ("velocity process", "SIGTERM", Cause.FILTER, NO_STOP),
    ("velocity process", "SIGKILL", Cause.LEASES_LOST, Cause.LEASES_LOST),
    ("watchdog", "SIGTERM", Cause.WATCHDOG_ENDED, Cause.WATCHDOG_ENDED),
    ("watchdog", "SIGKILL", Cause.WATCHDOG_SILENT, Cause.WATCHDOG_SILENT),
    ("drive_distance_server", "SIGKILL", Cause.SOURCE_LOST, NO_STOP),
    ("cable", "cut both ways", Cause.BUS_CUT, Cause.DRIVES_DEAF),
    ("cable", "nothing reaches the drives", Cause.DRIVES_DEAF, Cause.DRIVES_DEAF),
    ("cable", "nothing comes from the drives", Cause.BUS_CUT, Cause.REPORTED),
    ("cable", "of one drive is cut", Cause.NODE_SILENT, Cause.NODE_SILENT),
    ("drive", "silent", Cause.NODE_SILENT, Cause.NODE_SILENT),
    ("drive", "in fault", Cause.DRIVE_FAULT, Cause.DRIVE_FAULT),
    ("drive", "STO opens", Cause.DRIVE_DISABLED, Cause.DRIVE_DISABLED),
    ("drive", "reset: without power for 0.5 s", Cause.NODE_RESTARTED, Cause.NODE_RESTARTED),
    ("drive", "starts again", Cause.NODE_RESTARTED, Cause.NODE_RESTARTED),
    (
        "motor_driver",
        "repeats its last setpoints for ever, then zero is commanded",
        Cause.SETPOINTS_KEPT,
        Cause.REPORTED,
    ),
    ("motor_driver", "ignores zero, then zero is commanded", Cause.SETPOINTS_KEPT, Cause.REPORTED),
    ("cmd_vel", "another node publishes to it, then zero is commanded", Cause.TWO_COMMANDERS, Cause.REPORTED),
    ("second master", "sends setpoints and SYNC", Cause.SECOND_MASTER, Cause.SECOND_MASTER),
    ("joystick", "dies", Cause.SOURCE_LOST, NO_STOP),
    ("scan", "stale", Cause.SCANNER, NO_STOP),
    ("emergency stop", "pressed", Cause.EMERGENCY_STOP, NO_STOP),
    ("emergency stop", "stale", Cause.BUTTON_SILENT, NO_STOP),
    ("drive", "encoder frozen", Cause.POSITION_STUCK, Cause.POSITION_STUCK),
    ("drive", "actual velocity stuck at 0", Cause.VELOCITY_STUCK, Cause.VELOCITY_STUCK),
    ("drive", "actual velocity stuck, then zero is commanded", Cause.VELOCITY_STUCK, Cause.VELOCITY_STUCK),
    ("drive", "ignores its setpoints, then zero is commanded", Cause.WHEEL_RUNS_ON, Cause.WHEEL_RUNS_ON),
    ("encoder", "lost: nothing counts, no speed", Cause.NO_MOTION, Cause.NO_MOTION),
    ("encoder", "frozen: nothing counts, the last speed", Cause.POSITION_STUCK, Cause.POSITION_STUCK),
    ("encoder", "counts backward", Cause.WRONG_WAY, Cause.WRONG_WAY),
    ("encoder", "jumps to and fro", Cause.ENCODER_JUMPS, Cause.ENCODER_JUMPS),
    ("wheel", "blocked", Cause.NO_MOTION, Cause.NO_MOTION),
    ("wheel", "follows half of its setpoint", Cause.WHEEL_SLOW, Cause.WHEEL_SLOW),
    ("wheel", "motor without force", Cause.WHEEL_SLOW, Cause.WHEEL_SLOW),
    ("wheel", "setpoints lost, then zero is commanded", Cause.WHEEL_RUNS_ON, Cause.WHEEL_RUNS_ON),
    ("wheel", "feedback lost", Cause.FEEDBACK_LOST, Cause.FEEDBACK_LOST),
    ("twin node", "a second drive with the same node id, at standstill", Cause.TWIN_NODE, Cause.TWIN_NODE),
)


def hiccup(name: str, seconds: float) -> Begin:
    """A process that gets no processor for a while, and goes on."""

    def begin(world: World, around: Surroundings, random: Random) -> None:
        world.processes[name].hang("hiccup")
        world.clock.after(seconds, world.processes[name].go_on, "hiccup")

    return begin


MORE = (
    (Twin("obstacle", "appears", fault("obstacle", margin_m=0.05), JOYSTICK), Cause.OBSTACLE, NO_STOP),
    (Twin("service", "stop", fault("stop_requested"), JOYSTICK), Cause.STOP_REQUESTED, NO_STOP),
    (Twin("lifecycle", "deactivate", fault("driver_deactivated"), JOYSTICK), Cause.DEACTIVATED, NO_STOP),
    (Twin("driver", "pauses", hiccup("driver", 0.4), JOYSTICK), Cause.RECORDER_PAUSED, Cause.DRIVER_SILENT),
    (Twin("velocity", "pauses", hiccup("velocity", 0.4), JOYSTICK), Cause.LEASES_LOST, Cause.LEASES_LOST),
    (Twin("driver", "omits one axis", fault("setpoints_not_sent", wheel=0), JOYSTICK), Cause.SETPOINTS_MISSING,
     Cause.SETPOINTS_MISSING),
    (Twin("second master", "NMT", fault("second_master_nmt", nmt=b"\x80\x00"), JOYSTICK), Cause.SECOND_MASTER,
     Cause.SECOND_MASTER),
    (Twin("second master", "SYNC", fault("second_master_sync", on=True), JOYSTICK), Cause.SECOND_MASTER,
     Cause.SECOND_MASTER),
    (Twin("adapter", "fails", fault("bus_problem"), JOYSTICK), Cause.ADAPTER_FAILED, Cause.DRIVER_SILENT),
    (Twin("leases", "lost", fault("lease_lost", value=1.0), JOYSTICK), Cause.LEASES_LOST, Cause.LEASES_LOST),
    (Twin("drive", "bus-off", fault("drive_bus_off", wheel=1), JOYSTICK), Cause.DRIVES_DEAF, Cause.DRIVES_DEAF),
)  # fmt: skip
"""Failures that the exit matrix has not."""
