"""Which software computes: results are the same to the last bit where it is the same."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Final

from canbase_runtime.version import installed_version

COMPUTES: Final = (
    "canbase_config", "canbase_base", "canbase_runtime", "canbase_driver", "canbase_velocity",
    "canbase_watchdog", "canbase_action_server", "canbase_sim", "canbase_campaign",
)  # fmt: skip
"""Packages whose sources decide what comes out,"""
OURS: Final = ("driving.py", "job.py", "outcome.py", "runs.py", "simulated_robot.py")
"""... and files of this one. The others only hand it on, or report it."""


@dataclass(frozen=True, slots=True)
class Software:
    """Of this process. `sources`: a mark of canbase's own files, which differs where one version was changed."""

    canbase: str
    sources: str
    python: str
    numpy: str

    def __str__(self) -> str:
        return f"canbase {self.canbase} (sources {self.sources}), Python {self.python}, numpy {self.numpy}"


@cache
def software() -> Software:
    """Of this process."""
    return Software(installed_version(), _sources(), platform.python_version(), version("numpy"))


def _sources() -> str:
    digest = hashlib.sha256()
    here = Path(__file__).parent
    for file in (*_files(), *(here / name for name in OURS)):
        digest.update(f"{file.parent.name}/{file.name}\0".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def _files() -> Iterator[Path]:
    for package in COMPUTES:
        folder = Path(str(import_module(package).__file__)).parent
        yield from sorted(file for file in folder.rglob("*") if file.suffix in (".py", ".yaml", ".eds"))
