"""What an installation takes from the machine: unit templates, environment, what is installed already."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from canbase_deploy.plan import ETC, InstallError

SOURCED: Final = (
    "AMENT_PREFIX_PATH",
    "PYTHONPATH",
    "LD_LIBRARY_PATH",
    "ROS_DISTRO",
    "ROS_VERSION",
    "ROS_PYTHON_VERSION",
)
"""What a sourced ROS 2 workspace puts into the environment and a process needs to find it."""
CHOSEN: Final = ("ROS_DOMAIN_ID", "RMW_IMPLEMENTATION")
"""What the user may have chosen; it goes along where it is set."""


def templates() -> dict[str, str]:
    """Name and text of the unit files that came with this canbase. Raises InstallError where they are missing."""
    prefixes = [sys.prefix, *filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))]
    for prefix in prefixes:
        folder = Path(prefix) / "share" / "canbase" / "systemd"
        if folder.is_dir():
            return read_templates(folder)
    raise InstallError(f"no unit files in share/canbase/systemd below {', '.join(prefixes)}; install canbase again")


def read_templates(folder: Path) -> dict[str, str]:
    """Name and text of the unit files in a folder."""
    return {path.name: path.read_text(encoding="utf-8") for path in sorted(folder.glob("canbase*"))}


def service_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """What of this environment the services need to find ROS 2. The ROS wheels of PyPI find themselves."""
    wheels = importlib.util.find_spec("ros_wheels_bootstrapper") is not None
    names = CHOSEN if wheels else (*SOURCED, *CHOSEN)
    return {name: environment[name] for name in names if environment.get(name)}


def manifests(prefix: Path) -> dict[str, str]:
    """For each installed robot the list of its files, one a line."""
    folder = prefix / (ETC / "installed").relative_to("/")
    return {path.stem: path.read_text(encoding="utf-8") for path in folder.glob("*.txt")}
