"""Which files and programs a support bundle takes from. Pure. What it shows of each of them: bundle_filter.py.

Files are named one by one, never taken by the folder: the keys of SROS2 lie beside robot.yaml.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from canbase_doctor.bundle_filter import UNIT_PROPERTIES
from canbase_doctor.bundle_words import Words
from canbase_doctor.service_environment import arguments
from canbase_runtime.own_modules import module_command

FORBIDDEN: Final = re.compile(
    r"(?i)(\.(pem|key|p12|pfx|p7s|crt|cer)$)|(^|/)(keys|keystore|enclaves|private|\.ssh)(/|$)"
)
"""No file of such a name or below such a folder is taken, even when an argument names it."""
BOXES: Final = 5
"""The number of recordings of stops, the newest first."""
LEGEND: Final = (
    "Each file holds only what docs/troubleshooting.md lists. An ellipsis stands for what was left out: a word that is "
    "none of canbase's own messages. Zeros stand for the data of SDO frames that can hold text.\n"
)


@dataclass(frozen=True, slots=True)
class Command:
    """A program whose output is one file of the bundle."""

    file: str
    argv: tuple[str, ...]
    timeout_s: float = 20.0
    environment: Mapping[str, str] | None = None
    """None: that of the caller."""


def commands(config: Path, since: str, services: Mapping[str, str] | None = None) -> tuple[Command, ...]:
    """All of them; `since` as journalctl takes it, `services`: their environment, by which the doctor finds them."""
    check = module_command("canbase_cli", "config", "check", str(config))
    doctor = module_command("canbase_cli", "doctor", "--config", str(config), *arguments(services or {}))
    properties = [f"--property={name}" for name in UNIT_PROPERTIES]
    journal = ("journalctl", "--no-pager", "--since", since)
    return (
        Command("system/kernel.txt", ("uname", "-s", "-r", "-m")),
        Command("system/release.txt", ("cat", "/etc/os-release")),
        Command("system/load.txt", ("cat", "/proc/uptime", "/proc/loadavg", "/proc/meminfo")),
        Command("system/disks.txt", ("df", "-h")),
        Command("system/usb.txt", ("lsusb",)),
        Command("can/interfaces.json", ("ip", "-details", "-statistics", "-json", "link", "show", "type", "can")),
        Command("can/sockets.txt", ("sh", "-c", "head -n 50 /proc/net/can/*")),
        Command("units/list.txt", ("systemctl", "list-units", "--all", "--no-pager", "canbase*")),
        Command("units/status.txt", ("systemctl", "show", "--no-pager", *properties, "canbase*")),
        Command("journal/canbase.json", (*journal, "--output=json", "--unit=canbase*"), 60.0),
        Command("journal/kernel.txt", (*journal, "--output=short-precise", "--dmesg"), 60.0),
        Command("config/check.txt", tuple(check)),
        Command("doctor.txt", tuple(doctor), 40.0, services),
    )


def allowed(path: Path) -> bool:
    """Whether a file of this name may be taken."""
    return FORBIDDEN.search(path.as_posix()) is None


def newest_boxes(robot: str, found: Mapping[Path, float]) -> list[Path]:
    """The last recordings of each part of the robot of this name, of all robots if empty; `found`: files and
    modification times."""
    newest = sorted(found, key=lambda path: found[path], reverse=True)
    of_each = ([path for path in newest if _is_of(path, part, suffix, robot)] for part, suffix in RECORDINGS)
    return [path for mine in of_each for path in mine[:BOXES]]


RECORDINGS = (("stop", ".asc"), ("watchdog", ".jsonl"), ("velocity", ".jsonl"))
"""By whom: how their names begin and end. A .json lies beside an .asc."""


_PLACES = re.compile(r"(?:/etc|/var/lib|/run|/dev)/canbase(?:/[A-Za-z][A-Za-z0-9_]{0,63}){0,2}(?:\.[a-z]{1,5})?")
_BOX = re.compile(r"[a-z]{4,8}_[A-Za-z][A-Za-z0-9_]{0,63}_(?:\d{1,4}|\d{8}T\d{6}\.\d{3}Z(?P<cause>(?:_[a-z0-9]+)*))")


def shown_place(path: Path) -> str:
    """A path as the bundle names it: in full where canbase chose it, by its ending where a user did."""
    return str(path) if _PLACES.fullmatch(str(path)) else f"a file of the user ({path.suffix[:6] or 'no ending'})"


def box_name(path: Path, number: int, words: Words) -> str:
    """A recording has its own name where canbase gave it, with a cause; otherwise a number."""
    found = _BOX.fullmatch(path.stem)
    own = found is not None and all(word in words for word in (found["cause"] or "").split("_") if word)
    return path.stem if own else f"recording_{number}"


def _is_of(path: Path, part: str, suffix: str, robot: str) -> bool:
    begin = f"{part}_{robot}_" if robot else f"{part}_"
    return path.suffix == suffix and path.name.startswith(begin)


def manifest(taken: Mapping[str, str], missing: Mapping[str, str]) -> str:
    """The table of contents; what could not be collected comes first, each with its reason."""
    lines = ["NOT COLLECTED", *(f"  {name}: {why}" for name, why in sorted(missing.items())), ""]
    lines += ["COLLECTED", *(f"  {name}: {what}" for name, what in sorted(taken.items())), ""]
    return "\n".join(lines) + LEGEND
