"""At which bit rate a bus works: listening at each first, and questions only where nothing was received. Pure.

Nobody can hear another bit rate than its own, and whoever sends at a wrong one disturbs those who talk at the right
one. So the search listens at every rate before it sends anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from canbase_config.bit_rate import BIT_RATES

USUAL = (500_000, 125_000, 250_000, 1_000_000)
"""Of new drives [bit/s]; the others come behind them."""
LISTEN_S = 0.6
"""At each rate: heartbeats and PDOs are mostly more frequent [s]."""


@dataclass(frozen=True, slots=True)
class Heard:
    """What came at one bit rate [bit/s]: frames that could be read, and errors of the controller."""

    bitrate: int
    frames: int
    errors: int


def order(first: int) -> tuple[int, ...]:
    """Every bit rate once: that of robot.yaml, the usual ones, the others [bit/s]."""
    return tuple(rate for rate in dict.fromkeys((first, *USUAL, *BIT_RATES)) if rate in BIT_RATES)


def from_listening(heard: Sequence[Heard]) -> int | None:
    """The bit rate at which most frames were read; None: at none. Two rates on one cable cannot both work."""
    best = max(heard, key=lambda one: one.frames)
    return best.bitrate if best.frames else None


def nobody(heard: Sequence[Heard]) -> str:
    """Why no bit rate was found, with what to look at."""
    errors = [f"{one.bitrate} bit/s" for one in heard if one.errors]
    if errors and len(errors) == len(heard):
        return (
            "errors at every bit rate, and no frame that can be read: drives with different bit rates on one cable, or "
            "a disturbed cable. Connect one drive at a time; check the 60 Ω between CAN_H and CAN_L"
        )
    return "no drive answers at any bit rate; check power, cable, termination"
