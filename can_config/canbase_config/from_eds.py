"""Drafts a drive profile from an EDS: its values, what no EDS contains, and whether the drive stops by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from canbase_config.eds_file import Eds, number
from canbase_config.errors import printable
from canbase_config.object_map import AXIS_OFFSET, PROFILE_402

NEEDED: Final = (0x6040, 0x6041, 0x6060, 0x6064, 0x606C, 0x60FF, 0x1400, 0x1600, 0x1800, 0x1A00)
"""What canbase cannot do without."""
NEEDED_OF_VL: Final = (*(index for index in NEEDED if index not in (0x606C, 0x60FF)), 0x6042, 0x6044)
"""The same of an inverter, in mode 2."""
NOT_IN_A_PDO: Final = (0x6060, 0x1400, 0x1600, 0x1800, 0x1A00)
"""Of these, what no PDO carries."""
MAPPINGS: Final = (0x1600, 0x1601, 0x1602, 0x1603, 0x1A00, 0x1A01, 0x1A02, 0x1A03)
MOST_AXES: Final = 2
SI_RPM: Final = 0x00B4_4700
"""60A9h: revolutions per minute."""
INTEGER16, UNSIGNED32 = 0x03, 0x07
_MODE_BITS: Final = {3: 2, 9: 8}
"""Bit of 6502h for each mode that takes 60FFh (CiA 402-2)."""
UNKNOWN_TO_ANY_EDS: Final = (
    "what one bit of 60FFh, 606Ch and 6083h–6085h means: put velocity_unit into robot.yaml, and prove it",
    "whether it works with SYNC (transmission type 1)",
    "what it needs after a lost heartbeat, and how long it takes to start",
    "its own emergency codes and its own watchdog",
)


@dataclass(frozen=True, slots=True)
class Draft:
    """A profile, and remarks on it. `missing`: objects without which canbase cannot use the drive."""

    text: str
    """The profile as YAML."""
    missing: tuple[str, ...]
    self_stop: str
    """Whether the drive stops by itself when the computer dies, in a sentence."""
    unknown: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    """What the EDS has otherwise than canbase needs it, a sentence each: an EDS may be wrong, so it is drafted."""


class _Lines:
    """YAML with a comment behind each value, and the list of those that no source proves."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.unproven: list[str] = []
        self._section = ""

    def section(self, name: str) -> None:
        self._section = f"{name}."
        self.lines.append(f"{name}:")

    def top(self) -> None:
        self._section = ""

    def put(self, key: str, value: object, source: str, proven: bool = True) -> None:
        shown = "null" if value is None else str(value).lower() if isinstance(value, bool) else value
        text = f"{'  ' if self._section else ''}{key}: {shown}"
        if not proven:
            self.unproven.append(self._section + key)
        self.lines.append(f"{text:<38}# {source if proven else f'unproven: {source}'}")


def why_no_drive(eds: Eds) -> str:
    """Why the EDS is not that of a CiA 402 drive, in a sentence; empty: it is, or claims to be."""
    device_type = eds.default(0x1000)
    profile = None if device_type is None else device_type & 0xFFFF
    if eds.has(0x6040) or eds.has(0x6041) or profile == PROFILE_402:
        return ""
    shown = "has no value" if profile is None else f"has the device profile {profile}, not {PROFILE_402}"
    return f"this is no CiA 402 drive: it has neither 6040h nor 6041h, and 1000h {shown}"


def draft(eds: Eds) -> Draft:
    """The profile that follows from the EDS, as a draft: units and everything that only a manual gives stay open."""
    out = _Lines()
    missing = tuple(f"{index:04X}h" for index in (NEEDED_OF_VL if _is_vl(eds) else NEEDED) if not eds.has(index))
    _identity(eds, out)
    _layout(eds, out)
    _units(eds, out)
    _modes(eds, out)
    _pdos(eds, out)
    _self_stop(eds, out)
    _options(eds, out)
    if eds.has(0x6079):
        out.section("measures")
        out.lines.append("  voltage: {index: 0x6079, bits: 32, scale: 0.001}   # has 6079h; CiA 402-2: mV")
    doubts = tuple(_doubts(eds))
    head = f"# Drafted from {eds.path.name} by `canbase config from-eds`: not proven. See docs/drive_types.md.\n"
    head += "".join(f"# {doubt}.\n" for doubt in doubts) + "\n"
    tail = ["unproven:", *(f"  - {path}" for path in out.unproven)]
    return Draft(
        head + "\n".join(out.lines + tail) + "\n", missing, self_stop_sentence(eds), UNKNOWN_TO_ANY_EDS, doubts
    )


def _doubts(eds: Eds) -> Iterator[str]:
    targets = [index for index in range(0x60FF, 0xA000, AXIS_OFFSET) if eds.has(index)]
    motors = max(len(targets), sum(index == 0x60FF and sub > 0 for index, sub in eds.objects))
    if motors > MOST_AXES:
        yield f"it has {motors} axes, and the first {MOST_AXES} of a node can be used: the draft has these"
    fixed = [f"{index:04X}h" for index in MAPPINGS if _is_fixed(eds, index)]
    if fixed:
        yield (
            f"{', '.join(fixed)} cannot be written (AccessType): a drive whose PDOs do not carry what docs/bus.md has, "
            "as delivered or by the manufacturer's tool, cannot be used"
        )
    needed = NEEDED_OF_VL if _is_vl(eds) else NEEDED
    unmapped = [f"{index:04X}h" for index in needed if index not in NOT_IN_A_PDO and _is_unmappable(eds, index)]
    if unmapped:
        yield f"{', '.join(unmapped)} cannot be in a PDO (PDOMapping=0): if that is right, the drive cannot be used"
    if not eds.has(0x1017):
        guarding = "it has" if _can_be_guarded(eds) else "by this file it does not have"
        yield (
            "it has no 1017h and sends no heartbeat: canbase needs one, or node guarding with 6007h, which "
            f"{guarding} (self_stop.node_guarding)"
        )


def _is_fixed(eds: Eds, index: int) -> bool:
    described = [found for (at, _), found in eds.objects.items() if at == index]
    return bool(described) and not any(found.is_writable for found in described)


def _is_unmappable(eds: Eds, index: int) -> bool:
    described = [found for (at, sub), found in eds.objects.items() if at == index and (sub or not eds.has(index, 1))]
    return bool(described) and all(found.is_mappable is False for found in described)


def _is_vl(eds: Eds) -> bool:
    """It has the target of mode 2, and not that of modes 3 and 9."""
    return eds.has(0x6042) and not eds.has(0x60FF)


def self_stop_sentence(eds: Eds) -> str:
    """Whether the drive can stop by itself when the computer fails, as far as an EDS shows it."""
    if eds.has(0x1016) and eds.has(0x6007):
        how = "it watches heartbeats (1016h) and has 6007h for what to do then"
        return f"It can stop by itself when the computer dies: {how}. Prove it with the wheels up."
    if _can_be_guarded(eds):
        how = "it knows node guarding (100Ch, 100Dh), which its master must do, and has 6007h for what to do then"
        return f"It can stop by itself when the computer dies: {how}. Prove it with the wheels up."
    if eds.has(0x1400, 5):
        how = "it has a deadline for setpoints (1400h:5), but the EDS does not show what it does when that expires"
        return f"It may stop by itself when the computer dies: {how}. Prove it with the wheels up."
    if eds.has(0x1016):
        how = "it monitors heartbeats (1016h), but has no 6007h: whether the motor stops is unknown"
        return f"Do not count on it to stop by itself when the computer dies: {how}. Prove it with the wheels up."
    how = "it watches no heartbeat (no 1016h), no setpoints (no 1400h:5), and no guard (no 100Ch, or no 6007h)"
    return f"It will NOT stop by itself when the computer dies: {how}. Look for its manufacturer's watchdog; wire STO."


def _identity(eds: Eds, out: _Lines) -> None:
    title = " ".join(eds.info.get(key, "") for key in ("vendorname", "productname")).strip() or eds.path.stem
    out.lines.append(f"title: {_quoted(title)}")
    found = {}
    for key, sub, name in (("vendor_id", 1, "vendornumber"), ("product_code", 2, "productnumber")):
        value = eds.default(0x1018, sub) or number(eds.info.get(name, ""))
        if value is not None and 0 < value < 0xFFFF_FFFF:
            found[key] = value
    if found:
        out.section("identity")
        for key, value in found.items():
            out.put(key, f"0x{value:X}", "1018h or [DeviceInfo]")


def _layout(eds: Eds, out: _Lines) -> None:
    out.section("layout")
    if _is_vl(eds):
        axes = 2 if eds.has(0x6842) else 1
        out.put("axes", axes, "has 6842h" if axes == 2 else "no 6842h")
        out.put("target_bits", 16, "6042h of mode 2")
        out.put("velocity_bits", 16, "6044h of mode 2")
        return
    by_sub = eds.has(0x60FF, 2)
    axes = 2 if eds.has(0x68FF) or by_sub else 1
    out.put("axes", axes, "has 68FFh" if eds.has(0x68FF) else "has 60FFh:2" if by_sub else "no 68FFh")
    if axes == 2:
        out.put("second_axis", "sub_index" if by_sub else "offset", "as above")
    if by_sub:
        out.put("controlword", "own" if eds.has(0x6040, 2) else "shared", "6040h:2")
        status = eds.objects.get((0x6041, 0))
        is_packed = status is not None and status.data_type == UNSIGNED32
        out.put("statusword", "packed" if is_packed else "own", "data type of 6041h")
    for key, index in (("target_bits", 0x60FF), ("velocity_bits", 0x606C)):
        described = eds.objects.get((index, 1 if by_sub else 0))
        is_narrow = described is not None and described.data_type == INTEGER16
        out.put(key, 16 if is_narrow else 32, f"data type of {index:04X}h")


def _units(eds: Eds, out: _Lines) -> None:
    out.section("units")
    if _is_vl(eds):
        for key in ("target_velocity", "actual_velocity"):
            out.put(key, "rpm", "604Ch = 1/1", proven=False)
        return
    is_rpm = eds.default(0x60A9) == SI_RPM
    unit, source = ("rpm", "60A9h = 00B44700h") if is_rpm else (None, "not in an EDS; see the manual")
    out.put("target_velocity", unit, source, proven=is_rpm)
    out.put("actual_velocity", unit, source, proven=is_rpm)
    out.put("acceleration", "velocity/s", "not in an EDS; see the manual", proven=False)


def _modes(eds: Eds, out: _Lines) -> None:
    out.top()
    if _is_vl(eds):
        out.put("modes", "[2]", "has 6042h, and no 60FFh")
        return
    supported = eds.default(0x6502)
    if not supported:
        out.put("modes", "[3]", "6502h has no default", proven=False)
        return
    modes = [mode for mode, bit in _MODE_BITS.items() if supported >> bit & 1] or [3]
    out.put("modes", f"[{', '.join(map(str, modes))}]", f"6502h = {supported:X}h")


def _pdos(eds: Eds, out: _Lines) -> None:
    out.section("pdo")
    for key, communication in (("rpdos", 0x1400), ("tpdos", 0x1800)):
        count = sum(eds.has(communication + i) and eds.has(communication + 0x200 + i) for i in range(512))
        out.put(key, max(1, count), f"{communication:04X}h…", proven=count > 0)
    kind = eds.default(0x1800, 2)
    is_synchronous = eds.has(0x1005) or (kind is not None and 0 < kind <= 240)
    out.put("synchronous", is_synchronous, "1005h, 1800h:2", proven=False)


def _self_stop(eds: Eds, out: _Lines) -> None:
    out.section("self_stop")
    subs = sum(index == 0x1016 and sub > 0 for index, sub in eds.objects)
    entries = eds.default(0x1016) if eds.has(0x1016) else 0
    out.put("heartbeat_entries", subs if entries is None else entries, "1016h")
    for key, index in (("abort_connection", 0x6007), ("error_behaviour", 0x1029)):
        out.put(key, *_presence(eds, index))
    if not eds.has(0x1016):
        out.put("node_guarding", _can_be_guarded(eds), "100Ch, 100Dh, 6007h")
    has_timer = eds.has(0x1400, 5)
    out.put("rpdo_timer", "yes" if has_timer else "no", "1400h:5", proven=not has_timer)


def _can_be_guarded(eds: Eds) -> bool:
    """It monitors node guarding and no heartbeat, and has 6007h, which can make it stop then."""
    return not eds.has(0x1016) and all(eds.has(index) for index in (0x100C, 0x100D, 0x6007))


def _options(eds: Eds, out: _Lines) -> None:
    out.section("options")
    objects = {
        "quick_stop": 0x605A,
        "fault_reaction": 0x605E,
        "mode_display": 0x6061,
        "ramps": 0x6048 if _is_vl(eds) else 0x6083,
        "interpolation": 0x60C2,
        "sync_counter": 0x1019,
        "store": 0x1010,
    }
    for key, index in objects.items():
        out.put(key, *_presence(eds, index))
    torque = next((name for name, index in (("6077h", 0x6077), ("6078h", 0x6078)) if eds.has(index)), "none")
    out.put("torque", torque, "no 6077h, 6078h" if torque == "none" else f"has {torque}", proven=torque == "none")


def _presence(eds: Eds, index: int) -> tuple[str, str]:
    return ("yes", f"has {index:04X}h") if eds.has(index) else ("no", f"no {index:04X}h")


def _quoted(text: str) -> str:
    escaped = printable(text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
