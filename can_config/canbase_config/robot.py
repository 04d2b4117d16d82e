"""The model of robot.yaml: every key with its type, unit, range and default. Reading the file is `load.py`.

Conventions: names carry their unit; a length, speed or time without a default must be given. No timeout can be
switched off: each has a range that excludes 0 and infinity. Frames and units follow REP 103 and REP 105.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

DRIVER_NODE_ID = 127
"""CANopen node id of the motor driver: its heartbeat is COB-ID 77Fh."""
WATCHDOG_NODE_ID = 126
"""CANopen node id of the watchdog: its heartbeat is COB-ID 77Eh, its state 1FEh, its reset request 27Eh."""

Name = Annotated[
    str,
    Field(
        pattern=r"^[A-Za-z][A-Za-z0-9_]*$",
        max_length=64,
        json_schema_extra={"form": "letters, digits and _, first a letter"},
    ),
]
Topic = Annotated[
    str,
    Field(
        pattern=r"^/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*$",
        max_length=128,
        json_schema_extra={"form": "letters, digits and _, joined by /, each part first a letter"},
    ),
]

VelocityUnit = Literal["rpm", "0.1rpm", "0.001rpm", "rev/s", "0.001rev/s", "counts/s", "0.1counts/s"]
"""What one bit of 60FFh and 606Ch means, always at the motor shaft (before the gear)."""


class MisfitError(ValueError):
    """Values that are each allowed do not fit together. `at`: where the offender may be, below the raising section."""

    def __init__(self, message: str, *at: tuple[str | int, ...]) -> None:
        super().__init__(message)
        self.at = at


class Section(BaseModel):
    """Base of all sections: immutable, no unknown keys, no silent conversion of types."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, ser_json_inf_nan="constants")


class Bus(Section):
    """The CAN bus as python-can opens it."""

    interface: Annotated[str, Field(min_length=1, description="python-can interface: socketcan, udp_multicast, …")]
    channel: Annotated[str, Field(min_length=1, description="can0, or the multicast group of a virtual bus")]
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000, description="[bit/s]")] = 500_000
    extra: Annotated[dict[str, Any], Field(description="further arguments of can.Bus for this interface")] = {}

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments for `can.Bus`. The bit rate of a socketcan interface is set by the system, not here."""
        given: dict[str, Any] = {"interface": self.interface, "channel": self.channel}
        if self.interface not in ("socketcan", "udp_multicast", "virtual"):
            given["bitrate"] = self.bitrate
        return given | self.extra


class Identity(Section):
    """What object 1018h must say; a key that is not given is not compared."""

    vendor_id: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:1")] | None = None
    product_code: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:2")] | None = None
    revision: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:3")] | None = None
    serial: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:4")] | None = None


class Drive(Section):
    """One axis of one motor drive, and the wheel that it turns."""

    joint: Annotated[Name, Field(description="name in joint_states")]
    node_id: Annotated[int, Field(ge=1, le=125, description="CANopen node id; 126 and 127 are ours")]
    axis: Annotated[int, Field(ge=0, le=1, description="axis in the node; its objects are at 6000h + 800h × axis")] = 0
    side: Annotated[Literal["left", "right"], Field(description="side of the base")]
    direction: Annotated[
        Literal[1, -1], Field(description="+1: a positive motor velocity drives the base forward; -1: mounted mirrored")
    ] = 1
    gear_ratio: Annotated[float, Field(gt=0.0, le=10_000.0, description="motor revolutions per wheel revolution")]
    counts_per_motor_rev: Annotated[
        int, Field(ge=1, le=2**31 - 1, description="increments of 6064h per motor revolution")
    ]
    velocity_unit: Annotated[VelocityUnit, Field(description="one bit of 60FFh and 606Ch, at the motor shaft")] = "rpm"
    identity: Identity = Identity()


class Base(Section):
    """The two-wheeled base."""

    wheel_radius_m: Annotated[float, Field(gt=0.005, le=1.0, description="[m]")]
    track_m: Annotated[float, Field(gt=0.02, le=5.0, description="distance between the wheels' contact points [m]")]
    odom_frame: Annotated[str, Field(min_length=1, description="REP 105")] = "odom"
    base_frame: Annotated[str, Field(min_length=1, description="REP 105")] = "base_link"
    standstill_mps: Annotated[float, Field(gt=0.0, le=0.05, description="a wheel whose rim is slower stands [m/s]")] = (
        0.005
    )


class Limits(Section):
    """What the base may do at most. Magnitudes: they hold forward and backward, left and right."""

    linear_mps: Annotated[float, Field(gt=0.0, le=5.0, description="[m/s]")]
    angular_radps: Annotated[float, Field(gt=0.0, le=20.0, description="[rad/s]")]
    acceleration_mps2: Annotated[float, Field(gt=0.0, le=10.0, description="[m/s²]")]
    deceleration_mps2: Annotated[float, Field(gt=0.0, le=10.0, description="ordinary stop [m/s²]")]
    emergency_deceleration_mps2: Annotated[
        float, Field(gt=0.0, le=20.0, description="quick stop of the drives, 6085h; not below the ordinary one [m/s²]")
    ]
    angular_acceleration_radps2: Annotated[float, Field(gt=0.0, le=50.0, description="[rad/s²]")]
    angular_deceleration_radps2: Annotated[float, Field(gt=0.0, le=50.0, description="[rad/s²]")]
    jerk_mps3: Annotated[float, Field(gt=0.0, le=1000.0, description="[m/s³]")] = 10.0

    @model_validator(mode="after")
    def _emergency_is_the_hardest(self) -> Limits:
        if self.emergency_deceleration_mps2 < self.deceleration_mps2:
            message = (
                f"{self.emergency_deceleration_mps2} must not be below deceleration_mps2, {self.deceleration_mps2}"
            )
            raise MisfitError(message, ("emergency_deceleration_mps2",))
        return self


class Rates(Section):
    """How often things happen."""

    control_hz: Annotated[float, Field(ge=20.0, le=200.0, description="SYNC cycle of the driver [Hz]")] = 100.0
    odometry_hz: Annotated[float, Field(ge=1.0, le=100.0, description="odom, tf and joint_states [Hz]")] = 50.0
    status_hz: Annotated[float, Field(ge=1.0, le=50.0, description="motor_driver/status [Hz]")] = 10.0
    command_hz: Annotated[float, Field(ge=20.0, le=100.0, description="cmd_vel_mux and cmd_vel at least [Hz]")] = 50.0


class Timeouts(Section):
    """Ages are measured from the local monotonic receive time. None of them can be switched off."""

    command_s: Annotated[float, Field(ge=0.05, le=0.5, description="cmd_vel at the driver [s]")] = 0.2
    lease_s: Annotated[float, Field(ge=0.05, le=0.5, description="lease at the watchdog [s]")] = 0.25
    drive_heartbeat_s: Annotated[
        float, Field(ge=0.05, le=1.0, description="heartbeat of watchdog and driver as the drives watch it, 1016h [s]")
    ] = 0.3
    feedback_s: Annotated[float, Field(ge=0.02, le=0.5, description="status TPDO of an enabled drive [s]")] = 0.1
    watchdog_s: Annotated[float, Field(ge=0.05, le=0.5, description="watchdog's state frame at the driver [s]")] = 0.2
    standstill_s: Annotated[
        float, Field(ge=0.1, le=10.0, description="from the order to stop until the driver gives up the ramp [s]")
    ] = 3.0
    sdo_s: Annotated[float, Field(ge=0.05, le=5.0, description="one SDO answer [s]")] = 0.3
    boot_s: Annotated[
        float, Field(ge=1.0, le=600.0, description="until a missing drive is reported as an error [s]")
    ] = 10.0
    odometry_s: Annotated[float, Field(ge=0.05, le=1.0, description="odom at the action server [s]")] = 0.2


class MuxSource(Section):
    """One source of velocity commands."""

    topic: Annotated[Topic, Field(description="relative to the node's namespace")]
    priority: Annotated[int, Field(ge=0, le=255, description="the higher wins; no two alike")]
    timeout_s: Annotated[float, Field(ge=0.05, le=2.0, description="silent for longer: holds no more [s]")]
    stamped: Annotated[bool, Field(description="true: TwistStamped, false: Twist")] = True


DEFAULT_SOURCES = {
    "joystick": MuxSource(topic="cmd_vel_joy", priority=100, timeout_s=0.3),
    "navigation": MuxSource(topic="cmd_vel_nav", priority=50, timeout_s=0.5),
    "action": MuxSource(topic="cmd_vel_action", priority=40, timeout_s=0.3),
}


class Mux(Section):
    """Who may drive."""

    sources: Annotated[dict[Name, MuxSource], Field(min_length=1)] = DEFAULT_SOURCES

    @model_validator(mode="after")
    def _no_two_alike(self) -> Mux:
        for what in ("priority", "topic"):
            seen: dict[object, str] = {}
            for name, source in self.sources.items():
                other = seen.setdefault(getattr(source, what), name)
                if other != name:
                    message = f"sources {other} and {name} have the same {what}; each needs its own"
                    raise MisfitError(message, ("sources", name, what))
        return self


class Scan(Section):
    """The laser scanner that the safety filter looks at."""

    required: Annotated[bool, Field(description="true: without a fresh scan nothing moves")]
    topic: Topic = "scan"
    timeout_s: Annotated[float, Field(ge=0.05, le=1.0, description="[s]")] = 0.3
    x_m: Annotated[float, Field(ge=-5.0, le=5.0, description="scanner in base_link [m]")] = 0.0
    y_m: Annotated[float, Field(ge=-5.0, le=5.0, description="scanner in base_link [m]")] = 0.0
    yaw_rad: Annotated[float, Field(ge=-2 * math.pi, le=2 * math.pi, description="scanner in base_link [rad]")] = 0.0


class Estop(Section):
    """The software emergency stop topic (std_msgs/Bool, true = stop). Not a safety function: STO is."""

    required: Annotated[bool, Field(description="true: a silent topic counts as pressed")]
    topic: Topic = "estop_state"
    timeout_s: Annotated[float, Field(ge=0.05, le=2.0, description="[s]")] = 0.5


class Footprint(Section):
    """Rectangle around the base in base_link, distances from its origin, all positive."""

    front_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]
    rear_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]
    left_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]
    right_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]


class Safety(Section):
    """The last place where a command is decided."""

    footprint: Footprint
    scan: Scan
    estop: Estop
    command_timeout_s: Annotated[float, Field(ge=0.05, le=0.5, description="cmd_vel_mux at the filter [s]")] = 0.2
    stop_distance_m: Annotated[float, Field(gt=0.0, le=5.0, description="free way below: stop [m]")] = 0.15
    slow_distance_m: Annotated[float, Field(gt=0.0, le=10.0, description="free way below: slow down [m]")] = 0.6

    @model_validator(mode="after")
    def _slow_before_stop(self) -> Safety:
        if self.slow_distance_m <= self.stop_distance_m:
            slow, stop = self.slow_distance_m, self.stop_distance_m
            message = f"slow_distance_m ({slow}) must be greater than stop_distance_m ({stop})"
            raise MisfitError(message, ("slow_distance_m",), ("stop_distance_m",))
        return self


class Lease(Section):
    """The Unix datagram socket on which the safety filter tells the watchdog what it ordered."""

    socket: Annotated[str, Field(min_length=1, max_length=100, description="path; its folder is made if missing")]


class Relay(Section):
    """A GPIO output that is toggled as long as the last rung of the ladder is not reached. Needs the package gpiod."""

    chip: Annotated[str, Field(min_length=1, max_length=100, description="/dev/gpiochip0, …")]
    line: Annotated[int, Field(ge=0, le=1023, description="offset of the line on the chip")]


class Watchdog(Section):
    """How much the watchdog forgives. No tolerance can be switched off, and none is unlimited."""

    latency_s: Annotated[
        float,
        Field(ge=0.02, le=0.5, description="an order on its way to the driver, on top of timeouts.command_s [s]"),
    ] = 0.05
    drive_lag_s: Annotated[
        float, Field(ge=0.01, le=0.5, description="so long a wheel may keep the speed of an older setpoint [s]")
    ] = 0.1
    target_tolerance_mps: Annotated[
        float, Field(gt=0.0, le=0.2, description="a setpoint beyond what the leases allow, at the rim [m/s]")
    ] = 0.03
    target_tolerance_share: Annotated[
        float, Field(ge=0.0, le=0.2, description="the same as a share of the allowed speed, added to it")
    ] = 0.03
    motion_tolerance_mps: Annotated[
        float, Field(gt=0.0, le=0.5, description="a wheel beyond what its setpoints allow, at the rim [m/s]")
    ] = 0.05
    motion_tolerance_share: Annotated[
        float, Field(ge=0.0, le=0.5, description="the same as a share of the allowed speed, added to it")
    ] = 0.1
    feedback_samples: Annotated[
        int, Field(ge=1, le=20, description="so many velocity samples in a row must be bad before they stop the base")
    ] = 5
    overspeed_factor: Annotated[
        float, Field(ge=1.05, le=2.0, description="a wheel may be so many times as fast as the limits allow")
    ] = 1.2
    travel_tolerance_m: Annotated[
        float, Field(ge=0.005, le=0.5, description="encoder and measured velocity apart, within about 0.5 s [m]")
    ] = 0.05
    bus_failed_s: Annotated[float, Field(ge=0.06, le=0.5, description="the bus takes no frames for so long [s]")] = 0.1
    loop_late_s: Annotated[
        float, Field(ge=0.02, le=0.5, description="the watchdog's own loop stands still for so long [s]")
    ] = 0.1
    relay: Annotated[Relay, Field(description="keeps a safety relay closed")] | None = None


def _no_parallel(policy: object) -> object:
    if policy == "parallel":
        raise MisfitError(
            "there is one base, and two goals would both order its speed; choose reject, queue or preempt"
        )
    return policy


class Action(Section):
    """The action server: drive_distance and rotate_angle."""

    goal_policy: Annotated[
        Literal["reject", "queue", "preempt"],
        BeforeValidator(_no_parallel),
        Field(description="a new goal while one runs: refused, waits for its turn, or takes the base after a stop"),
    ] = "reject"
    queue_length: Annotated[int, Field(ge=1, le=100, description="so many goals may wait with goal_policy: queue")] = 8

    require_client_lease: Annotated[
        bool, Field(description="true: a goal runs only while its client sends keepalives; `canbase drive` does")
    ] = False
    client_lease_s: Annotated[
        float, Field(ge=0.3, le=10.0, description="no keepalive for so long: CLIENT_LOST, if required [s]")
    ] = 1.0
    min_distance_m: Annotated[float, Field(gt=0.0, le=1.0, description="[m]")] = 0.01
    max_distance_m: Annotated[float, Field(gt=0.0, le=1000.0, description="[m]")] = 5.0
    min_speed_mps: Annotated[float, Field(gt=0.0, le=1.0, description="[m/s]")] = 0.02
    max_speed_mps: Annotated[float, Field(gt=0.0, le=5.0, description="[m/s]")] = 0.5
    min_angle_rad: Annotated[float, Field(gt=0.0, le=1.0, description="of rotate_angle [rad]")] = 0.02
    max_angle_rad: Annotated[float, Field(gt=0.0, le=1000.0, description="ten turns by default [rad]")] = 63.0
    min_speed_radps: Annotated[float, Field(gt=0.0, le=1.0, description="[rad/s]")] = 0.1
    max_speed_radps: Annotated[float, Field(gt=0.0, le=20.0, description="[rad/s]")] = 1.5
    tolerance_m: Annotated[
        float,
        Field(gt=0.0, le=0.1, description="a goal that ends nearer has succeeded; of a turn, at the wheels' rims [m]"),
    ] = 0.005
    control_hz: Annotated[float, Field(ge=10.0, le=100.0, description="cmd_vel_action [Hz]")] = 50.0
    feedback_hz: Annotated[float, Field(ge=1.0, le=50.0, description="[Hz]")] = 10.0
    progress_timeout_s: Annotated[
        float, Field(ge=0.2, le=60.0, description="no motion for so long: NO_PROGRESS [s]")
    ] = 2.0
    overall_factor: Annotated[
        float,
        Field(ge=1.1, le=100.0, description="overall timeout = factor × the ideal time of the goal + overall_extra_s"),
    ] = 2.0
    overall_extra_s: Annotated[float, Field(ge=0.5, le=600.0, description="[s]")] = 5.0

    @model_validator(mode="after")
    def _ordered(self) -> Action:
        for quantity in ("distance_m", "speed_mps", "angle_rad", "speed_radps"):
            low, high = f"min_{quantity}", f"max_{quantity}"
            if getattr(self, low) >= getattr(self, high):
                message = f"{high} ({getattr(self, high)}) must be greater than {low} ({getattr(self, low)})"
                raise MisfitError(message, (high,), (low,))
        return self


class Robot(Section):
    """The whole of robot.yaml."""

    name: Annotated[Name, Field(description="used in log lines and diagnostics")] = "robot"
    bus: Bus
    drives: Annotated[tuple[Drive, ...], Field(min_length=2, max_length=8, strict=False)]
    base: Base
    limits: Limits
    rates: Rates = Rates()
    timeouts: Timeouts = Timeouts()
    mux: Mux = Mux()
    safety: Safety
    lease: Lease
    watchdog: Watchdog = Watchdog()
    action: Action = Action()

    @model_validator(mode="after")
    def _drives_fit_together(self) -> Robot:
        joints: dict[str, int] = {}
        places: dict[tuple[int, int], int] = {}
        for i, drive in enumerate(self.drives):
            if joints.setdefault(drive.joint, i) != i:
                raise MisfitError(
                    f"two drives have the joint {drive.joint}; each needs its own", ("drives", i, "joint")
                )
            if places.setdefault((drive.node_id, drive.axis), i) != i:
                message = f"two drives are on node {drive.node_id}, axis {drive.axis}; each needs its own"
                raise MisfitError(message, ("drives", i, "node_id"))
        if {drive.side for drive in self.drives} != {"left", "right"}:
            message = f"all drives are on the {self.drives[0].side}; a base needs at least one on each side"
            raise MisfitError(message, ("drives", 1, "side"))
        return self
