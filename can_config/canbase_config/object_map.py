"""Where the objects of each axis are: the layout of a profile applied to the axis-0 indexes of CiA 402-2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from canbase_config.profile import Profile

PROFILE_402: Final = 402
"""Device profile of motor drives, in the lower half of 1000h (CiA 301, CiA 402-1)."""
AXIS_OFFSET: Final = 0x800
"""The objects of the second axis are at 6800h (CiA 402-2)."""
CONTROLWORD, STATUSWORD, MODE, MODE_DISPLAY = 0x6040, 0x6041, 0x6060, 0x6061
POSITION_ACTUAL, VELOCITY_ACTUAL, TARGET_VELOCITY = 0x6064, 0x606C, 0x60FF
VL_TARGET_VELOCITY, VL_VELOCITY_ACTUAL = 0x6042, 0x6044
VL_OBJECTS: Final = {TARGET_VELOCITY: VL_TARGET_VELOCITY, VELOCITY_ACTUAL: VL_VELOCITY_ACTUAL}
"""In mode 2 (vl, velocity mode of inverters) these are used in place of the others; 16 bits (CiA 402-2)."""
TORQUE_ACTUAL, CURRENT_ACTUAL = 0x6077, 0x6078
TORQUE_OBJECTS: Final = {"6077h": TORQUE_ACTUAL, "probe": TORQUE_ACTUAL, "6078h": CURRENT_ACTUAL}
"""By `options.torque` of a profile; what is not here has none."""

_BITS: Final = {
    0x6007: 16,
    CONTROLWORD: 16,
    STATUSWORD: 16,
    0x605A: 16,
    0x605E: 16,
    MODE: 8,
    MODE_DISPLAY: 8,
    POSITION_ACTUAL: 32,
    VELOCITY_ACTUAL: 32,
    TORQUE_ACTUAL: 16,
    CURRENT_ACTUAL: 16,
    0x6083: 32,
    0x6084: 32,
    0x6085: 32,
    TARGET_VELOCITY: 32,
}
"""Widths by CiA 402-2."""
_ARRAYS: Final = frozenset(
    (POSITION_ACTUAL, VELOCITY_ACTUAL, TARGET_VELOCITY, TORQUE_ACTUAL, CURRENT_ACTUAL, 0x6083, 0x6084, 0x6085)
)
"""What drives with the layout sub_index have once for each motor; of the rest they have one for both."""


@dataclass(frozen=True, slots=True)
class Place:
    """An object of one axis. Its value begins at bit `shift` of the `bits` that are read or mapped."""

    index: int
    sub: int
    bits: int
    shift: int = 0

    @property
    def mapping_entry(self) -> int:
        """The entry of 1600h/1A00h (CiA 301): index, sub-index, length in bits."""
        return self.index << 16 | self.sub << 8 | self.bits


def place(profile: Profile, index: int, axis: int) -> Place:
    """Where object `index` (as of the first axis, 6000h…67FFh) of axis 0 or 1 is.

    A profile of mode 2 has its own target and actual velocity in place of 60FFh and 606Ch.
    Raises ValueError for an axis that the layout does not have, and for an index that canbase does not use.
    """
    layout = profile.layout
    if index not in _BITS or not 0 <= axis < layout.axes:
        raise ValueError(f"{index:04X}h of axis {axis}: expected an axis below {layout.axes} and an object in use")
    bits = {TARGET_VELOCITY: layout.target_bits, VELOCITY_ACTUAL: layout.velocity_bits}.get(index, _BITS[index])
    if profile.is_vl:
        index = VL_OBJECTS.get(index, index)
    if layout.second_axis == "offset":
        return Place(index + AXIS_OFFSET * axis, 0, bits)
    if index == STATUSWORD and layout.statusword == "packed":
        return Place(index, 0, 32, 16 * axis)
    is_array = index in _ARRAYS or (index == CONTROLWORD and layout.controlword == "own")
    return Place(index, axis + 1 if is_array or (index == STATUSWORD) else 0, bits)
