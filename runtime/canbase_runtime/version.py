"""The version of canbase, as pip or as colcon installed it."""

from __future__ import annotations

import os
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree


def installed_version() -> str:
    """From pip's metadata, else from the package.xml that a sourced colcon workspace installed; else `unknown`."""
    try:
        return version("canbase")
    except PackageNotFoundError:
        return _version_in_workspace(os.environ.get("AMENT_PREFIX_PATH", ""))


def is_compiled() -> bool:
    """The deciding modules run compiled (docs/install.md). One build makes all of them: policy stands for the rest."""
    found = find_spec("canbase_watchdog.policy")
    return found is not None and (found.origin or "").endswith(tuple(EXTENSION_SUFFIXES))


def _version_in_workspace(prefixes: str) -> str:
    """`prefixes`: installed workspaces, separated as in AMENT_PREFIX_PATH; the first that has canbase counts."""
    for prefix in filter(None, prefixes.split(os.pathsep)):
        manifest = Path(prefix) / "share" / "canbase" / "package.xml"
        if manifest.is_file():
            return ElementTree.parse(manifest).findtext("version", "unknown")
    return "unknown"
