"""What an installation takes from the machine: unit templates, environment, what is installed already."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from canbase_config.errors import ConfigError
from canbase_config.load import load_robot
from canbase_deploy.keystore import KEYS, found_in, refusals
from canbase_deploy.neighbours import Neighbour
from canbase_deploy.owner import ETC, owner_paths
from canbase_deploy.ownership import HOMES, faults, refusal
from canbase_deploy.plan import PARTS, InstallError, service
from canbase_runtime.environment_file import variables

PATHS: Final = ("AMENT_PREFIX_PATH", "PYTHONPATH", "LD_LIBRARY_PATH")
SOURCED: Final = (*PATHS, "ROS_DISTRO", "ROS_VERSION", "ROS_PYTHON_VERSION")
"""What a sourced ROS 2 workspace puts into the environment and a process needs to find it."""
CHOSEN: Final = ("ROS_DOMAIN_ID", "RMW_IMPLEMENTATION")
"""What the user may have chosen; it goes along where it is set."""
HIDDEN: Final = (*HOMES, "/run/user/", "/tmp/", "/var/tmp/")
"""What the units cannot see, by ProtectHome and PrivateTmp."""
UNCHANGED: Final = "Nothing was changed: what is installed goes on as it is."
REHEARSAL_S: Final = 120.0
"""A small computer imports ROS 2 from a cold memory card in some ten seconds."""
_USES: Final = """
import sys
import canbase.msg, canbase_cli.main, canbase_config.load, can, canopen, rclpy
for module in (canbase, canbase_cli, canbase_config, can, canopen, rclpy):
    print(module.__file__)
print(sys.base_prefix + "/")  # the system's own: seen, not looked through
print(*filter(None, sys.path), sep="\\n")
if sys.prefix != sys.base_prefix:
    print(sys.prefix)
"""
_USES_RELAY: Final = "from gpiod import LineSettings, request_lines\n"
_ADVICE: Final = (
    "With ROS 2 from apt the whole command has to know it: sudo bash -c 'source /opt/canbase/install/setup.bash && "
    "canbase setup install …'"
)


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


def sourced(environment: Mapping[str, str]) -> dict[str, str]:
    """What of this environment the services need to find ROS 2. The ROS wheels of PyPI find themselves."""
    if importlib.util.find_spec("ros_wheels_bootstrapper") is not None:
        return {}
    values = {name: environment.get(name, "") for name in SOURCED}
    values |= {name: os.pathsep.join(_entries(values[name])) for name in PATHS}
    return {name: value for name, value in values.items() if value}


def folders(environment: Mapping[str, str]) -> list[str]:
    """Where programs and libraries of the services come from by their environment."""
    return [entry for name in PATHS for entry in _entries(environment.get(name, ""))]


def _entries(value: str) -> list[str]:
    """An empty or relative one means the current folder, whatever that is."""
    return [entry for entry in value.split(os.pathsep) if os.path.isabs(entry)]


def refuse_keystore() -> None:
    """Raises InstallError where /etc/canbase/keys is not what `--sros2` needs."""
    if wrong := refusals(found_in(Path(KEYS))):
        raise InstallError("\n".join(["--sros2:", *wrong]))


def refuse_others(paths: Iterable[str]) -> None:
    """Raises InstallError where others than root could change these files and folders, or what is below them."""
    if refused := refusal(faults(paths)):
        raise InstallError(refused)


def chosen(environment: Mapping[str, str]) -> dict[str, str]:
    """What of this environment the user chose."""
    return {name: environment[name] for name in CHOSEN if environment.get(name)}


def rehearse(python: str, environment: Mapping[str, str], *, relay: bool = False) -> list[str]:
    """Imports what the services import, with their Python and nothing but their environment. Raises InstallError.

    `relay`: the watchdog needs gpiod too. Returns the files and folders that they import from.

    sudo keeps no LD_LIBRARY_PATH, whatever it is told: found out here, and not by a robot that does not start.
    """
    try:
        done = subprocess.run(
            [python, "-s", "-c", _USES + (_USES_RELAY if relay else "")],
            env=dict(environment),
            cwd="/",
            capture_output=True,
            text=True,
            timeout=REHEARSAL_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InstallError(f"--python {python}: {error}") from error
    if done.returncode != 0:
        why = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        advice = f"watchdog.relay needs it: {python} -m pip install 'gpiod>=2.1,<3'" if "gpiod" in why else _ADVICE
        raise InstallError(f"the services would not start with {python}: {why}. {advice}")
    used = done.stdout.splitlines()
    for path in (python, str(Path(python).resolve()), *used):
        if path.startswith(HIDDEN):
            raise InstallError(
                f"the services do not see {path} (ProtectHome, PrivateTmp in their units): install below /opt"
            )
    return [path for path in used if path and not path.endswith("/")]


def named_texts(files: Mapping[str, Path]) -> dict[str, str]:
    """Texts of the files that robot.yaml names, by its relative paths; one with an absolute path stays where it is.

    Raises InstallError for one that the services would not see, or that cannot be read.
    """
    for name in files:
        if name.startswith(HIDDEN):
            raise InstallError(
                f"robot.yaml names {name}, which the services do not see: expected a path relative to robot.yaml, "
                "then it is installed too"
            )
    try:
        return {name: path.read_text("utf-8") for name, path in files.items() if not Path(name).is_absolute()}
    except OSError as error:
        raise InstallError(f"robot.yaml needs {error.filename}: {error.strerror}") from error


def environment(prefix: Path, name: str) -> dict[str, str]:
    """What the environment file of an installed robot sets; empty where there is none."""
    path = prefix / owner_paths(name)[1].relative_to("/")
    return variables(path.read_text("utf-8")) if path.is_file() else {}


def neighbours(prefix: Path, name: str, installed: Iterable[str]) -> list[Neighbour]:
    """The installed robots but the one of this name. Raises InstallError for one whose robot.yaml cannot be used."""
    found = []
    for other in sorted(set(installed) - {name}):
        path = prefix / owner_paths(other)[0].relative_to("/")
        try:
            loaded = load_robot(path)
        except ConfigError as error:
            raise InstallError(
                f"{error}\nthe robot {other} is installed too, and this version cannot use its {path}. Mend it "
                f"(`canbase config check --config {path}`), or `sudo canbase setup uninstall {other}`. {UNCHANGED}"
            ) from error
        found.append(Neighbour(other, loaded.robot, named_texts(loaded.files), environment(prefix, other)))
    return found


def refuse_running(name: str, interfaces: Sequence[str]) -> None:
    """Raises InstallError where a part of the robot runs that would lose one of these interfaces."""
    units = [service(part, name) for part in PARTS]
    if interfaces and subprocess.run(["systemctl", "is-active", "--quiet", *units], check=False).returncode == 0:
        raise InstallError(
            f"{name} runs, and robot.yaml no longer names its CAN interface: {' '.join(interfaces)} would be stopped "
            f"under it. First, with the robot at standstill: sudo systemctl stop canbase@{name}.target"
        )


def manifests(prefix: Path) -> dict[str, str]:
    """For each installed robot the list of its files, one a line."""
    folder = prefix / (ETC / "installed").relative_to("/")
    return {path.stem: path.read_text(encoding="utf-8") for path in folder.glob("*.txt")}
