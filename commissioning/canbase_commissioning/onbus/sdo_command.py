"""`canbase sdo` on the bus. What is read and refused is decided in `commissioning/sdo_access.py`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Final, TypeVar

import typer

from canbase_commissioning.bus_monitor import Listener, ListenSession
from canbase_commissioning.object_dictionary import (
    ABORT_ADVICE,
    TYPES,
    Address,
    decode,
    encode,
    known_object,
    meaning,
    parse_address,
    show,
)
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.sdo_access import Refused, Written, read_object, status_places, write_object
from canbase_commissioning.sdo_session import SdoSession
from canbase_config.eds_file import EdsError, read_eds
from canbase_config.robot import Bus, Robot
from canbase_driver.boot.steps import Steps
from canbase_driver.cia301.sdo_client import SdoAborted, SdoClient, SdoTimeout
from canbase_runtime.terminal import FAILED, colour, fail

T = TypeVar("T")
LISTEN_S: Final = 0.4
"""Three heartbeats of canbase's driver: it is received if it is there."""
ATTEMPTS: Final = 3


@dataclass(frozen=True, slots=True)
class Target:
    """One object of one node, and what is known about it. `kind`: of objects.TYPES; empty: unknown."""

    node: int
    at: Address
    kind: str
    name: str
    robot: Robot | None

    @classmethod
    def of(cls, node: int, at: str, kind: str | None, eds: Path | None, robot: Robot | None) -> Target:
        """Of the words of a command line. Raises typer.BadParameter for those that make no sense."""
        if kind is not None and kind not in TYPES:
            raise typer.BadParameter(f"there is no type {kind!r}, expected one of {', '.join(TYPES)}")
        drives = [drive for drive in robot.drives if drive.node_id == node] if robot else []
        ours = Path(str(files("canbase_config"))) / "eds" / "canbase_cia402.eds"
        try:
            address = parse_address(at)
            eds_files = [read_eds(path) for path in (eds, ours) if path is not None]
        except (ValueError, EdsError) as error:
            raise typer.BadParameter(str(error)) from error
        known = known_object(address, eds_files, drives[0].kind if drives else None)
        return cls(node, address, kind or known.type, known.name, robot)

    def __str__(self) -> str:
        return f"node {self.node}, {self.at}{f' {self.name}' if self.name else ''}"


def run_read(bus: Bus, target: Target, timeout_s: float, *, raw: bool) -> None:
    """Reads and prints; exits with 1 when there is nothing to print."""
    with open_line(bus) as line:
        data = _transfer(line, target.node, read_object(target.at), _listen(line), timeout_s)
    if raw:
        typer.echo(decode(data, target.kind))
        return
    words = meaning(target.at, data)
    typer.echo(f"{target}: {show(data, target.kind)}{f': {words}' if words else ''}")


def run_write(bus: Bus, target: Target, value: str, timeout_s: float, *, force: bool) -> None:
    """Writes, reads back, and prints both; exits with 1 when it was not written, 2 for a value that does not fit."""
    if target.kind:
        _or_wrong_value(lambda: encode(value, target.kind))
    with open_line(bus) as line:
        heard = _listen(line)
        if heard.driver_lives and not force:
            fail("canbase's driver runs on this bus and would not know of the change: end it first, or --force", FAILED)
        status_at = status_places(target.node, target.robot)
        steps = write_object(target.at, value, target.kind, status_at, force=force)
        done = _transfer(line, target.node, steps, heard, timeout_s)
    if isinstance(done, Refused):
        fail(f"not written: {done.why}", FAILED)
    _tell(target, done, value)


def _tell(target: Target, done: Written, value: str) -> None:
    before = "?" if done.before is None else show(done.before, target.kind)
    if done.after is None:
        typer.echo(f"{target}: written; it cannot be read back")
        return
    typer.echo(f"{target}: {before} → {show(done.after, target.kind)}")
    wanted = encode(value, target.kind or f"u{8 * len(done.after)}")
    if done.after.rstrip(b"\0") != wanted.rstrip(b"\0"):
        text = f"it reads back a value other than {value}: the drive rounds it, or has it set elsewhere"
        typer.secho(text, err=True, fg=typer.colors.YELLOW, color=colour())


def _listen(line: BusSession) -> Listener:
    listening = ListenSession(LISTEN_S)
    line.run(listening)
    return listening.heard


def _transfer(line: BusSession, node: int, steps: Steps[T], heard: Listener, timeout_s: float) -> T:
    inquiry = SdoSession({node: steps}, heard, lambda node_id: SdoClient(node_id, timeout_s, ATTEMPTS))
    _or_wrong_value(lambda: line.run(inquiry))
    task = inquiry.tasks[node]
    if isinstance(task.error, SdoAborted):
        advice = ABORT_ADVICE.get(task.error.code, "")
        fail(f"{task.error}{f'; {advice}' if advice else ''}", FAILED)
    if isinstance(task.error, SdoTimeout):
        fail(f"{task.error}. {line.problem or 'Power, cable, node id? canbase scan shows who answers'}", FAILED)
    if task.result is None:
        fail(f"another program uses the SDO channel of node {node} all the time (a driver that boots it?)", FAILED)
    return task.result


def _or_wrong_value(do: Callable[[], object]) -> None:
    try:
        do()
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="VALUE") from error
