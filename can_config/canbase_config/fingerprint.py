"""One number for a configuration: what was measured or proven with it belongs to no other configuration."""

from __future__ import annotations

import hashlib
import json
from typing import Any, Final

from canbase_config.drive import Drive
from canbase_config.robot import Robot

_APART: Final[dict[str, Any]] = {"lease": {"socket"}, "black_box": {"folder"}, "commissioned": True}
"""Not part of it: files of one computer, and the marks of `canbase setup commission`, which follow from the rest."""


def configuration_sha256(robot: Robot) -> str:
    """SHA-256 in hex of the effective configuration, drive profiles included.

    The same for the same robot on every computer, for every user, and before and after `canbase setup commission` has
    written its marks and the drives' identities (1018h): those are compared one by one.
    """
    values = robot.model_dump(mode="json", exclude={**_APART, "drives": True})
    values["drives"] = [_drive(drive) for drive in robot.drives]
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def _drive(drive: Drive) -> dict[str, Any]:
    """The profile by its contents: a file of the user's own lies elsewhere on another computer."""
    values = drive.model_dump(mode="json", exclude={"identity", "profile"})
    return {**values, "profile": drive.kind.model_dump(mode="json")}
