"""`canbase explain`: what stopped the robot, from a recording of its CAN bus."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, load_config, with_cursor

if TYPE_CHECKING:
    from canbase_config.robot import Robot
    from canbase_recording.explain_file import Progress
    from canbase_recording.explanation import Explanation
    from canbase_recording.recording_facts import RecordingFacts

SERVICES: Final = Path("/var/lib/canbase")
RECORDINGS: Final = ("stop_*.asc", "watchdog_*.jsonl")
LARGE_BYTES: Final = 10_000_000
"""From this size on there is a progress bar."""
EPILOG: Final = (
    "Examples:  \ncanbase explain stop_robot_20261124T201500.000Z_drive_silent.asc --config robot.yaml  \n"
    "canbase explain stop.asc --config robot.yaml --html stop.html  \n"
    "candump -L can0 > can0.log;  canbase explain can0.log"
)
EdsOption = Annotated[
    list[Path] | None, typer.Option("--eds", metavar="FILE", help="An EDS file, for the names of objects; repeatable.")
]
ChannelOfFile = Annotated[
    str | None,
    typer.Option("--channel", metavar="NAME", help="Of several in the file.", show_default="that of the first frame"),
]
RecordingConfig = Annotated[
    Path | None,
    typer.Option(
        "--config",
        "-c",
        metavar="FILE",
        help="The robot.yaml: joints, units, PDOs.",
        show_default="that of the .json beside a black box, else none",
    ),
]


def explain(
    recording: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="ASC (a black box), watchdog_….jsonl, candump -L, BLF, TRC, or MCAP of canbase record export.",
            show_default="the newest in ~/.local/state/canbase or /var/lib/canbase",
        ),
    ] = None,
    config: RecordingConfig = None,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Write a page that opens offline.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    channel: ChannelOfFile = None,
    eds: EdsOption = None,
    bitrate: Annotated[
        int | None,
        typer.Option("--bitrate", metavar="BIT/S", min=10_000, help="Of the bus, for its load.", show_default="500000"),
    ] = None,
) -> None:
    """Explain a recording (black box, candump): what stopped the robot, which part reacted, what each part did then.

    It also explains recordings of other CiA 402 networks: states, missing heartbeats, emergencies, SDO aborts. Without
    a robot.yaml, speeds are the raw numbers of the drives. What the recording does not show is reported as such.

    Exit codes: 0 explained (also if there was no stop), 1 nothing in the file can be read, 2 wrong command line or
    robot.yaml.
    """
    from canbase_config.eds_file import EdsError
    from canbase_recording.explain_file import explain_file
    from canbase_recording.recording_file import NoRecordingError

    recording = recording or _newest()
    robot, source = recorded_robot(recording, config)
    make_page = _page_maker() if html is not None else None
    if not recording.is_file():
        fail(f"{recording}: there is no such file", WRONG_INPUT)
    try:
        with _progress(recording) as progress:
            facts, explanation = explain_file(
                recording, robot, config=source, channel=channel, eds_files=eds or (),
                bitrate=bitrate, progress=progress,
            )  # fmt: skip
    except NoRecordingError as error:
        fail(str(error), FAILED)
    except EdsError as error:
        fail(f"--eds: {error}", WRONG_INPUT)
    _print(facts, explanation, as_json=as_json)
    if html is not None and make_page is not None:
        try:
            html.write_text(make_page(facts, explanation), encoding="utf-8")
        except OSError as error:
            fail(f"{html} cannot be written: {error.strerror}", WRONG_INPUT)
        typer.echo(f"canbase: {html} written", err=True)


def _newest() -> Path:
    """The recording of the last stop of a robot of this user or of the services."""
    from canbase_runtime.input_files import state_folder

    folders = (state_folder(None, os.environ, Path.home()), SERVICES)
    found = [file for folder in folders for kind in RECORDINGS for file in folder.glob(kind)]
    if not found:
        fail(f"{' and '.join(map(str, folders))} have no recording of a stop; name a FILE", WRONG_INPUT)
    newest = max(found, key=_written_s)
    typer.echo(f"canbase: the newest recording: {newest}", err=True)
    return newest


def _written_s(file: Path) -> float:
    """When [s, since 1970]; 0 for one that the driver has just deleted."""
    try:
        return file.stat().st_mtime
    except OSError:
        return 0.0


def recorded_robot(recording: Path, config: Path | None) -> tuple[Robot | None, str]:
    """The robot of --config, else the one that canbase has recorded beside an .asc file; and the name of its file."""
    from canbase_recording.input_lines import NoInputsError
    from canbase_recording.stop_file import robot_beside

    if config is not None:
        return load_config(config, quiet=True).robot, config.name
    try:
        robot = robot_beside(recording)
    except NoInputsError as error:
        typer.echo(f"canbase: {error}. It is not used; --config names a robot.yaml", err=True)
        robot = None
    return robot, recording.with_suffix(".json").name if robot else ""


def _print(facts: RecordingFacts, explanation: Explanation, *, as_json: bool) -> None:
    if as_json:
        from canbase_recording.explain_json import as_json as to_json

        typer.echo(json.dumps(to_json(facts, explanation), ensure_ascii=False))
        return
    from canbase_recording.explain_text import text_lines

    for line in text_lines(facts, explanation):
        typer.echo(line)


def _page_maker() -> Callable[[RecordingFacts, Explanation], str]:
    """Found before a long file is read."""
    try:
        from canbase_recording.explain_page import page
    except ModuleNotFoundError as error:
        fail(f"--html needs the Python package {error.name}: pip install 'plotly>=6,<8'", WRONG_INPUT)
    return page


@contextmanager
def _progress(recording: Path) -> Iterator[Progress | None]:
    """A bar for a long file on a terminal."""
    if not sys.stderr.isatty() or recording.stat().st_size < LARGE_BYTES:
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress as Bar

    with Bar(console=Console(file=with_cursor(sys.stderr)), transient=True) as bar:
        task = bar.add_task("reading the recording")
        yield lambda done, total: bar.update(task, completed=done, total=total)
