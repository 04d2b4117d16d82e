"""`canbase record bundle`: one file with all that remote help needs.

What is collected: `bundle_contents.py`. What is shown of it: `bundle_filter.py`; no text gets into the bundle without.
"""

from __future__ import annotations

import io
import os
import platform
import re
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib.metadata import distributions
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Final

import typer

from canbase_base.own_folder import replaced
from canbase_doctor import bundle_contents as support
from canbase_doctor.bounded_run import run
from canbase_doctor.bundle_filter import LINES, Filter, environment, journal_text, matching, names_of
from canbase_doctor.bundle_words import Words, own_words
from canbase_doctor.careful_read import RefusedError, modified, names, read_end
from canbase_doctor.service_environment import service_environment
from canbase_runtime.terminal import FAILED, ROBOT_HERE, colour, fail
from canbase_runtime.which_robot import ETC, NoRobotError, which_robot

if TYPE_CHECKING:  # `canbase --help` loads no configuration
    from canbase_config.robot import Robot

LIMIT_BYTES: Final = 10_000_000
"""Of one file: the end of a longer one is taken."""
TOTAL_BYTES: Final = 80_000_000
"""Of all: what comes later is missing."""
MOST_FILES: Final = 200
STATE: Final = Path("/var/lib/canbase")
UNITS: Final = Path("/etc/systemd/system")
PARTS: Final = ("driver", "watchdog", "velocity")
"""Whose records of stops there are."""
ROBOT_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
PACKAGE: Final = re.compile(r"[A-Za-z0-9_.-]{1,60}==[0-9][0-9A-Za-z.!]{0,30}(?:\+[0-9a-z.]{1,12})?")
_KEY: Final = "it may be a key; such files are never taken"


class Bundle:
    """What was collected, in memory, and what was not and why."""

    def __init__(self, names: Iterable[str] = ()) -> None:
        """`names`: of the robot."""
        self.filter = Filter(own_words().also(names))
        self.files: dict[str, bytes] = {}
        self.taken: dict[str, str] = {}
        self.missing: dict[str, str] = {}

    def text(self, name: str, what: str, read: Callable[[], str]) -> None:
        """One file as `read` shows it; its OSError is the reason why the file is missing."""
        if len(self.files) >= MOST_FILES or sum(map(len, self.files.values())) >= TOTAL_BYTES:
            self.missing[name] = f"{what}: the bundle is full ({MOST_FILES} files, {TOTAL_BYTES // 1_000_000} MB)"
            return
        try:
            content = read()
        except OSError as error:
            self.missing[name] = f"{what}: {error.strerror or type(error).__name__}"
            return
        self.files[name] = content.encode(errors="replace")[-LIMIT_BYTES:]
        self.taken[name] = what

    def file(self, name: str, path: Path, show: Callable[[str], str]) -> None:
        """A regular file of this computer, if its name is allowed, where it really is too. No link is followed."""
        self.text(name, support.shown_place(path), lambda: show(_regular(path)))

    def output(self, command: support.Command) -> None:
        """The output of a program; one that reports nothing is missing, with its last output."""
        shown = f"{command.argv[0]} …" if command.argv[0] != sys.executable else "canbase …"
        shown += ", in the services' environment" if command.environment is not None else ""
        try:
            code, said, complaint = run(command.argv, command.environment, command.timeout_s, LIMIT_BYTES)
        except OSError as error:
            self.missing[command.file] = f"{shown}: {error.strerror}"
        except subprocess.TimeoutExpired:
            self.missing[command.file] = f"{shown}: not done within {command.timeout_s:.0f} s"
        else:
            if said.strip():
                more = self.filter.words.lines(complaint)
                self.text(
                    command.file, f"{shown} (exit code {code})", lambda: self.filter.output(command.file, said) + more
                )
            else:
                last = complaint.strip().splitlines()[-1:] or ["no output"]
                self.missing[command.file] = f"{shown}: exit code {code}, {self.filter.words.line(last[0])}"

    def write(self, path: Path) -> None:
        """As path, a .tar.gz that its owner alone may read, and that appears whole or not at all."""
        folder = path.name.removesuffix(".tar.gz")
        manifest = support.manifest(self.taken, self.missing).encode()
        with replaced(path, private=True) as file, tarfile.open(fileobj=file, mode="w:gz") as archive:
            for name, content in [("MANIFEST.txt", manifest), *sorted(self.files.items())]:
                entry = tarfile.TarInfo(f"{folder}/{name}")
                entry.size, entry.mode, entry.mtime = len(content), 0o600, int(time.time())
                archive.addfile(entry, io.BytesIO(content))


def _regular(path: Path) -> str:
    if not support.allowed(path):
        raise RefusedError(_KEY)
    place, content = read_end(path, LIMIT_BYTES)
    if not support.allowed(Path(place)):
        raise RefusedError(_KEY)
    return content.decode(errors="replace")


def collect(
    robot: Robot | None,
    config: Path,
    since: str,
    etc: Path = ETC,
    state: Path = STATE,
    named: Mapping[str, Path] = MappingProxyType({}),
    problems: str = "",
) -> Bundle:
    """Everything. Nothing of it touches the bus or orders anything. `named`: the files that robot.yaml names.

    `robot`: None where robot.yaml is of no use, for the reasons in `problems`; then the recordings of all robots count.
    """
    bundle = Bundle(names_of(robot.model_dump(mode="json")) if robot else ())
    shown = bundle.filter
    if problems:
        bundle.text(
            "config/problems.txt",
            "what is wrong with robot.yaml",
            lambda: shown.words.lines(problems.replace(str(config), "robot.yaml")),
        )
    bundle.text("versions/canbase.txt", "canbase, Python, computer", _versions)
    bundle.text("versions/packages.txt", "Python packages", _packages)
    bundle.text("environment.txt", "variables of ROS and canbase", lambda: environment(os.environ))
    bundle.file("config/robot.yaml", config, shown.configuration)
    for number, path in enumerate(named.values()):
        bundle.file(f"config/named_{number + 1}.yaml", path, shown.configuration)
    for path in _listed(bundle, "config/installed", etc / "installed", (".txt",)):
        if ROBOT_NAME.fullmatch(path.stem) is None:
            continue
        bundle.file(f"config/installed/{path.name}", path, partial(matching, LINES["config/installed"]))
        bundle.file(f"config/installed/{path.stem}.yaml", etc / f"{path.stem}.yaml", shown.configuration)
        bundle.file(f"config/installed/{path.stem}.env", etc / f"{path.stem}.env", shown.settings)
    _black_boxes(bundle, robot, state)
    _records(bundle, robot.name if robot else config.stem, state)
    services = doctor_environment(config, robot.name if robot else config.stem, etc)
    for command in support.commands(config, since, services):
        bundle.output(command)
    if "journal/canbase.json" in bundle.files:
        entries = bundle.files["journal/canbase.json"].decode()
        bundle.text("journal/canbase.txt", "canbase.json, for people", lambda: journal_text(entries))
    return bundle


def installed_robot(etc: Path) -> Path | None:
    """The robot.yaml of the first robot that is installed; other .yaml files may lie beside it. None: there is none."""
    stems = sorted(path.stem for path in (etc / "installed").glob("*.txt")) or ["robot"]
    return next((path for path in (etc / f"{stem}.yaml" for stem in stems) if os.path.isfile(path)), None)


def doctor_environment(config: Path, name: str, etc: Path = ETC, units: Path = UNITS) -> dict[str, str] | None:
    """What the services of this robot have, None where none are installed or their .env is not readable.

    The .env is beside an installed `config` and has its name, else that of the robot.
    """
    installed = config.stem if config.resolve().parent == etc.resolve() else name
    try:
        env_file = _regular(etc / f"{installed}.env")
        drop_ins = [_regular(path) for path in sorted(units.glob(f"canbase-driver@{installed}.service.d/*.conf"))]
    except OSError:
        return None
    return service_environment(os.environ, drop_ins, env_file)


def _listed(bundle: Bundle, name: str, folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    try:
        return [folder / file for file in names(folder) if file.endswith(suffixes)]
    except FileNotFoundError:
        bundle.missing[name] = f"{support.shown_place(folder)}: nothing is installed"
    except OSError as error:
        bundle.missing[name] = f"{support.shown_place(folder)}: not readable: {error.strerror}; try sudo"
    return []


def _black_boxes(bundle: Bundle, robot: Robot | None, state: Path) -> None:
    """The newest recordings. Services write to these folders: what is no ordinary file in them is not taken."""
    folders = list(dict.fromkeys(_box_folders(robot, state)))
    found: dict[Path, float] = {}
    for folder in folders:
        try:
            paths = (folder / file for file in names(folder))
            found |= {path: modified(path) for path in paths if path.suffix in (".asc", ".jsonl")}
        except OSError:
            continue  # reported below where no folder has any
    newest = support.newest_boxes(robot.name if robot else "", found)
    if not newest:
        whose = f"of {robot.name}" if robot else "of any robot"
        bundle.missing["black_box"] = f"no recording of a stop {whose} in {_shown(folders)}"
    for number, path in enumerate(newest):
        name = support.box_name(path, number + 1, bundle.filter.words)
        show = bundle.filter.recording if path.suffix == ".asc" else bundle.filter.json_lines
        bundle.file(f"black_box/{name}{path.suffix}", path, show)
        if os.path.lexists(beside := path.with_suffix(".json")):
            bundle.file(f"black_box/{name}.json", beside, bundle.filter.json_file)


def _records(bundle: Bundle, robot: str, state: Path) -> None:
    """What the parts have on disk about their stops, in words: the files name the computer by a number of its own."""
    from canbase_base.latch_folder import SUFFIX, latch_folder

    folders = {"installed": state / robot, "user": latch_folder(os.environ, Path.home(), robot)}
    places = {
        f"stops/{name}/{part}.txt": folder / f"{part}{SUFFIX}" for name, folder in folders.items() for part in PARTS
    }
    found = {name: path for name, path in places.items() if os.path.lexists(path)}
    for name, path in found.items():
        bundle.text(name, support.shown_place(path), partial(_record_text, path, robot, bundle.filter.words))
    if not found:
        bundle.missing["stops"] = f"no record of stops of {robot} in {_shown(folders.values())}"


def _shown(paths: Iterable[Path]) -> str:
    return ", ".join(support.shown_place(path) for path in paths)


def _record_text(path: Path, robot: str, words: Words) -> str:
    from canbase_base import latch_record
    from canbase_base.latch_folder import machine

    _, content = read_end(path, latch_record.SIZE + 1)
    found = latch_record.read(content, latch_record.owner_of(path.stem, robot, machine()))
    record = found.record
    changed = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(modified(path)))
    lines = (
        f"needs a reset: {'yes' if found.latched else 'no'}",
        f"mark: {record.mark.name}, code {record.code}, written {found.sequence} times, last at {changed}",
        f"cause: {words.line(record.cause)}",
        f"detail: {words.line(record.detail)}",
        f"defect: {found.defect.value}",
    )
    return "".join(f"{line.rstrip()}\n" for line in lines)


def _box_folders(robot: Robot | None, state: Path) -> list[Path]:
    from canbase_runtime.input_files import state_folder

    own = [Path(robot.black_box.folder)] if robot and robot.black_box.folder else []
    return [*own, state_folder(None, os.environ, Path.home()), state, *([state / robot.name] if robot else [])]


def _versions() -> str:
    from canbase_runtime.version import installed_version, is_compiled

    ros = "sourced" if os.environ.get("ROS_DISTRO") else "not sourced (the wheels of PyPI, if any)"
    collected = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    python = f"Python {sys.version}"
    form = ", compiled" if is_compiled() else ""
    return f"canbase {installed_version()}{form}\n{python}\n{platform.platform()}\nROS {ros}\ncollected {collected}\n"


def _packages() -> str:
    """As `pip list --format=freeze` has it, without a process that could be another pip."""
    found = sorted({(dist.metadata["Name"] or "?", dist.version) for dist in distributions()})
    return "".join(f"{name}=={version}\n" for name, version in found if PACKAGE.fullmatch(f"{name}=={version}"))


def support_bundle(
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", metavar="FILE", help="The robot.yaml.", show_default=ROBOT_HERE),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="A .tar.gz.", show_default="here, by date")
    ] = None,
    since: Annotated[str, typer.Option(metavar="TIME", help="Journal from then on, as journalctl takes it.")] = "-2h",
) -> None:
    """Collect data for remote help: configuration, versions, units, journal, CAN statistics, black box.

    It changes nothing and reads no keys (docs/troubleshooting.md). As root it can read more. A robot.yaml with mistakes
    is included with a list of them.

    Exit codes: 0 written, 1 not written.
    """
    from canbase_config.errors import ConfigError
    from canbase_config.load import load_robot

    file = config or installed_robot(ETC) or Path("robot.yaml")
    try:
        meant = which_robot(config)
        file = meant.path
        loaded = load_robot(file)
    except (ConfigError, NoRobotError) as error:  # the bundle is needed then above all
        problems = str(error)
        typer.secho(f"{file} cannot be used; collected all the same:\n{problems}", err=True, color=colour())
        bundle, robot = collect(None, file, since, problems=problems), file.stem
    else:
        if meant.why:
            typer.echo(f"robot {loaded.robot.name}: {file} ({meant.why})", err=True)
        bundle, robot = collect(loaded.robot, loaded.path, since, named=loaded.files), loaded.robot.name
    path = output or Path(f"canbase-support-{robot}-{time.strftime('%Y%m%dT%H%M%S')}.tar.gz")
    try:
        bundle.write(path)
    except OSError as error:
        fail(f"{path} cannot be written: {error.strerror or error}", FAILED)
    for part, why in sorted(bundle.missing.items()):
        typer.echo(f"not collected: {part}: {why}", err=True)
    typer.echo(f"{path}: {len(bundle.files)} files. Look into it before you send it: its MANIFEST.txt lists them.")
