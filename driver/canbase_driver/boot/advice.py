"""What a person does about an object that a drive lacks or refuses: the key, the tool, and what it means for the stop.

Words alone: which steps lead to them is in `steps.py`, `settings.py` and `pdo_mapping.py`. All of it: docs/refusals.md.
"""

from __future__ import annotations

from canbase_config.profile import SDO_SERVERS
from canbase_driver.cia301.sdo_client import (
    DEVICE_STATE,
    GENERAL_ERROR,
    LENGTH_WRONG,
    NO_OBJECT,
    NO_SUB_INDEX,
    TOO_LONG,
    TOO_SHORT,
    SdoAborted,
    SdoError,
    SdoTimeout,
    Write,
)

PROFILE_KEYS: tuple[tuple[range, str], ...] = (
    (range(0x100C, 0x100E), "self_stop.node_guarding"),
    (range(0x1016, 0x1017), "self_stop.heartbeat_entries"),
    (range(0x1017, 0x1018), "timeouts.drive_heartbeat_s of robot.yaml: a third of it is the period"),
    (range(0x1019, 0x101A), "options.sync_counter"),
    (range(0x1029, 0x102A), "self_stop.error_behaviour"),
    (SDO_SERVERS[1:], "options.sdo_channels"),
    (range(0x1600, 0x1800), "layout"),
    (range(0x1A00, 0x1C00), "layout"),
    (range(0x6007, 0x6008), "self_stop.abort_connection"),
    (range(0x6042, 0x6045), "modes"),
    (range(0x6046, 0x6047), "modes"),
    (range(0x6048, 0x604B), "options.ramps"),
    (range(0x604C, 0x604D), "units.target_velocity"),
    (range(0x605A, 0x605B), "options.quick_stop"),
    (range(0x605E, 0x605F), "options.fault_reaction"),
    (range(0x6060, 0x6061), "modes"),
    (range(0x6061, 0x6062), "options.mode_display"),
    (range(0x606C, 0x606D), "layout.velocity_bits"),
    (range(0x6077, 0x6079), "options.torque"),
    (range(0x6083, 0x6086), "options.ramps"),
    (range(0x60C2, 0x60C3), "options.interpolation"),
    (range(0x60FF, 0x6100), "layout.target_bits"),
)
"""Object → the key of a drive profile (docs/configuration.md) for whether, where or how wide the drive has it."""
LACKS = {
    "self_stop.heartbeat_entries": "0",
    "self_stop.node_guarding": "false",
    "options.torque": "none",
    "options.ramps": "",  # it is about three objects, and a drive has the others
}
"""Key → its value for a drive without the object; no elsewhere."""
TRANSMISSION_TYPE = 2
"""Sub-index of 1400h… and 1800h…."""
GUARDING_ALONE = (
    "where it has node guarding alone, set `self_stop.node_guarding: true` and `self_stop.heartbeat_entries: 0` in its "
    "drive profile"
)
OTHER_STATE = (
    "The state of the drive forbids it, and the boot is tried again each second. If this goes on, switch the drive off "
    "and on again, and let no other master control it"
)
NOT_AN_AXIS = (
    "Every axis of a CiA 402 drive has it: check `axis` in robot.yaml, and with the manufacturer's tool that the drive "
    "is set to CiA 402 and takes its commands from the bus"
)
UNANSWERED = (
    "It answered before, so its node id and the bit rate are right, and the boot is tried again each second. If this "
    "goes on, check its supply and its cable, and let no other program use its SDO channel (canbase bus "
    "sdo, the manufacturer's "
    "tool)"
)
ELSE_UNUSABLE = "where that cannot be done, the drive cannot be used"
WITHOUT = {
    (0x1016, 1): "it does not stop by the watchdog's heartbeat",
    (0x6007, 0): "no lost heartbeat or node guarding stops the motor",
    (0x605E, 0): "a fault may take the power away and let the wheel coast",
}
"""What it means for the stop that the drive does not take its value, by the object of the first axis."""
BESIDES = {
    (0x1029, 1): "after a lost heartbeat it may stay operational and take setpoints",
    (0x605A, 0): "a quick stop may not brake by 6085h, or may leave the motor with power",
    (0x6083, 0): "it may accelerate more slowly than ordered",
}
"""The same of what the proofs and measurements of the stop do not depend on: it can stay so."""
UNREAD = {
    0x1000: "; so nothing shows that it is a motor drive; it is used as one",
    0x1018: "; so another drive with this node id may not be noticed",
}
"""What it means that an object cannot be read, where no key spares the boot the question."""
FOR_SELF_STOP = (0x1016, 0x6007)
WIDTHS = (LENGTH_WRONG, TOO_LONG, TOO_SHORT)


def profile_key(index: int, sub: int = 0) -> str:
    """The key of a drive profile that an object belongs to; empty: none. The second axis is at + 800h."""
    if (0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00) and sub == TRANSMISSION_TYPE:
        return "pdo.synchronous"
    first_axis = _first_axis(index)
    return next((key for objects, key in PROFILE_KEYS if first_axis in objects), "")


def _first_axis(index: int) -> int:
    return index - 0x800 if 0x6800 <= index < 0x7000 else index


OF_AN_AXIS = frozenset((0x6040, 0x6041, 0x6060, 0x6064, 0x606C, 0x60FF))
"""What every axis of a CiA 402 drive has, by the index of the first one."""


def may_pass(error: SdoError) -> bool:
    """Whether a drive that still starts fails so too, and no longer when it has started: it answers nothing, its state
    forbids it, or it does not have its axes yet."""
    if isinstance(error, SdoTimeout):
        return True
    code = error.code if isinstance(error, SdoAborted) else 0
    without_axis = code in (NO_OBJECT, NO_SUB_INDEX, GENERAL_ERROR) and _first_axis(error.index) in OF_AN_AXIS
    return code == DEVICE_STATE or without_axis


def hint(error: SdoError) -> str:
    """What to try about a transfer that failed after all its tries."""
    if isinstance(error, SdoTimeout):
        return f"{UNANSWERED}{_spared(error.index, error.sub)}"
    code = error.code if isinstance(error, SdoAborted) else 0
    key, index = profile_key(error.index, error.sub), _first_axis(error.index)
    if code == DEVICE_STATE:
        return OTHER_STATE
    if index == 0x6060 and code not in (NO_OBJECT, NO_SUB_INDEX, *WIDTHS):
        return (
            "Set `mode` in robot.yaml to one that the drive has: in 6502h (canbase bus sdo read "
            f"{error.node_id} 6502), bit 2 is mode 3, bit 8 is mode 9; "
            "bit 1 is mode 2, with `modes: [2]` in its drive profile; with none of them the drive cannot be used"
        )
    if code in (NO_OBJECT, NO_SUB_INDEX, GENERAL_ERROR) and index in OF_AN_AXIS:
        return NOT_AN_AXIS
    if code in WIDTHS:
        width = f"set `{key}` in its drive profile to that of its manual, 16 or 32"
        where = width if key.startswith("layout.") else "such a drive cannot be used"
        return f"The drive has this object in another width than CiA 402 and its profile: {where}"
    if index == 0x60FF:
        return (
            "canbase sets it to 0 before there is power: let the drive take its commands from the bus, with the "
            f"manufacturer's tool; {ELSE_UNUSABLE}"
        )
    needed = "canbase needs this object: look it up in the manual of the drive"
    return needed + (f", and see `{key}` of its drive profile" if key else "")


def see(index: int, sub: int) -> str:
    """The key that spares the boot the question, where the drive has no such object at all."""
    return _spared(index, sub) or UNREAD.get(index, "")


def _spared(index: int, sub: int) -> str:
    key = profile_key(index, sub)
    lacks = LACKS.get(key, "no") if key.startswith(("options.", "self_stop.")) else ""
    return f"; where the drive does not have it, `{key}: {lacks}` in its drive profile" if lacks else ""


def in_digits(step: Write) -> str:
    """ "6007h:0 to 0003h": the object and its value, as manufacturer's tools and canbase bus sdo show it."""
    return f"{step} to {int.from_bytes(step.data, 'little'):0{2 * len(step.data)}X}h"


def without(step: Write, *, lacks_it: bool = False) -> str:
    """What it means for the robot, and what helps: a proof by `canbase setup commission` counts where the drive lacks
    it."""
    index = _first_axis(step.index)
    if beside := BESIDES.get((index, step.sub), ""):
        return f"; so {beside}" + (f": set {in_digits(step)} with the manufacturer's tool" if not lacks_it else "")
    meaning = WITHOUT.get((index, step.sub)) if step.value else None
    if not meaning:
        return ""
    by_hand = f"set {in_digits(step)} with the manufacturer's tool"
    cure = "canbase setup commission shows whether it stops in another way" if lacks_it else by_hand
    if index in FOR_SELF_STOP:
        longer = (
            "" if lacks_it or index != 0x1016 else ", or `timeouts.drive_heartbeat_s` in robot.yaml to what it takes"
        )
        return f"; so {meaning}: {cure}{longer}, else only a wired STO does"
    return f"; so {meaning}" if lacks_it else f"; so {meaning}: {cure}"
