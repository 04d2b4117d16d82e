"""Whether the parts that run on this computer were started with this robot.yaml and with this canbase. Reads /proc.

Otherwise everything that `canbase doctor` compares is compared with a file that is not in use.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from canbase_base.single_instance import bus_name, holder
from canbase_doctor.check import Check, fail, ok

if TYPE_CHECKING:
    from canbase_config.load import Loaded
    from canbase_config.robot import Robot

PROC: Final = Path("/proc")
CLOCKS_S: Final = 2.0
"""A file that changed so shortly after the start of a process was there before: boot time is known to a second."""
RESTART: Final = "restart all parts, so that they use the current file"
OF_THE_USER: Final = ("lease_socket", "lease_uid", "bus_arguments")
"""Values of the watchdog's configuration that follow from what starts it."""


@dataclass(frozen=True, slots=True)
class Running:
    """A part that runs on this computer: since when [s, wall clock], and with which words it was started."""

    part: str
    pid: int
    started_s: float
    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Changed:
    """What was changed, and when last [s, wall clock]."""

    what: str
    at_s: float


def running(robot: Robot, proc: Path = PROC) -> tuple[Running, ...]:
    """Watchdog, driver and velocity process of this robot, those that are there and may be looked at."""
    bus = bus_name(robot.bus.arguments())
    names = (("watchdog", bus), ("driver", bus), ("velocity process", robot.lease.socket))
    return tuple(found for part, name in names for found in _running(part, name, proc))


def changes(loaded: Loaded) -> tuple[Changed, ...]:
    """The files of the robot, and canbase itself."""
    files = [loaded.path, *loaded.files.values()]
    return tuple(Changed(str(path), at_s) for path, at_s in [*_times(files), *_times(_installed())])


def running_checks(robot: Robot, found: tuple[Running, ...], changed: tuple[Changed, ...]) -> list[Check]:
    """One row for each part that runs."""
    return [_check(part, _otherwise(part, robot) or _older(part, changed)) for part in found]


def _check(part: Running, problem: str) -> Check:
    name = f"{part.part}'s configuration"
    return fail(name, f"process {part.pid}: {problem}", RESTART) if problem else ok(name, "this robot.yaml")


def _older(part: Running, changed: tuple[Changed, ...]) -> str:
    late = [f"{file.what} was changed after its start" for file in changed if file.at_s > part.started_s + CLOCKS_S]
    return "; ".join(late)


def _otherwise(part: Running, robot: Robot) -> str:
    """The watchdog has its whole configuration on its command line."""
    from canbase_config.derive import watchdog_config

    given = dict(zip(part.words, part.words[1:], strict=False)).get("--config-json")
    if given is None:
        return ""
    try:
        there: Mapping[str, Any] = json.loads(given)
    except ValueError:
        return ""
    here = json.loads(watchdog_config(robot).to_json())
    differ = sorted(key for key in here.keys() | there.keys() if here.get(key) != there.get(key))
    keys = [key for key in differ if key not in OF_THE_USER]
    return f"it runs with another robot.yaml, or an earlier one ({', '.join(keys)} differ)" if keys else ""


def _running(part: str, name: str, proc: Path) -> Iterator[Running]:
    try:
        pid = holder(part, name)
        if pid:
            words = (proc / str(pid) / "cmdline").read_bytes().decode(errors="replace").split("\0")
            yield Running(part, pid, _started_s(pid, proc), tuple(words))
    except (OSError, ValueError, IndexError):  # it ended meanwhile, or belongs to a user who hides it
        return


def _started_s(pid: int, proc: Path) -> float:
    """proc(5): field 22 counts from the boot, in ticks; btime is when that was."""
    ticks = int((proc / str(pid) / "stat").read_text().rpartition(")")[2].split()[19])
    lines = (proc / "stat").read_text().splitlines()
    boot_s = next(int(line.split()[1]) for line in lines if line.startswith("btime "))
    return boot_s + ticks / os.sysconf("SC_CLK_TCK")


def _installed() -> list[Path]:
    try:
        return [Path(str(distribution("canbase").locate_file(""))) / "canbase_config" / "__init__.py"]
    except PackageNotFoundError:
        return []


def _times(files: list[Path]) -> Iterator[tuple[Path, float]]:
    for path in files:
        try:
            yield path, path.stat().st_mtime
        except OSError:
            continue
