"""Programs of other authors that the guest runs, and the scenarios that need them.

They are no part of canbase: a folder outside of it has them, docs/verification.md. Without that folder their
scenarios are skipped, and the output says so.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

VARIABLE: Final = "CANBASE_INDEPENDENT_STACKS"
"""Of the environment: names the folder."""
FILES: Final[Mapping[str, tuple[str, ...]]] = {
    "drives of ros2_canopen": ("cia402_slave", "cia402_slave.eds"),
    "CANopenNode": ("canopend",),
    "CANopenNode writes a setpoint": ("canopend",),
    "CANopenNode takes a drive out": ("canopend",),
}
"""What each scenario needs from the folder."""


def folder() -> Path | None:
    """Where the programs are; None: nobody provides them."""
    name = os.environ.get(VARIABLE, "")
    return Path(name) if name else None


def skipped(chosen: Iterable[str], programs: Path | None) -> dict[str, str]:
    """The scenarios of `chosen` that cannot run here, each with the reason and the remedy."""
    return {name: why for name in chosen if (why := _missing(FILES.get(name, ()), programs))}


def _missing(files: tuple[str, ...], programs: Path | None) -> str:
    if not files:
        return ""
    if programs is None:
        return f"{VARIABLE} names no folder with {', '.join(files)}: docs/verification.md"
    missing = [file for file in files if not (programs / file).is_file()]
    return f"{programs} has no {', '.join(missing)}: docs/verification.md" if missing else ""


def copy_to(programs: Path | None, guest: Path) -> None:
    """Into the folder `guest`, which is made: all that the scenarios need and that is there."""
    guest.mkdir()
    needed = {file for files in FILES.values() for file in files}
    for file in sorted(needed if programs is not None else ()):
        if programs is not None and (programs / file).is_file():
            shutil.copy(programs / file, guest)
