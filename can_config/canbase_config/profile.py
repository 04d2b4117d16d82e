"""The model of a drive profile: what is known about one kind of motor drive. Reading the files is `profile_file.py`.

Everything in here is about CiA 301 and CiA 402-2 objects; what a drive does beyond its profile the boot finds out.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from canbase_config.section import MisfitError, Section

VelocityUnit = Literal[
    "rpm",
    "0.1rpm",
    "0.001rpm",
    "rev/s",
    "0.001rev/s",
    "counts/s",
    "0.1counts/s",
    "counts/ms/16384",
    "counts/ms/65536",
]
"""What one bit of 60FFh or 606Ch means, always at the motor shaft (before the gear)."""
AccelerationUnit = Literal[
    "velocity/s", "rpm/s", "0.1rpm/s", "10counts/s2", "counts/ms2/16384", "counts/ms2/65536", "ms"
]
"""One bit of 6083h–6085h. `velocity/s`: the unit of 60FFh per second; `ms`: time from stand to `full_speed_rpm`."""
VL_MODE = 2
"""6060h: velocity mode (vl) of inverters, by 6042h (CiA 402-2)."""
Presence = Literal["yes", "no", "probe"]
"""Whether the drive has an object; `probe`: unknown, the boot tries."""

TorqueObject = Literal["6077h", "6078h", "none", "probe"]
"""The object that reports the torque, in thousandths of the rated torque (CiA 402-2: 6077h, or the current 6078h);
`probe`: unknown, the boot tries 6077h."""

Index = Annotated[int, Field(ge=0x1000, le=0xFFFF, description="object index")]
Sub = Annotated[int, Field(ge=0, le=0xFF, description="sub-index")]
Bits = Annotated[Literal[8, 16, 32], Field(description="width")]


class Layout(Section):
    """Where the objects of an axis are, and how wide. All velocities and positions are signed on the bus."""

    axes: Annotated[int, Field(ge=1, le=2, description="motors that one node can turn")] = 2
    second_axis: Annotated[
        Literal["offset", "sub_index"],
        Field(description="offset: all its objects at + 800h; sub_index: sub 1 and 2 of the same velocities and ramps"),
    ] = "offset"
    controlword: Annotated[
        Literal["own", "shared"], Field(description="shared: one 6040h switches both motors (sub_index only)")
    ] = "own"
    statusword: Annotated[
        Literal["own", "packed"], Field(description="packed: 6041h has 32 bits, the second axis in the upper half")
    ] = "own"
    target_bits: Annotated[Literal[16, 32], Field(description="width of 60FFh; 16 for 6042h of mode 2")] = 32
    velocity_bits: Annotated[Literal[16, 32], Field(description="width of 606Ch; 16 for 6044h of mode 2")] = 32

    @property
    def fits_one_tpdo(self) -> bool:
        """6041h, 6064h and the velocity have eight bytes together: one TPDO can carry all that canbase needs."""
        return self.statusword == "own" and self.velocity_bits == 16

    def tpdos(self, axes: int) -> int:
        """How many TPDOs so many motors of one node need."""
        return axes if self.fits_one_tpdo else 2 * axes

    @model_validator(mode="after")
    def _shared_needs_sub_index(self) -> Layout:
        if self.second_axis == "offset" and (self.controlword, self.statusword) != ("own", "own"):
            raise MisfitError("axes at + 800h have a controlword and a statusword of their own", ("second_axis",))
        return self


class Units(Section):
    """What one bit means, at the motor shaft. None: the drive's settings decide, and robot.yaml names it."""

    target_velocity: Annotated[VelocityUnit, Field(description="60FFh")] | None = "rpm"
    actual_velocity: Annotated[VelocityUnit, Field(description="606Ch")] | None = "rpm"
    acceleration: Annotated[AccelerationUnit, Field(description="6083h, 6084h, 6085h; of mode 2: velocity/s")] = (
        "velocity/s"
    )
    full_speed_rpm: Annotated[float, Field(gt=0.0, description="of the unit ms [rpm]")] | None = None

    @model_validator(mode="after")
    def _times_need_a_speed(self) -> Units:
        if (self.acceleration == "ms") != (self.full_speed_rpm is not None):
            raise MisfitError("full_speed_rpm goes with acceleration: ms, and only with it", ("full_speed_rpm",))
        return self


class Pdos(Section):
    """What the process data objects can do."""

    rpdos: Annotated[int, Field(ge=1, le=512, description="RPDOs that can be mapped")] = 4
    tpdos: Annotated[int, Field(ge=1, le=512, description="TPDOs that can be mapped")] = 4
    fixed_cob_id_bits: Annotated[
        int, Field(ge=0, le=0x7FFF_FFFF, description="bits of 1400h:1 and 1800h:1 that keep their value")
    ] = 0x4000_0000
    synchronous: Annotated[
        bool,
        Field(
            description="true: transmission type 1, or without SYNC where the drive refuses it; false: RPDOs act at "
            "once, TPDOs go by their event timer"
        ),
    ] = True


class Sdo(Section):
    """How the SDO server of the drive accepts requests."""

    timeout_s: (
        Annotated[float, Field(ge=0.05, le=5.0, description="one answer; default: timeouts.sdo_s [s]")] | None
    ) = None
    attempts: Annotated[int, Field(ge=1, le=10, description="number of requests before failure")] = 3
    gap_s: Annotated[float, Field(ge=0.0, le=0.1, description="least time between two requests [s]")] = 0.0


class Start(Section):
    """How the drive comes up."""

    reset: Annotated[
        Literal["communication", "node", "none"], Field(description="NMT command that forgets earlier masters")
    ] = "communication"
    boot_up_s: Annotated[float, Field(ge=0.1, le=60.0, description="until the boot-up message after it [s]")] = 5.0
    settle_s: Annotated[
        float, Field(ge=0.0, le=10.0, description="wait after a boot-up, in which a second one may come [s]")
    ] = 0.0


class VendorWatchdog(Section):
    """The manufacturer's own time limit for commands. Without an object only the manufacturer's tool can set it."""

    index: Index | None = None
    sub: Sub = 0
    bits: Bits = 16
    per_s: Annotated[float, Field(gt=0.0, description="value for one second")] = 1000.0
    text: Annotated[str, Field(min_length=1, description="what the drive monitors, and its reaction")]


class SelfStop(Section):
    """What makes the drive stop by itself when its masters die."""

    heartbeat_entries: Annotated[int, Field(ge=0, le=127, description="entries of 1016h; 0: none")] | None = None
    abort_connection: Annotated[Presence, Field(description="6007h")] = "probe"
    abort_connection_code: Annotated[int, Field(ge=-32768, le=32767, description="value of 6007h that stops")] = 3
    error_behaviour: Annotated[Presence, Field(description="1029h:1")] = "probe"
    rpdo_timer: Annotated[Presence, Field(description="1400h:5, deadline of the setpoints")] = "no"
    node_guarding: Annotated[
        bool,
        Field(
            description="true: the watchdog guards the node (100Ch, 100Dh, remote frames), which then sends no "
            "heartbeat; for a drive without 1016h"
        ),
    ] = False
    vendor_watchdog: VendorWatchdog | None = None

    @model_validator(mode="after")
    def _guarding_excludes_heartbeats(self) -> SelfStop:
        if self.node_guarding and self.heartbeat_entries != 0:
            message = "node guarding excludes heartbeats (CiA 301): it needs heartbeat_entries: 0"
            raise MisfitError(message, ("node_guarding",), ("heartbeat_entries",))
        return self


class Options(Section):
    """Optional objects of CiA 402."""

    quick_stop: Annotated[Presence, Field(description="605Ah")] = "probe"
    quick_stop_code: Annotated[int, Field(ge=1, le=8, description="value of 605Ah: down the ramp 6085h")] = 2
    fault_reaction: Annotated[Presence, Field(description="605Eh")] = "probe"
    fault_reaction_code: Annotated[int, Field(ge=0, le=4, description="value of 605Eh")] = 2
    mode_display: Annotated[
        Literal["yes", "no", "when_enabled", "probe"], Field(description="6061h; when_enabled: it is 0 without power")
    ] = "probe"
    ramps: Annotated[Presence, Field(description="6083h, 6084h, 6085h")] = "probe"
    interpolation: Annotated[Presence, Field(description="60C2h, for mode 9")] = "probe"
    torque: Annotated[
        TorqueObject, Field(description="torque or current actual value that a PDO can take, in 0.1 % of the rated one")
    ] = "probe"
    sync_counter: Annotated[Presence, Field(description="1019h")] = "probe"
    sdo_channels: Annotated[Presence, Field(description="1201h to 127Fh, which the boot closes")] = "probe"
    store: Annotated[Presence, Field(description="1010h")] = "probe"


class SdoWrite(Section):
    """One write of the boot, read back unless the object is write-only."""

    index: Index
    sub: Sub = 0
    value: Annotated[int, Field(ge=-(2**31), le=2**32 - 1, description="value")]
    bits: Bits
    optional: Annotated[bool, Field(description="true: a refusal is only a note")] = False


SDO_SERVERS = range(0x1200, 0x1280)
"""By which identifiers a drive takes SDO requests: the default channel first (CiA 301)."""
STOPPED_BY: dict[int, str] = {
    0x100C: "self_stop.node_guarding",
    0x100D: "self_stop.node_guarding",
    0x1016: "self_stop.heartbeat_entries",
    0x1029: "self_stop.error_behaviour",
    0x6007: "self_stop.abort_connection_code",
    0x605A: "options.quick_stop_code",
    0x605E: "options.fault_reaction_code",
}
"""Objects by which the boot makes a drive stop, and the keys for them; those of the second axis are at + 800h."""


class Writes(Section):
    """What the boot writes besides the standard objects, in order."""

    before_mapping: Annotated[
        tuple[SdoWrite, ...], Field(strict=False, description="after the reset, before everything else")
    ] = ()
    after_mapping: Annotated[tuple[SdoWrite, ...], Field(strict=False, description="at the end of the boot")] = ()


class Measured(Section):
    """An object that is read now and then: raw × scale is in V, A or °C."""

    index: Index
    sub: Sub = 0
    bits: Bits
    signed: Annotated[bool, Field(description="true: two's complement")] = False
    scale: Annotated[float, Field(gt=0.0, description="V, A or °C for one bit")]
    second_axis: Annotated[
        Literal["same", "offset", "next_sub"], Field(description="where it is for the second motor")
    ] = "same"


class Measures(Section):
    """What the drive measures besides its motion."""

    voltage: Measured | None = None
    current: Measured | None = None
    temperature: Measured | None = None


class Kind(Section):
    """The content of 1018h for this kind of drive, to suggest the profile."""

    vendor_id: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:1")] | None = None
    product_code: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:2")] | None = None


class Profile(Section):
    """One kind of motor drive."""

    title: Annotated[str, Field(min_length=1, description="manufacturer and type")]
    identity: Kind = Kind()
    layout: Layout = Layout()
    units: Units = Units()
    modes: Annotated[
        tuple[Annotated[int, Field(ge=-128, le=127)], ...],
        Field(
            min_length=1,
            strict=False,
            description="values of 6060h that take 60FFh, the preferred one first; or 2 alone: 6042h and 6044h",
        ),
    ] = (3, 9)
    pdo: Pdos = Pdos()
    sdo: Sdo = Sdo()
    start: Start = Start()
    self_stop: SelfStop = SelfStop()
    options: Options = Options()
    writes: Writes = Writes()
    heartbeat_fault: Annotated[
        Literal["fault_reset", "reset_communication"],
        Field(description="what clears a fault for a lost heartbeat or bus"),
    ] = "fault_reset"
    measures: Measures = Measures()
    emcy: Annotated[
        dict[Annotated[int, Field(ge=0, le=0xFFFF)], Annotated[str, Field(min_length=1)]],
        Field(description="the manufacturer's emergency codes in words"),
    ] = Field(default_factory=dict)
    notes: Annotated[tuple[str, ...], Field(strict=False, description="notes for the first motion")] = ()
    unproven: Annotated[tuple[str, ...], Field(strict=False, description="keys above without a source; test them")] = ()

    @property
    def is_vl(self) -> bool:
        """Its velocities are 6042h and 6044h, its ramps 6048h, 6049h and 604Ah, in place of those of modes 3 and 9."""
        return VL_MODE in self.modes

    @model_validator(mode="after")
    def _vl_has_objects_of_its_own(self) -> Profile:
        layout = self.layout
        if not self.is_vl:
            return self
        if len(self.modes) > 1:
            raise MisfitError("mode 2 has objects and units of its own: it is the only one of a profile", ("modes",))
        for key, bits in (("target_bits", layout.target_bits), ("velocity_bits", layout.velocity_bits)):
            if bits != 16:
                raise MisfitError(
                    "6042h and 6044h of mode 2 have 16 bits (CiA 402-2): set 16", ("layout", key), ("modes",)
                )
        if layout.second_axis != "offset" and layout.axes > 1:
            raise MisfitError("in mode 2 the second axis is at + 800h", ("layout", "second_axis"), ("modes",))
        if self.units.acceleration != "velocity/s":
            message = "ramps of mode 2 are in the unit of 6042h per second: set velocity/s"
            raise MisfitError(message, ("units", "acceleration"), ("modes",))
        return self

    @model_validator(mode="after")
    def _nothing_undoes_its_stop(self) -> Profile:
        """The last writes come after the boot has read back what makes the drive stop by itself."""
        own = self.self_stop.vendor_watchdog
        for position, write in enumerate(self.writes.after_mapping):
            first_axis = write.index - 0x800 if 0x6800 <= write.index < 0x7000 else write.index
            key = STOPPED_BY.get(first_axis, "")
            if own is not None and write.index == own.index:
                key = "self_stop.vendor_watchdog"
            if key:
                message = f"{write.index:04X}h decides how the drive stops: set {key} instead"
                raise MisfitError(message, ("writes", "after_mapping", position, "index"))
        return self

    @model_validator(mode="after")
    def _opens_no_sdo_channel(self) -> Profile:
        """What comes by another one than the default channel is seen by nobody."""
        for name, writes in (
            ("before_mapping", self.writes.before_mapping),
            ("after_mapping", self.writes.after_mapping),
        ):
            for position, write in enumerate(writes):
                if write.index in SDO_SERVERS:
                    message = (
                        f"{write.index:04X}h is an SDO channel: take this entry out; the boot closes all but the "
                        "default one"
                    )
                    raise MisfitError(message, ("writes", name, position, "index"))
        return self

    @model_validator(mode="after")
    def _unproven_keys_exist(self) -> Profile:
        for position, path in enumerate(self.unproven):
            section: object = self
            for key in path.split("."):
                if key not in type(section).model_fields if isinstance(section, Section) else True:
                    raise MisfitError(f"{path} is no key of a profile", ("unproven", position))
                section = getattr(section, key)
        return self

    def is_unproven(self, path: str) -> bool:
        """Whether this key, or one inside it, or the section around it, has no source."""
        keys = path.split(".")
        listed = (entry.split(".") for entry in self.unproven)
        return any(entry[: len(keys)] == keys or keys[: len(entry)] == entry for entry in listed)
