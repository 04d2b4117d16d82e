"""What the watchdog process needs of robot.yaml, as plain values. Standard library only: the watchdog imports it."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from typing import Any

STATE_PERIOD_S = 0.05
"""From one state frame of the watchdog to the next, where nothing changes [s]."""
HEARTBEATS_PER_TIMEOUT = 3
"""Driver and watchdog send their heartbeats this often in the time that the drives allow for one."""
GUARDS_PER_TIMEOUT = 5
"""Node guarding requests in the same time. An answer that is lost costs two of them, as the one after it has the toggle
bit of the one before."""
LIFE_TIME_FACTOR = 4
"""100Dh: a guarded drive stops when so many requests in a row are missing, before others miss its answers."""


def guard_time_ms(drive_heartbeat_s: float) -> int:
    """100Ch of a guarded drive [ms]: from one request to the next."""
    return int(1000.0 * drive_heartbeat_s + 1e-6) // GUARDS_PER_TIMEOUT


@dataclass(frozen=True)
class WatchedLayout:
    """Where the objects of a drive are, and how wide. The defaults are those of CiA 402-2, axes at + 800h."""

    sub_index: bool = False
    """Two motors are sub-index 1 and 2 of the same 60FFh, 606Ch and 6064h, not at + 800h."""
    shared_controlword: bool = False
    """One 6040h for both motors of a node."""
    packed_statusword: bool = False
    """6041h has 32 bits, the second motor's in the upper half."""
    target_bits: int = 32
    """Width of 60FFh."""
    velocity_bits: int = 32
    """Width of 606Ch."""
    vl: bool = False
    """Mode 2: target and actual velocity are 6042h and 6044h."""


@dataclass(frozen=True)
class WatchedDrive:
    """One axis on the bus. `mps_per_bit`: rim speed of its wheel, forward positive, for one bit of 60FFh.

    `m_per_count`: travel of the rim, forward positive, for one increment of 6064h. `velocity_scale`: one bit of 606Ch
    in bits of 60FFh.
    """

    joint: str
    node_id: int
    axis: int
    side: str
    mps_per_bit: float
    m_per_count: float
    velocity_scale: float = 1.0
    answers_sync: bool = True
    """Its feedback PDOs are sent once for each SYNC, or as often by its own clock; False: more often than that."""
    layout: WatchedLayout = WatchedLayout()
    hardest_braking_mps2: float = 8.0
    """With power it brakes its wheel no harder."""
    guarded: bool = False
    """It sends no heartbeat: the watchdog requests its state (node guarding), and it stops when no request comes."""

    @property
    def velocity_mps_per_bit(self) -> float:
        """Rim speed, forward positive, for one bit of 606Ch."""
        return self.mps_per_bit * self.velocity_scale


@dataclass(frozen=True)
class RelayLine:
    """The GPIO output that is toggled to keep a safety relay closed: line `offset` of `chip` (/dev/gpiochip0)."""

    chip: str
    offset: int


@dataclass(frozen=True)
class WatchdogConfig:
    """Everything that the watchdog knows. Times in seconds, speeds in m/s at the rim of the wheel."""

    bus_arguments: dict[str, Any]
    drives: tuple[WatchedDrive, ...]
    track_m: float
    control_hz: float
    """SYNCs of the driver per second."""

    lease_socket: str
    lease_timeout_s: float
    drive_heartbeat_s: float
    feedback_timeout_s: float
    loop_late_s: float
    """It trips when its own loop stood still for longer while a drive is enabled."""
    bus_failed_s: float
    """It trips when the bus takes no frames for this long while a drive is enabled."""

    standstill_mps: float
    linear_mps: float
    angular_radps: float
    acceleration_mps2: float
    deceleration_mps2: float
    angular_acceleration_radps2: float
    angular_deceleration_radps2: float
    max_wheel_mps: float
    """The fastest that the driver lets a wheel turn."""

    order_hold_s: float
    """How long the driver may go on to follow an order that another one has replaced."""
    drive_lag_s: float
    """How long a wheel may keep the speed of a setpoint that another one has replaced."""
    target_tolerance_mps: float
    target_tolerance_share: float
    """Of the allowed speed, on top of target_tolerance_mps; 0.05: 5 %."""
    motion_tolerance_mps: float
    motion_tolerance_share: float
    feedback_samples: int
    """This many velocity samples in a row must be bad before they count."""
    overspeed_factor: float
    travel_tolerance_m: float
    """How far encoder and measured velocity may drift apart."""
    braking_mps2: float
    """A wheel that is stopped under power and loses less does not brake as it must."""
    coasting_s: float
    """A wheel without power has rolled out after this on a level floor."""
    motion_missing_s: float
    """An enabled wheel that is ordered to move may show no motion for this long ..."""
    motion_missing_m: float
    """... or for so much of the ordered travel, whichever is longer."""
    jolt_mps2: float
    """No wheel changes its speed faster."""
    slow_wheel_share: float
    """A wheel may be slower than its setpoint by this share, on top of motion_tolerance_mps ..."""
    slow_wheel_s: float
    """... and by more for this long."""
    slowest_ramp_mps2: float
    """A wheel gets to its setpoint at least so fast."""
    twist_tolerance_mps: float
    twist_tolerance_share: float
    twist_s: float
    """The measured twist may be outside of the ordered one for this long."""

    order_wait_s: float = 0.5
    """An order that another one has replaced gets to the driver, and into its setpoints, within this time."""
    jerk_mps3: float = 100.0
    """The driver's limit; order_hold_s has what it adds to a change of speed."""
    emergency_deceleration_mps2: float = 2.0
    """With which the driver brakes while the leases have "brakes hard", not below deceleration_mps2 ..."""
    emergency_wait_s: float = 0.12
    """... from so long after the first of them on."""
    jolts: int = 5
    """This many velocity changes that no wheel can do show that a sensor is faulty."""
    braking_samples: int = 3
    """This many samples in a row of a wheel that brakes too little count."""
    stand_impulse_s: float = 0.05
    """A drive may push for this long at rated torque, or longer at less, while its wheel shows no motion."""
    stand_answer_s: float = 0.2
    """With zero ordered, a drive that did so must switch its power off within this time after it [s]."""
    stand_proof: bool = True
    """False: drives keep their power at standstill."""

    hardest_stop_mps2: float = 8.0
    """A wheel without power loses no more speed."""

    lease_uid: int | None = None
    """The only user whose leases count, None: the watchdog's own."""
    relay: RelayLine | None = None
    """None: there is no such relay."""
    robot: str = "robot"
    """`name` in robot.yaml: whose record of a trip it keeps."""
    recording_folder: str | None = None
    """Where the inputs of a trip are written; None: the state folder."""
    recording_s: float = 10.0
    """How far they go back [s]."""
    recordings: int = 20
    """So many are kept."""

    @property
    def heartbeat_period_s(self) -> float:
        """From one heartbeat of driver or watchdog to the next [s]."""
        return self.drive_heartbeat_s / HEARTBEATS_PER_TIMEOUT

    @property
    def emergency_share(self) -> float:
        """An emergency stop takes this share of the time of an ordinary one without jerk limit, of turns too."""
        return self.deceleration_mps2 / self.emergency_deceleration_mps2

    @property
    def guard_period_s(self) -> float:
        """From one node guarding request to the next, of each guarded drive [s]."""
        return guard_time_ms(self.drive_heartbeat_s) / 1000.0

    @property
    def is_virtual(self) -> bool:
        """The bus has no wire: its drives are simulated."""
        return self.bus_arguments.get("interface") in ("udp_multicast", "virtual")

    @property
    def hears_itself(self) -> bool:
        """A multicast bus gives its frames back to their sender; SocketCAN and other adapters do not."""
        return self.bus_arguments.get("interface") == "udp_multicast"

    def to_json(self) -> str:
        """One line of JSON that `from_json` reads back."""
        return json.dumps(dataclasses.asdict(self))

    @staticmethod
    def from_json(text: str) -> WatchdogConfig:
        """The configuration from `to_json`. Raises TypeError or ValueError when it is not one."""
        values = json.loads(text)
        drives = tuple(_drive(drive) for drive in values.pop("drives"))
        relay = values.pop("relay")
        return WatchdogConfig(drives=drives, relay=RelayLine(**relay) if relay else None, **values)


def _drive(values: dict[str, Any]) -> WatchedDrive:
    return WatchedDrive(layout=WatchedLayout(**values.pop("layout")), **values)
