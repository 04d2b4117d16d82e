"""Whether a drive may be changed now: its motors have no power and do not turn. CiA 402-2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from canbase_commissioning.object_dictionary import Address, statuswords
from canbase_config.eds_file import Eds
from canbase_config.object_map import AXIS_OFFSET, POSITION_ACTUAL, STATUSWORD
from canbase_driver.boot.steps import Pause, Steps, unsigned
from canbase_driver.cia301.sdo_client import NO_OBJECT, NO_SUB_INDEX, Read, SdoAborted
from canbase_driver.cia402 import decode_statusword

LOOK_S: Final = 0.2
"""Between two looks at an encoder [s]."""
STILL_COUNTS: Final = 20
"""An encoder that moves less between them is at standstill."""
NO_STATUSWORD: Final = (
    "the power of its motors is unknown: it has no statusword (6041h). Make sure that they have none, and add "
    "--without-statusword"
)


def axes_of(eds: Eds, status_at: Sequence[Address]) -> tuple[Address, ...]:
    """Where statuswords may be: `status_at`, and every axis that the EDS lists."""
    listed = (index for index, _ in eds.objects if index >= STATUSWORD and (index - STATUSWORD) % AXIS_OFFSET == 0)
    found = [*status_at, *(Address(index) for index in sorted(set(listed)) if index < 0xA000)]
    return tuple(dict.fromkeys(found))


def why_not_now(status_at: Sequence[Address], *, without_statusword: bool, motion: bool = True) -> Steps[str]:
    """Why the drive must not be changed; empty: it may. `motion`: look at the encoders too, which takes 0.2 s."""
    words = 0
    for at in status_at:
        data = yield from _read(at)
        if isinstance(data, str):
            return f"{at} cannot be read ({data}): whether the motor has power is unknown"
        for word in statuswords(data):
            words += 1
            state = decode_statusword(word)
            if state is None or state.has_torque:
                return f"{at} shows {state.text if state else 'no known state'}: a motor has power"
    if not (words or without_statusword):
        return NO_STATUSWORD
    return (yield from _motion(status_at)) if motion else ""


def _motion(status_at: Sequence[Address]) -> Steps[str]:
    places = [Address(at.index - STATUSWORD + POSITION_ACTUAL, sub) for at in status_at for sub in (0, 1, 2)]
    before = yield from _positions(places)
    if not before:
        return ""
    yield Pause(LOOK_S, "a second look at the encoders")
    after = yield from _positions(before)
    for at, position in before.items():
        moved = (after.get(at, position) - position + (1 << 31)) % (1 << 32) - (1 << 31)
        if abs(moved) > STILL_COUNTS:
            return f"{at} moved by {moved} counts in {LOOK_S:g} s: a wheel turns"
    return ""


def _positions(places: Sequence[Address] | dict[Address, int]) -> Steps[dict[Address, int]]:
    found = {}
    for at in places:
        data = yield from _read(at)
        if not isinstance(data, str) and len(data) == 4:
            found[at] = unsigned(data)
    return found


def _read(at: Address) -> Steps[bytes | str]:
    """The bytes, none where the drive has no such object, or why they cannot be read."""
    try:
        data: bytes = yield Read(at.index, at.sub)
    except SdoAborted as refused:
        return b"" if refused.code in (NO_OBJECT, NO_SUB_INDEX) else refused.text
    return data
