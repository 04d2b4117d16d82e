"""`canbase support-bundle`: one file with everything that somebody far away needs. What is taken: `support.py`."""

from __future__ import annotations

import io
import os
import platform
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable, Iterable, Mapping
from importlib.metadata import distributions
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Final

import typer

from canbase_cli import support
from canbase_cli.options import FAILED, fail, load_config
from canbase_cli.redact import cleaned
from canbase_cli.service_environment import service_environment

if TYPE_CHECKING:  # `canbase --help` loads no configuration
    from canbase_config.robot import Robot

LIMIT_BYTES: Final = 20_000_000
"""Of one file: the end of a longer one is taken."""
STATE: Final = Path("/var/lib/canbase")
ETC: Final = Path("/etc/canbase")
UNITS: Final = Path("/etc/systemd/system")


class Bundle:
    """What was collected, in memory, and what was not and why."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.taken: dict[str, str] = {}
        self.missing: dict[str, str] = {}

    def text(self, name: str, what: str, read: Callable[[], str]) -> None:
        """One file, cleaned; an OSError of `read` is the reason why it is missing."""
        try:
            content = read()
        except OSError as error:
            self.missing[name] = f"{what}: {error.strerror or error}"
            return
        self.files[name] = cleaned(content).encode()[-LIMIT_BYTES:]
        self.taken[name] = what

    def file(self, name: str, path: Path) -> None:
        """A file of this computer, if its name is allowed."""
        if support.allowed(path.resolve()):
            self.text(name, str(path), lambda: path.read_text(errors="replace"))
        else:
            self.missing[name] = f"{path}: it may be a key; such files are never taken"

    def output(self, command: support.Command) -> None:
        """What a program prints; one that cannot tell anything is missing with its last words."""
        shown = " ".join(command.argv) + (", in the services' environment" if command.environment is not None else "")
        try:
            ended = subprocess.run(
                command.argv,
                capture_output=True,
                timeout=command.timeout_s,
                stdin=subprocess.DEVNULL,
                env=command.environment,
                check=False,
            )
        except OSError as error:
            self.missing[command.file] = f"{shown}: {error.strerror}"
        except subprocess.TimeoutExpired:
            self.missing[command.file] = f"{shown}: not done within {command.timeout_s:.0f} s"
        else:
            said, complaint = (stream.decode(errors="replace") for stream in (ended.stdout, ended.stderr))
            if said.strip():
                self.text(command.file, f"{shown} (exit code {ended.returncode})", lambda: said + complaint)
            else:
                last = complaint.strip().splitlines()[-1:] or ["it says nothing"]
                self.missing[command.file] = f"{shown}: exit code {ended.returncode}, {last[0]}"

    def write(self, path: Path) -> None:
        """As path, a .tar.gz that its owner alone may read, and that appears whole or not at all."""
        new = path.with_name(f"{path.name}.new{os.getpid()}")
        folder = path.name.removesuffix(".tar.gz")
        manifest = support.manifest(self.taken, self.missing).encode()
        handle = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "wb") as file, tarfile.open(fileobj=file, mode="w:gz") as archive:
            for name, content in [("MANIFEST.txt", manifest), *sorted(self.files.items())]:
                entry = tarfile.TarInfo(f"{folder}/{name}")
                entry.size, entry.mode, entry.mtime = len(content), 0o600, int(time.time())
                archive.addfile(entry, io.BytesIO(content))
        new.replace(path)


def collect(
    robot: Robot,
    config: Path,
    since: str,
    etc: Path = ETC,
    state: Path = STATE,
    named: Mapping[str, Path] = MappingProxyType({}),
) -> Bundle:
    """Everything. Nothing of it touches the bus or orders anything. `named`: the files that robot.yaml names."""
    bundle = Bundle()
    bundle.text("versions/canbase.txt", "canbase, Python, computer", _versions)
    bundle.text("versions/packages.txt", "Python packages", _packages)
    bundle.text("environment.txt", "variables of ROS and canbase", lambda: support.environment_text(os.environ))
    bundle.file("config/robot.yaml", config)
    for name, path in named.items():
        outside = ".." in Path(name).parts or Path(name).is_absolute()
        bundle.file(f"config/elsewhere/{path.name}" if outside else f"config/{name}", path)
    for path in _listed(bundle, "config/installed", etc, ("*.yaml", "*.env", "installed/*.txt")):
        bundle.file(f"config/installed/{path.relative_to(etc)}", path)
    boxes = {path: path.stat().st_mtime for folder in _box_folders(robot, state) for path in folder.glob("*.asc")}
    newest = support.newest_boxes(robot, boxes)
    if not newest:
        folders = ", ".join(str(folder) for folder in _box_folders(robot, state))
        bundle.missing["black_box"] = f"no recording of a stop of {robot.name} in {folders}"
    for path in newest:
        bundle.file(f"black_box/{path.name}", path)
    services = doctor_environment(config, robot.name, etc)
    for command in support.commands(config, since, services):
        bundle.output(command)
    return bundle


def installed_robot(etc: Path) -> Path | None:
    """The robot.yaml of the first robot that is installed; other .yaml files may lie beside it. None: there is none."""
    names = sorted(path.stem for path in (etc / "installed").glob("*.txt")) or ["robot"]
    return next((path for path in (etc / f"{name}.yaml" for name in names) if path.is_file()), None)


def doctor_environment(config: Path, name: str, etc: Path = ETC, units: Path = UNITS) -> dict[str, str] | None:
    """What the services of this robot have, None where none are installed or their .env is not readable.

    The .env is beside an installed `config` and has its name, else that of the robot.
    """
    installed = config.stem if config.resolve().parent == etc.resolve() else name
    try:
        env_file = (etc / f"{installed}.env").read_text()
        drop_ins = [path.read_text() for path in sorted(units.glob(f"canbase-driver@{installed}.service.d/*.conf"))]
    except OSError:
        return None
    return service_environment(os.environ, drop_ins, env_file)


def _listed(bundle: Bundle, name: str, folder: Path, patterns: Iterable[str]) -> list[Path]:
    if not os.access(folder, os.R_OK | os.X_OK):
        bundle.missing[name] = f"{folder}: {'not readable: try sudo' if folder.exists() else 'nothing is installed'}"
        return []
    return sorted(path for pattern in patterns for path in folder.glob(pattern))


def _box_folders(robot: Robot, state: Path) -> list[Path]:
    from canbase_driver.black_box_writer import state_folder

    own = [Path(robot.black_box.folder)] if robot.black_box.folder else []
    return [*own, state_folder(os.environ, Path.home()), state, state / robot.name]


def _versions() -> str:
    from canbase_cli.version import installed_version

    ros = os.environ.get("ROS_DISTRO", "not sourced (the wheels of PyPI, if any)")
    collected = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    python = f"Python {sys.version}\n{sys.executable}"
    return f"canbase {installed_version()}\n{python}\n{platform.platform()}\nROS {ros}\ncollected {collected}\n"


def _packages() -> str:
    """As `pip list --format=freeze` has it, without a process that could be another pip."""
    found = {(dist.metadata["Name"] or "?", dist.version) for dist in distributions()}
    return "".join(f"{name}=={version}\n" for name, version in sorted(found))


def support_bundle(
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", metavar="FILE", help="The robot.yaml.", show_default="the installed"),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="A .tar.gz.", show_default="here, by date")
    ] = None,
    since: Annotated[str, typer.Option(metavar="TIME", help="Journal from then on, as journalctl takes it.")] = "-2h",
) -> None:
    """Collect what helps to find a fault: configuration, versions, units, journal, CAN statistics, black box.

    It orders nothing, and touches no key: docs/logs.md. As root it sees more. Exit codes: 0 written, 1 not.
    """
    loaded = load_config(config or installed_robot(ETC))
    name = f"canbase-support-{loaded.robot.name}-{time.strftime('%Y%m%dT%H%M%S')}.tar.gz"
    path = output or Path(name)
    bundle = collect(loaded.robot, loaded.path, since, named=loaded.files)
    try:
        bundle.write(path)
    except OSError as error:
        fail(f"{path} cannot be written: {error.strerror or error}", FAILED)
    for part, why in sorted(bundle.missing.items()):
        typer.echo(f"not collected: {part}: {why}", err=True)
    typer.echo(f"{path}: {len(bundle.files)} files. Look into it before you send it: its MANIFEST.txt lists them.")
