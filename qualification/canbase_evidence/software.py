"""What software the evidence is about: versions, and a CycloneDX list of everything that is installed."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Final

from canbase_evidence.installed_code import code_sha256
from canbase_evidence.standing import Finding, Part, Standing
from canbase_runtime.own_modules import module_command
from canbase_runtime.version import installed_version, is_compiled

_TOOL: Final = "cyclonedx_py"
_SPEC: Final = "1.6"
_LONGEST_S: Final = 180.0
_LIBRARIES: Final = ("python-can", "canopen", "pydantic", "numpy", "rclpy")
_CURE: Final = "pip install 'cyclonedx-bom>=7,<8' in the environment of canbase (the extra evidence)"


@dataclass(frozen=True, slots=True)
class Software:
    """`bom`: JSON text; empty where `finding` says why. `versions`: by name, in the order of the page."""

    versions: Mapping[str, str]
    bom: str
    finding: Finding


def software() -> Software:
    """Looks at this computer. Takes some seconds: a program lists what is installed."""
    bom, problem = _bom()
    if problem:
        found = Finding(Part.SOFTWARE, Standing.MISSING, f"The list of what is installed: {problem}.", _CURE)
    else:
        count = len(json.loads(bom).get("components", ()))
        found = Finding(Part.SOFTWARE, Standing.PRESENT, f"{count} installed packages, as CycloneDX {_SPEC}.")
    return Software(_versions(), bom, found)


def _versions() -> dict[str, str]:
    canbase = installed_version() + (" (compiled)" if is_compiled() else "")
    system = f"{platform.system()} {platform.release()}, {platform.machine()}"
    return {
        "canbase": canbase,
        "code of what runs on the robot": code_sha256(),
        "Python": platform.python_version(),
        "system": system,
        **{name: _version(name) for name in _LIBRARIES},
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _bom() -> tuple[str, str]:
    """The list without its time, and why there is none."""
    if find_spec(_TOOL) is None:
        return "", "the Python package cyclonedx-bom is not installed"
    command = module_command(_TOOL, "environment", "--output-reproducible", "--of", "JSON", "--sv", _SPEC)
    environment = {name: value for name, value in os.environ.items() if name != "SOURCE_DATE_EPOCH"}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_LONGEST_S, check=False, env=environment, cwd="/"
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return "", f"{_TOOL} did not end well: {error}"
    if done.returncode or not _is_object(done.stdout):
        return "", f"{_TOOL} ended with exit code {done.returncode}: {done.stderr.strip()[-300:]}"
    return done.stdout, ""


def _is_object(text: str) -> bool:
    try:
        return isinstance(json.loads(text), dict)
    except ValueError:
        return False
