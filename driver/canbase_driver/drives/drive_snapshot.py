"""What the driver knows of one axis and its wheel at one moment, as plain frozen data; `drive_group.py` makes it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia402 import DriveState
from canbase_driver.drives.drive_values import NamedValue


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
    """Something makes it stop without commands; set and read back."""
    self_stop: str = ""
    """What does; empty: nothing."""
    warning: bool = False
    """Statusword bit 7."""
    internal_limit: bool = False
    """Statusword bit 11; some drives set it from the start."""
    voltage_v: float = math.nan
    """Of its supply [V]; NaN: not measured."""
    torque_share: float = math.nan
    """Of the rated torque; NaN: the drive does not report it."""
    effort_nm: float = math.nan
    """The same at the wheel [N·m]; NaN: the drive does not report it, or robot.yaml has no rated_torque_nm."""
    current_a: float = math.nan
    """Of the motor [A], with the sign that the drive gives it; NaN: not measured."""
    temperature_c: float = math.nan
    """Of the drive [°C]; NaN: not measured."""
    values: tuple[NamedValue, ...] = ()
    """What robot.yaml wants published of it."""
    boot_notes: tuple[str, ...] = ()
    """What it lacked or refused in its last boot."""
    boot_changes: tuple[str, ...] = ()
    """What its last boot had to change."""
    boot_problem: str = ""
    """Why its last boot failed; empty: it did not."""
    configured: bool = True
    """Its boot has succeeded: every setting was read back."""

    @property
    def nmt_text(self) -> str:
        """Its NMT state in the words of CiA 301, or unknown."""
        return "unknown" if self.nmt_state is None else self.nmt_state.text

    @property
    def state_text(self) -> str:
        """Its state in the words of CiA 402, or unknown."""
        return "unknown" if self.state is None else self.state.text
