"""What the driver knows at one moment, as plain frozen data: the core makes it, `messages.py` makes ROS messages of it.

No ROS, no behaviour. SI units at the wheel and the base; ages are local monotonic seconds, NaN: nothing received yet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_driver.causes import Cause
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia402 import DriveState
from canbase_driver.supervision.bus_health import ControllerState
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView

Covariance = tuple[float, ...]
"""36 numbers: 6 × 6, row by row, in the order x, y, z, rotation about x, y, z (geometry_msgs, REP 103)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSnapshot:
    """One axis and its wheel. Positive: the wheel drives the base forward."""

    joint: str
    """Joint name of robot.yaml."""
    node_id: int
    """CANopen node id, 1..127."""
    axis: int
    """Axis in that node, 0..7."""
    nmt_state: NmtState | None
    """None: unknown."""
    state: DriveState | None
    """None: unknown, its statusword shows no state or none came yet."""
    statusword: int
    """6041h as received, u16."""
    error_code: int
    """603Fh or the code of the last emergency message, u16; 0: none."""
    error_text: str
    """The same in words; empty when there is none."""
    target_radps: float
    """Setpoint at the wheel [rad/s]."""
    velocity_radps: float
    """Measured at the wheel, 606Ch [rad/s]; 0 until the first feedback."""
    position_rad: float
    """Wheel angle since the first feedback, unwrapped [rad]; 0 until then."""
    feedback_age_s: float
    """Age of the oldest of its values, 6041h, 6064h, 606Ch [s]; NaN: not all came yet."""
    heartbeat_age_s: float
    """Since its last heartbeat [s]; NaN: none yet."""
    stops_by_itself: bool
    """Something makes it stop when nobody commands it; set and read back."""
    self_stop: str = ""
    """What does; empty: nothing."""
    warning: bool = False
    """Statusword bit 7."""
    internal_limit: bool = False
    """Statusword bit 11; some drives set it from the start."""
    voltage_v: float = math.nan
    """Of its supply [V]; NaN: not measured."""
    torque_share: float = math.nan
    """Of the rated torque; NaN: the drive does not tell it."""
    current_a: float = math.nan
    """Of the motor [A]; NaN: not measured."""
    temperature_c: float = math.nan
    """Of the drive [°C]; NaN: not measured."""
    boot_notes: tuple[str, ...] = ()
    """What it lacked or refused in its last boot."""
    boot_changes: tuple[str, ...] = ()
    """What its last boot had to change."""
    boot_problem: str = ""
    """Why its last boot failed; empty: it did not."""
    configured: bool = True
    """Its boot has ended well: what it says of itself is set and read back."""

    @property
    def nmt_text(self) -> str:
        """Its NMT state in the words of CiA 301, or unknown."""
        return "unknown" if self.nmt_state is None else self.nmt_state.text

    @property
    def state_text(self) -> str:
        """Its state in the words of CiA 402, or unknown."""
        return "unknown" if self.state is None else self.state.text


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSnapshot:
    """The driver, its drives, the watchdog as it sees it, and the base's pose and motion."""

    time_s: float
    """Local monotonic time of the snapshot [s]."""
    state: DriverState
    cause: Cause
    """Why it is not ENABLED; NONE when it is."""
    detail: str
    """One sentence with the values."""
    clears_on: str
    """What ends it; empty when ENABLED."""
    watchdog: WatchdogView
    watchdog_cause: str
    """Cause of its trip; "none"."""
    watchdog_age_s: float
    """Since its last state frame [s]; NaN: none yet."""
    watchdog_rung: int = 0
    """How far up its ladder it has gone, 0 to 4."""
    watchdog_lease_age_s: float = math.nan
    """Age of the last valid lease, as it says [s]; NaN: none."""
    watchdog_trips: int = 0
    """Its counters, since its start."""
    watchdog_leases_refused: int = 0
    watchdog_frames_dropped: int = 0
    watchdog_bus_errors: int = 0
    watchdog_pause_max_s: float = 0.0
    """Longest pause of its loop in the last half second [s], at most 0.255."""
    standstill: bool
    """All wheels stand, by encoder and velocity; or a stand is assumed."""
    standstill_assumed: str = ""
    """Why it is assumed and not measured; empty: it is measured, or they do not stand."""
    command_age_s: float
    """Age of cmd_vel by local receive time [s]; NaN: none yet."""
    command_fresh: bool
    """command_age_s is within timeouts.command_s."""
    commands_refused: int
    """Commands that were not finite, since start."""
    cycles: int
    """Cycles of the SYNC loop since start."""
    overruns: int
    """Cycles that began more than half a period late, since start."""
    cycle_lateness_max_s: float
    """Greatest lateness of a cycle in the last second [s]."""
    frames_dropped: int
    """Received frames that could not be understood, since start."""
    send_errors: int
    """Frames that could not be sent in time, since start."""
    bus_problem: str = ""
    """Why the bus does not work now; empty when it does."""
    controller: ControllerState = ControllerState.ERROR_ACTIVE
    """What error frames say of the CAN controller."""
    receive_errors: int = 0
    """Failed receptions, since start."""
    error_frames: int = 0
    """Error frames of the CAN controller, since start."""
    bus_failures: int = 0
    """How often the bus failed and was opened anew, since start."""
    drives: tuple[DriveSnapshot, ...]
    """In the order of robot.yaml."""
    x_m: float
    """Pose of base_frame in odom_frame, forward at the start [m]."""
    y_m: float
    """To the left at the start [m]."""
    yaw_rad: float
    """Counter-clockwise, not wrapped [rad]."""
    linear_mps: float
    """Measured velocity of the base, forward positive [m/s]."""
    angular_radps: float
    """Measured, counter-clockwise positive [rad/s]."""
    pose_covariance: Covariance
    twist_covariance: Covariance
    odometry_valid: bool
    """Every wheel has fresh feedback and a reference: the pose moves as the wheels do. Otherwise it is not published.

    It is about now. What was rolled while a wheel had no reference never enters the pose, that of no wheel: the pose
    goes on without a jump from where it was, and `travel_losses` tells that it is a little behind.
    """
    travel_losses: int = 0
    """How often the pose missed some travel since start: a drive restarted, or an encoder jumped for good."""
    pose_resets: int = 0
    """How often the pose was set anew, or missed some travel, since start: distances across one mean nothing."""
    odom_frame: str = "odom"
    """REP 105."""
    base_frame: str = "base_link"
    """REP 105."""


@dataclass(frozen=True, slots=True)
class StopRecord:
    """One stop of a moving or enabled base, for the topic stop_events."""

    stopped_by: str
    """velocity_mux, safety_filter, motor_driver or watchdog."""
    cause: str
    detail: str
    """One sentence with the values."""
    latched: bool
    """It needs a reset."""
    clears_on: str
    at_s: float
    """Local monotonic time of the cause [s]."""
