"""Which objects are settings of a drive, and which are commands, states and measurements. CiA 301, CiA 402-2."""

from __future__ import annotations

from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_config.eds_file import EdsObject
from canbase_config.object_map import AXIS_OFFSET

PROFILE_AREA: Final = range(0x6000, 0xA000)
"""Objects of the device profile; each axis has 800h of them."""
COMMANDS: Final = {
    0x6040: "the controlword",
    0x6042: "a target", 0x6060: "the mode, which the boot sets",
    0x6071: "a target", 0x607A: "a target", 0x60B0: "an offset of a target", 0x60B1: "an offset of a target",
    0x60B2: "an offset of a target", 0x60C1: "a target", 0x60FE: "outputs, such as a brake", 0x60FF: "a target",
}  # fmt: skip
"""By the index of the first axis: what moves a motor or its surroundings."""
SERVICES: Final = {
    0x1003: "the error history",
    0x1010: "stores parameters: canbase bus params store",
    0x1011: "restores defaults: canbase bus params defaults",
    0x1023: "operating system commands", 0x1024: "operating system commands", 0x1025: "operating system commands",
    0x1026: "operating system prompt",
    0x1F50: "a program", 0x1F51: "controls a program", 0x1F56: "a program",
}  # fmt: skip
_SDO_CHANNELS: Final = range(0x1200, 0x1300)
_ACCESS: Final = frozenset(("rw", "rwr", "rww"))


def why_no_setting(entry: EdsObject) -> str:
    """Why an object is no setting that could be compared or restored; empty: it is one."""
    if entry.access not in _ACCESS:
        return f"{entry.access} by the EDS"
    if entry.index in _SDO_CHANNELS:
        return "the channel by which it is read"
    if entry.index in PROFILE_AREA:
        return COMMANDS.get(PROFILE_AREA.start + (entry.index - PROFILE_AREA.start) % AXIS_OFFSET, "")
    return SERVICES.get(entry.index, "")


def is_pdo(at: Address) -> bool:
    """1400h to 1BFFh: parameters of the PDOs."""
    return 0x1400 <= at.index < 0x1C00
