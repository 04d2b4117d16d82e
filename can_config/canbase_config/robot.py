"""The model of robot.yaml: every key with its type, unit, range and default. Reading the file is `load.py`.

Conventions: names carry their unit; a length, speed or time without a default must be given. No timeout can be
switched off: each has a range that excludes 0 and infinity. Frames and units follow REP 103 and REP 105.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from canbase_config import bus_load, drive_values, reserves, stopping, tolerances, units
from canbase_config.action import Action
from canbase_config.black_box import BlackBox
from canbase_config.commissioned import Commissioned
from canbase_config.drive import Drive
from canbase_config.health import Battery, Health
from canbase_config.mux import Mux
from canbase_config.odometry import OdometrySettings
from canbase_config.safety import Safety
from canbase_config.section import MisfitError, Name, Section
from canbase_config.watchdog_section import Watchdog

BROADCAST = 0
"""Lower seven bits of the identifiers of NMT, SYNC and TIME."""
NODE_ID_BITS, COB_ID_BITS = 0x7F, 0x7FF
LSS_REQUEST = 0x7E5
"""CiA 305: node ids and bit rates."""
REMOTE = 0x4000_0000
"""linux/can.h, CAN_RTR_FLAG: above an identifier, in a filter of the kernel."""
DRIVER_NODE_ID = 127
"""CANopen node id of the motor driver: its heartbeat is COB-ID 77Fh."""
WATCHDOG_NODE_ID = 126
"""CANopen node id of the watchdog: its heartbeat is COB-ID 77Eh, its state 1FEh, its reset request 27Eh."""
LONGEST_STOP_S = 20.0
"""A base that needs longer for an ordinary stop cannot be supervised [s]."""
CYCLIC = 9
"""6060h: cyclic synchronous velocity, without ramps in the drive (CiA 402-2)."""


class Bus(Section):
    """The CAN bus as python-can opens it."""

    interface: Annotated[str, Field(min_length=1, description="python-can interface: socketcan, udp_multicast, …")]
    channel: Annotated[str, Field(min_length=1, description="can0, or the multicast group of a virtual bus")]
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000, description="[bit/s]")] = 500_000
    sync_counter: (
        Annotated[
            int, Field(ge=2, le=240, description="SYNC carries a byte that counts from 1 to this, 1019h; default: none")
        ]
        | None
    ) = None
    extra: Annotated[
        dict[str, Any], Field(default_factory=dict, description="further arguments of can.Bus for this interface")
    ]

    @model_validator(mode="after")
    def _extra_adds_only(self) -> Bus:
        for key in ("interface", "channel", "bitrate"):
            if key in self.extra:
                raise MisfitError(f"{key} is a key of bus itself; extra only adds arguments", ("extra", key))
        return self

    @property
    def is_virtual(self) -> bool:
        """Whether it has no wire, so no bit rate either."""
        return self.interface in ("udp_multicast", "virtual")

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments for `can.Bus`. The bit rate of a socketcan interface is set by the system, not here.

        Frames of a simulated bus do not leave this computer unless `extra` has a hop_limit.
        """
        given: dict[str, Any] = {"interface": self.interface, "channel": self.channel}
        if self.interface == "udp_multicast":
            given["hop_limit"] = 0
        if self.interface != "socketcan" and not self.is_virtual:
            given["bitrate"] = self.bitrate
        return given | self.extra


class Base(Section):
    """The two-wheeled base."""

    wheel_radius_m: Annotated[float, Field(gt=0.005, le=1.0, description="[m]")]
    wheel_ratio: Annotated[
        float,
        Field(ge=0.9, le=1.1, description="radius of the right wheels / of the left ones; wheel_radius_m is the mean"),
    ] = 1.0
    track_m: Annotated[float, Field(gt=0.02, le=5.0, description="distance between the wheels' contact points [m]")]
    odom_frame: Annotated[str, Field(min_length=1, description="REP 105")] = "odom"
    base_frame: Annotated[str, Field(min_length=1, description="REP 105")] = "base_link"
    standstill_mps: Annotated[
        float, Field(gt=0.0, le=0.05, description="a wheel whose rim is slower is at standstill [m/s]")
    ] = 0.005

    def radius_m(self, side: str) -> float:
        """Wheel radius of one side, `left` or `right` [m]. Their mean is wheel_radius_m."""
        left_m = 2.0 * self.wheel_radius_m / (1.0 + self.wheel_ratio)
        return left_m * self.wheel_ratio if side == "right" else left_m


class Limits(Section):
    """Greatest velocities and accelerations of the base, as magnitudes: forward and backward, left and right."""

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


SMALL_COMPUTER_HZ: Final = {"control_hz": 50.0, "odometry_hz": 25.0}
"""What the profile of rates of that name changes; odom comes with every second cycle."""


class Rates(Section):
    """Rates of the loops and messages."""

    profile: Annotated[
        Literal["standard", "small_computer"],
        Field(description="defaults of control_hz and odometry_hz: standard 100 and 50, small_computer 50 and 25"),
    ] = "standard"
    control_hz: Annotated[float, Field(ge=20.0, le=200.0, description="SYNC cycle of the driver [Hz]")] = 100.0
    odometry_hz: Annotated[float, Field(ge=1.0, le=100.0, description="odom, tf and joint_states [Hz]")] = 50.0
    status_hz: Annotated[float, Field(ge=1.0, le=50.0, description="motor_driver/status [Hz]")] = 10.0
    command_hz: Annotated[float, Field(ge=20.0, le=100.0, description="cmd_vel_mux and cmd_vel at least [Hz]")] = 50.0

    @model_validator(mode="before")
    @classmethod
    def _of_the_profile(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("profile") == "small_computer":
            return SMALL_COMPUTER_HZ | given
        return given


class Timeouts(Section):
    """Ages are measured from the local monotonic receive time. None of them can be switched off."""

    command_s: Annotated[float, Field(ge=0.05, le=0.5, description="cmd_vel at the driver [s]")] = 0.2
    lease_s: Annotated[float, Field(ge=0.05, le=0.5, description="lease at the watchdog [s]")] = 0.25
    drive_heartbeat_s: Annotated[
        float, Field(ge=0.05, le=1.0, description="heartbeat of watchdog and driver as the drives watch it, 1016h [s]")
    ] = 0.3
    feedback_s: Annotated[float, Field(ge=0.02, le=0.5, description="status TPDO of an enabled drive [s]")] = 0.1
    watchdog_s: Annotated[float, Field(ge=0.05, le=0.5, description="watchdog's state frame at the driver [s]")] = 0.2
    standstill_s: (
        Annotated[
            float,
            Field(
                ge=0.1,
                le=LONGEST_STOP_S,
                description="from the order to stop until the driver gives up the ramp; default: from limits [s]",
            ),
        ]
        | None
    ) = None
    sdo_s: Annotated[float, Field(ge=0.05, le=5.0, description="one SDO answer [s]")] = 0.3
    boot_s: Annotated[
        float, Field(ge=1.0, le=600.0, description="until a missing drive is reported as an error [s]")
    ] = 10.0
    odometry_s: Annotated[float, Field(ge=0.05, le=1.0, description="odom at the action server [s]")] = 0.2


class Lease(Section):
    """The Unix datagram socket on which the safety filter sends its orders to the watchdog."""

    socket: Annotated[
        str, Field(min_length=1, max_length=100, description="path, also below $XDG_RUNTIME_DIR; its folder is created")
    ]
    uid: (
        Annotated[
            int, Field(ge=0, le=2**32 - 2, description="number of the only user whose leases count; none: watchdog's")
        ]
        | None
    ) = None


class Robot(Section):
    """The whole of robot.yaml."""

    name: Annotated[Name, Field(description="used in log lines and diagnostics")] = "robot"
    bus: Bus
    drives: Annotated[
        tuple[Drive, ...],
        Field(min_length=2, max_length=8, strict=False, description="one for each driven wheel"),
    ]
    base: Base
    limits: Limits
    odometry: OdometrySettings = OdometrySettings()
    rates: Rates = Rates()
    timeouts: Timeouts = Timeouts()
    mux: Mux = Mux()
    safety: Safety
    lease: Lease
    watchdog: Watchdog = Watchdog()
    action: Action = Action()
    black_box: BlackBox = BlackBox()
    health: Health = Health()
    battery: Annotated[Battery | None, Field(description="none: the drives' supply is not the battery")] = None
    commissioned: Commissioned = Commissioned()

    def bus_arguments(self) -> dict[str, Any]:
        """Keyword arguments for `can.Bus` of the driver and the watchdog. On SocketCAN the kernel passes the frames of
        this robot alone, so that a sensor on the same bus wakes neither: broadcast ones (NMT, SYNC), and all 11-bit
        identifiers whose lower seven bits are the node id of a drive, the driver or the watchdog (CiA 301, 7.3.3), and
        LSS requests. None is a remote frame: those are requests of the watchdog to drives.
        """
        if self.bus.interface != "socketcan":
            return self.bus.arguments()
        nodes = [BROADCAST, *sorted({drive.node_id for drive in self.drives}), WATCHDOG_NODE_ID, DRIVER_NODE_ID]
        filters = [{"can_id": node_id, "can_mask": REMOTE | NODE_ID_BITS, "extended": False} for node_id in nodes]
        filters.append({"can_id": LSS_REQUEST, "can_mask": REMOTE | COB_ID_BITS, "extended": False})
        return {"can_filters": filters} | self.bus.arguments()

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
        self._check_nodes()
        if {drive.side for drive in self.drives} != {"left", "right"}:
            message = f"all drives are on the {self.drives[0].side}; a base needs at least one on each side"
            raise MisfitError(message, ("drives", 1, "side"))
        return self

    @model_validator(mode="after")
    def _keys_fit_each_other(self) -> Robot:
        reserves.check(self)
        tolerances.check(self)
        return self

    @model_validator(mode="after")
    def _stops_in_time(self) -> Robot:
        ramp_s, given_s, limits = stopping.longest_ramp_s(self), self.timeouts.standstill_s, self.limits
        figures = (
            f"an ordinary stop takes up to {ramp_s:.2f} s (limits: linear_mps {limits.linear_mps:g}, deceleration_mps2 "
            f"{limits.deceleration_mps2:g}, angular_radps {limits.angular_radps:g}, angular_deceleration_radps2 "
            f"{limits.angular_deceleration_radps2:g}, jerk_mps3 {limits.jerk_mps3:g}; lag {stopping.lag_s(self):.2f} s)"
        )
        if given_s is not None and given_s < ramp_s:
            message = f"standstill_s ({given_s:g}) is shorter than the ramp: {figures}; leave standstill_s out"
            raise MisfitError(message, ("timeouts", "standstill_s"))
        if given_s is None and stopping.standstill_s(self) > LONGEST_STOP_S:
            message = f"{figures}: more than can be supervised; raise jerk_mps3 or deceleration_mps2"
            raise MisfitError(message, ("limits", "jerk_mps3"), ("limits", "deceleration_mps2"))
        return self

    @model_validator(mode="after")
    def _objects_hold_its_speeds(self) -> Robot:
        """Beyond its greatest number 60FFh would order less than was meant, and 606Ch would wrap."""
        fastest_mps = stopping.max_wheel_mps(self)
        too_fast_mps = self.watchdog.overspeed_factor * fastest_mps
        for i, drive in enumerate(self.drives):
            layout, vl = drive.kind.layout, drive.kind.is_vl
            bit_mps = abs(units.mps_per_bit(drive, self.base.radius_m(drive.side)))
            actual_mps = bit_mps * units.velocity_scale(drive)
            for name, bits, unit, one_mps, needed_mps in (
                ("6042h" if vl else "60FFh", layout.target_bits, drive.target_unit, bit_mps, fastest_mps),
                ("6044h" if vl else "606Ch", layout.velocity_bits, drive.actual_unit, actual_mps, too_fast_mps),
            ):
                most_mps = ((1 << bits - 1) - 1) * one_mps
                if needed_mps > most_mps:
                    message = (
                        f"{name} of {drive.joint} has {bits} bits of {unit}: up to {most_mps:.3g} m/s at its wheel. "
                        f"{needed_mps:.3g} m/s are needed for limits.linear_mps, limits.angular_radps and "
                        "watchdog.overspeed_factor: lower the limits, or set a coarser unit in the drive and here"
                    )
                    raise MisfitError(message, ("limits", "linear_mps"), ("drives", i, "velocity_unit"), ("drives", i))
        return self

    @model_validator(mode="after")
    def _bus_carries_its_frames(self) -> Robot:
        why = bus_load.full(self)
        if why:
            raise MisfitError(why, ("bus", "bitrate"), ("rates", "control_hz"), ("bus",))
        return self

    def _check_nodes(self) -> None:
        first: dict[int, Drive] = {}
        for i, drive in enumerate(self.drives):
            before = first.setdefault(drive.node_id, drive)
            if before.profile != drive.profile or before.used_mode != drive.used_mode:
                message = f"both motors of node {drive.node_id} need the same profile and mode"
                raise MisfitError(message, ("drives", i, "profile"), ("drives", i, "node_id"))
            axes, pdo = sum(other.node_id == drive.node_id for other in self.drives), drive.kind.pdo
            tpdos = drive.kind.layout.tpdos(axes)
            if pdo.rpdos < axes + 1 or pdo.tpdos < tpdos:
                message = f"{axes} motor(s) need {axes + 1} RPDOs and {tpdos} TPDOs; {drive.kind.title} has fewer"
                raise MisfitError(message, ("drives", i, "profile"), ("drives", i, "node_id"))
            if why := drive_values.misfit(drive.values, self.rates.control_hz, axes, pdo.tpdos):
                raise MisfitError(f"values of {drive.joint}: {why}", ("drives", i, "values"))
            if self.bus.sync_counter is not None and drive.kind.options.sync_counter == "no":
                message = f"{drive.kind.title} knows no counter in SYNC (1019h)"
                raise MisfitError(message, ("bus", "sync_counter"))
            if drive.used_mode == CYCLIC and not (1000.0 / self.rates.control_hz).is_integer():
                message = f"mode 9 needs a cycle of whole milliseconds, {self.rates.control_hz:g} Hz is none"
                raise MisfitError(message, ("rates", "control_hz"), ("drives", i, "mode"))
