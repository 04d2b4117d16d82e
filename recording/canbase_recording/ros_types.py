"""ROS message types that are installed here: the class of a type, and the text of its definition."""

from __future__ import annotations

import importlib
import os
import re
import sys
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from canbase_recording.ros_definition import definition, of_fields

_NAME = re.compile(r"([a-z][a-z0-9_]*)/(msg|srv|action)/([A-Za-z][A-Za-z0-9_]*)")


def message_class(name: str) -> Any:
    """Of a type such as nav_msgs/msg/Odometry. Raises ModuleNotFoundError, AttributeError: not installed.

    The name comes from a recording or from another process, and an import runs code: only a type that the ament index
    lists is imported.
    """
    package, space, kind = _checked(name)
    found: Any = importlib.import_module(f"{package}.{space}")
    if space == "action":  # the feedback of an action, and the message around it
        action, part = kind.rsplit("_", 1)
        found = getattr(found, action)
        return getattr(found.Impl if part == "FeedbackMessage" else found, part)
    return getattr(found, kind)


def _checked(name: str) -> tuple[str, str, str]:
    """Package, space and type. Raises ModuleNotFoundError."""
    found = _NAME.fullmatch(name)
    if found is None:
        raise ModuleNotFoundError(f"{name!r} is no type of ROS")
    package, space, kind = found.groups()
    if f"{space}/{kind.partition('_')[0]}.{space}" not in _listed(package):
        raise ModuleNotFoundError(f"the ament index does not list the type {name}")
    return package, space, kind


def _listed(package: str) -> list[str]:
    """The interfaces that a package has installed, such as msg/Odometry.msg."""
    prefixes = [*filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)), sys.prefix]
    for prefix in prefixes:
        path = Path(prefix) / "share" / "ament_index" / "resource_index" / "rosidl_interfaces" / package
        if path.is_file():
            return path.read_text(encoding="utf-8", errors="replace").splitlines()
    return []


def whole_definition(name: str) -> str:
    """With the types that it contains. Raises ModuleNotFoundError, AttributeError, ValueError: not known here."""
    _checked(name)
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
