"""What can be the first cause of a stop: each with its name, and what to look at. Pure data."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final


class Cause(Enum):
    """The first cause of a stop. The value is the word for JSON; `name_of` and `ADVICE` are for people."""

    __hash__ = object.__hash__

    EMERGENCY_STOP = "emergency stop"
    BUTTON_SILENT = "emergency stop button silent"
    SCANNER = "scanner"
    OBSTACLE = "obstacle"
    FILTER = "safety filter"
    SOURCE_LOST = "velocity source lost"
    STOP_REQUESTED = "stop requested"
    SHUTDOWN = "driver shut down"
    DEACTIVATED = "driver deactivated"
    RECORDER_PAUSED = "recorder paused"
    ADAPTER_FAILED = "bus adapter failed"
    SECOND_MASTER = "second master"
    NMT_COMMAND = "NMT command"
    TWIN_NODE = "two nodes with one id"
    NODE_RESTARTED = "node restarted"
    DRIVER_SILENT = "driver or master silent"
    WATCHDOG_SILENT = "watchdog silent"
    WATCHDOG_ENDED = "watchdog ended"
    DRIVES_DEAF = "drives receive nothing"
    BUS_CUT = "bus cut"
    NODE_SILENT = "node silent"
    FEEDBACK_LOST = "feedback lost"
    BUS_ERRORS = "bus errors"
    DRIVE_FAULT = "drive fault"
    DRIVE_DISABLED = "drive lost power by itself"
    ORDERED_OFF = "power ordered off in motion"
    SETPOINTS_MISSING = "setpoints missing"
    SETPOINTS_KEPT = "setpoints kept"
    TWO_COMMANDERS = "two publishers on cmd_vel"
    LEASES_LOST = "leases lost"
    COMMANDS_LOST = "cmd_vel lost"
    ENCODER_JUMPS = "encoder jumps"
    POSITION_STUCK = "encoder stands still"
    VELOCITY_STUCK = "velocity value stands still"
    WRONG_WAY = "wheel turns the wrong way"
    NO_MOTION = "wheel shows no motion"
    WHEEL_SLOW = "wheel follows too little"
    WHEEL_RUNS_ON = "wheel does not obey"
    REPORTED = "reported only"
    UNKNOWN = "cannot tell"


ADVICE: Final[dict[Cause, str]] = {
    Cause.EMERGENCY_STOP: "somebody pressed the emergency stop; release it, then reset",
    Cause.BUTTON_SILENT: "check the node that publishes estop_state and its network",
    Cause.SCANNER: "check the scanner's driver, its cable and its topic",
    Cause.OBSTACLE: "the safety filter did what it is for; check the scan if nothing was there",
    Cause.FILTER: "docs/velocity.md explains this cause",
    Cause.SOURCE_LOST: "check the node that drove: joystick, navigation or action server",
    Cause.STOP_REQUESTED: "somebody called motor_driver/stop; a reset ends it",
    Cause.SHUTDOWN: "the driver was asked to end",
    Cause.DEACTIVATED: "a lifecycle manager or a person deactivated motor_driver",
    Cause.RECORDER_PAUSED: "look for what held the computer: load, suspend, a debugger, swapping",
    Cause.ADAPTER_FAILED: "check the CAN adapter, its plug and the interface: ip -details link show can0",
    Cause.SECOND_MASTER: "find the other master: a second driver, a manufacturer's tool, a PLC; a bus has one master",
    Cause.NMT_COMMAND: "find out which master sent it, and why",
    Cause.TWIN_NODE: "give each node its own id (switches, or LSS)",
    Cause.NODE_RESTARTED: "check the supply and the plug of this node: it started again",
    Cause.DRIVER_SILENT: "read the master's log: it died, hung (an overloaded computer?), or lost its adapter",
    Cause.WATCHDOG_SILENT: "read the watchdog's log: it died, hung (an overloaded computer?), or lost its adapter",
    Cause.WATCHDOG_ENDED: "the watchdog was asked to end while a wheel turned: systemctl, Ctrl-C",
    Cause.DRIVES_DEAF: "check the cable from the computer to the drives, and the termination",
    Cause.BUS_CUT: "check the cable and plugs from the computer to the first drive, and the drives' common supply",
    Cause.NODE_SILENT: "check the cable, the plug and the supply of this node",
    Cause.FEEDBACK_LOST: "check the TPDO settings of this node, and whether SYNC reaches it",
    Cause.BUS_ERRORS: "check cable, termination (60 Ohm between CAN_H and CAN_L) and bit rate",
    Cause.DRIVE_FAULT: "look the code up in the drive's manual; mend its cause, then reset",
    Cause.DRIVE_DISABLED: "check STO and the main supply of this drive",
    Cause.ORDERED_OFF: "read the log of the master: it stopped the drive itself",
    Cause.SETPOINTS_MISSING: "read the driver's log: it stopped sending to this axis",
    Cause.SETPOINTS_KEPT: "the driver did not follow cmd_vel: read its log, and report this as a defect",
    Cause.TWO_COMMANDERS: "find the other publisher: ros2 topic info -v cmd_vel",
    Cause.LEASES_LOST: "read the log of the velocity process: it died, hung, or cannot reach the lease socket",
    Cause.COMMANDS_LOST: "cmd_vel did not reach the driver: check DDS, the load and the driver's executor",
    Cause.ENCODER_JUMPS: "check the encoder's cable, its screen and plugs",
    Cause.POSITION_STUCK: "check the encoder: its position stands still while its drive reports a velocity",
    Cause.VELOCITY_STUCK: "the drive's velocity value stands still while the position moves: restart the drive",
    Cause.WRONG_WAY: "check the direction of the encoder and the order of the motor's phases",
    Cause.NO_MOTION: "turn the wheel by hand with the power off: if the position counts, look for what blocks the "
    "wheel, or for a motor without current; if it does not, the encoder is dead",
    Cause.WHEEL_SLOW: "check the load, the current limit and the wheel: it turns less than ordered",
    Cause.WHEEL_RUNS_ON: "this drive does not follow its setpoints: check its mode, its PDOs and its firmware",
    Cause.REPORTED: "the log of the part that reports it has the values",
    Cause.UNKNOWN: "record with canbase's black box, or candump from before the failure, and give --config robot.yaml",
}
"""What a person looks at first."""


@dataclass(frozen=True, slots=True)
class Found:
    """What a rule has seen: since when, a sentence with the values, and the node (0: no single one).

    `sender`: of the quick stops on the watchdog's PDOs, where the rule shows that it is not the watchdog.
    """

    at_s: float
    text: str
    node_id: int = 0
    sender: str = ""
