"""Objects that decide what one bit of 60FFh, 606Ch, 6064h and of the ramps means, and which way is positive. CiA 402-2.

The drives keep them, and all parts of canbase believe them: a drive that has lost one agrees with itself, and turns its
wheel at another speed, or the other way. So `canbase setup commission` notes them, and each boot compares.
"""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from canbase_config.profile import Index, Sub
from canbase_config.section import Section

SCALE_OBJECTS: Final = {
    0x604C: "vl dimension factor",
    0x607E: "polarity",
    0x6089: "position notation index",
    0x608A: "position dimension index",
    0x608B: "velocity notation index",
    0x608C: "velocity dimension index",
    0x608D: "acceleration notation index",
    0x608E: "acceleration dimension index",
    0x608F: "position encoder resolution",
    0x6090: "velocity encoder resolution",
    0x6091: "gear ratio",
    0x6092: "feed constant",
    0x6093: "position factor",
    0x6094: "velocity encoder factor",
    0x6095: "velocity factor 1",
    0x6096: "velocity factor",
    0x6097: "acceleration factor",
    0x60A8: "SI unit position",
    0x60A9: "SI unit velocity",
    0x60AA: "SI unit acceleration",
}
"""Those of the first axis, and their names; those of the second one are at + 800h."""
RATIOS: Final = frozenset((0x604C, *range(0x608F, 0x6098)))
"""Numerator and divisor, at sub-index 1 and 2; all others are single values."""


class Expected(Section):
    """An object that must have this value at the end of each boot."""

    index: Index
    sub: Sub = 0
    value: Annotated[int, Field(ge=-(2**31), le=2**32 - 1, description="value")]

    def __str__(self) -> str:
        return f"{self.index:04X}h:{self.sub} = {self.value}"
