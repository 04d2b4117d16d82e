"""ROS message types that are installed here: the class of a type, and the text of its definition."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from canbase_recording.ros_definition import definition, of_fields


def message_class(name: str) -> Any:
    """Of a type such as nav_msgs/msg/Odometry. Raises ModuleNotFoundError, AttributeError: not installed."""
    package, space, kind = name.split("/")
    found: Any = importlib.import_module(f"{package}.{space}")
    if space == "action":  # the feedback of an action, and the message around it
        action, part = kind.rsplit("_", 1)
        found = getattr(found, action)
        return getattr(found.Impl if part == "FeedbackMessage" else found, part)
    return getattr(found, kind)


def whole_definition(name: str) -> str:
    """With the types that it contains. Raises ModuleNotFoundError, AttributeError, ValueError: not known here."""
    return definition(name, _definition_of)


def _definition_of(package: str, space: str, kind: str) -> str:
    """The .msg file, which has comments and constants; where there is none, as for an action's feedback: the fields."""
    try:
        return (_share_folder(package) / space / f"{kind}.msg").read_text(encoding="utf-8")
    except OSError:
        return of_fields(message_class(f"{package}/{space}/{kind}").get_fields_and_field_types())


def _share_folder(package: str) -> Path:
    """Of a sourced ROS 2, or of the ROS wheels in this environment."""
    try:
        return Path(get_package_share_directory(package))
    except (PackageNotFoundError, OSError):
        return Path(sys.prefix) / "share" / package
