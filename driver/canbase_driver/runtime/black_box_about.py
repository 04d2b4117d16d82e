"""What each recording says of robot and software: versions, the effective configuration, the user's own profiles."""

from __future__ import annotations

import hashlib
import json
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from canbase_config.derive import watchdog_config
from canbase_config.robot import Robot
from canbase_runtime.version import installed_version, is_compiled

PACKAGES = ("python-can", "canopen", "rclpy")
MOST_BYTES = 1_000_000
"""Of a drive profile: a longer one is none."""


def about(robot: Robot) -> dict[str, Any]:
    """Plain values for JSON. Takes 10 ms: to be called before anything has to be on time.

    `robot_yaml` is the effective configuration: as a file of its own it is a robot.yaml again, for JSON is YAML.
    """
    effective = robot.model_dump(mode="json")
    return {
        "robot": robot.name,
        "versions": _versions(),
        "robot_yaml_sha256": sha256_of(effective),
        "robot_yaml": effective,
        "profiles": {drive.profile: _own(drive.profile) for drive in robot.drives if _is_own(drive.profile)},
        "watchdog_config": json.loads(watchdog_config(robot).to_json()),
    }


def sha256_of(effective: Any) -> str:
    """Of a configuration, independent of the order of its keys: of `json.dumps(…, sort_keys=True)`, in hex."""
    return hashlib.sha256(json.dumps(effective, sort_keys=True).encode()).hexdigest()


def _versions() -> dict[str, str]:
    canbase = installed_version() + (" (compiled)" if is_compiled() else "")
    return {"canbase": canbase, "python": platform.python_version(), **{name: _version(name) for name in PACKAGES}}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def _is_own(profile: str) -> bool:
    """A file of the user, not one of canbase's."""
    return profile.endswith((".yaml", ".yml"))


def _own(profile: str) -> str:
    """Its text, which another computer does not have; empty where it can no longer be read."""
    try:
        with Path(profile).open(encoding="utf-8", errors="replace") as file:
            return file.read(MOST_BYTES)
    except OSError:
        return ""
