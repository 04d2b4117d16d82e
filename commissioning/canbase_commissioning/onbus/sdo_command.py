"""`canbase bus sdo` on the bus. What is read and refused is decided in `commissioning/sdo_access.py`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Final, TypeVar

from canbase_commissioning.bus_monitor import Listener, ListenSession
from canbase_commissioning.census import ALL, read
from canbase_commissioning.conversation import Conversation
from canbase_commissioning.identification import DUPLICATES
from canbase_commissioning.object_dictionary import (
    ABORT_ADVICE,
    TYPES,
    Address,
    decode,
    encode,
    known_object,
    meaning,
    show,
)
from canbase_commissioning.object_names import find_object, limits, why_not_read, why_not_write
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.scan_rows import twins_advice
from canbase_commissioning.sdo_access import Refused, Written, beside_driver, read_object, status_places, write_object
from canbase_commissioning.sdo_session import SdoSession
from canbase_config.eds_file import EdsError, EdsObject, read_eds
from canbase_config.robot import Bus, Robot
from canbase_driver.boot.steps import Steps
from canbase_driver.cia301.sdo_client import SdoAborted, SdoClient, SdoTimeout
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, warn

T = TypeVar("T")
LISTEN_S: Final = 0.4
"""Three heartbeats of canbase's driver: it is received if it is there."""
ATTEMPTS: Final = 3
SLOW_BITRATE: Final = 125_000
"""For how close requests to all nodes follow each other [bit/s]: at a higher one there is more room."""


@dataclass(frozen=True, slots=True)
class Target:
    """One object of one node, and what is known about it. `kind`: of objects.TYPES; empty: unknown.

    `entry`: what the manufacturer's EDS has about it; None: nothing, or no EDS was given.
    """

    node: int
    at: Address
    kind: str
    name: str
    robot: Robot | None
    entry: EdsObject | None = None

    @classmethod
    def of(cls, node: int, at: str, kind: str | None, eds: Path | None, robot: Robot | None) -> Target:
        """Of the words of a command line. Raises CommandError for those that make no sense."""
        if kind is not None and kind not in TYPES:
            fail(f"there is no type {kind!r}, expected one of {', '.join(TYPES)}", WRONG_INPUT)
        drives = [drive for drive in robot.drives if drive.node_id == node] if robot else []
        ours = Path(str(files("canbase_config"))) / "eds" / "canbase_cia402.eds"
        try:
            eds_files = [read_eds(path) for path in (eds, ours) if path is not None]
            address = find_object(at, eds_files[:1] if eds else eds_files)
        except (ValueError, EdsError) as error:
            fail(str(error), WRONG_INPUT)
        known = known_object(address, eds_files, drives[0].kind if drives else None)
        entry = eds_files[0].objects.get((address.index, address.sub)) if eds else None
        return cls(node, address, kind or known.type, known.name, robot, entry)

    @property
    def by_eds(self) -> str:
        """Access and range of the manufacturer's EDS, in brackets; empty: unknown."""
        words = [] if self.entry is None else [word for word in (self.entry.access, limits(self.entry)) if word]
        return f" [{', '.join(words)}]" if words else ""

    def __str__(self) -> str:
        return f"node {self.node}, {self.at}{f' {self.name}' if self.name else ''}"


def run_read(bus: Bus, target: Target, timeout_s: float, *, raw: bool, ignore_eds: bool) -> None:
    """Reads and prints; exits with 1 when there is nothing to print, 2 where the EDS denies it."""
    _allowed_by_eds("" if ignore_eds else why_not_read(target.entry), target)
    with open_line(bus) as line:
        data = _transfer(line, target.node, read_object(target.at), _listen(line), timeout_s)
    if raw:
        print(decode(data, target.kind))
        return
    words = meaning(target.at, data)
    print(f"{target}: {show(data, target.kind)}{f': {words}' if words else ''}{target.by_eds}")


def run_write(bus: Bus, target: Target, value: str, timeout_s: float, *, force: bool, ignore_eds: bool) -> None:
    """Writes, reads back, and prints both; exits with 1 when it was not written, 2 for a value that does not fit."""
    if target.kind:
        _or_wrong_value(lambda: encode(value, target.kind))
    _allowed_by_eds("" if ignore_eds else why_not_write(target.entry, value, target.kind), target)
    with open_line(bus) as line:
        heard = _listen(line)
        if heard.driver_lives and not force:
            becomes = beside_driver(target.node, target.at, target.robot)
            fail(f"not written: canbase's driver runs on this bus. {becomes}. End it first, or --force", FAILED)
        status_at = status_places(target.node, target.robot)
        steps = write_object(target.at, value, target.kind, status_at, force=force)
        done = _transfer(line, target.node, steps, heard, timeout_s)
    if isinstance(done, Refused):
        fail(f"not written: {done.why}", FAILED)
    _tell(target, done, value)


def _allowed_by_eds(why: str, target: Target) -> None:
    if why:
        fail(f"{target}: {why}. Nothing was sent; --ignore-eds, if the EDS is wrong", WRONG_INPUT)


def _tell(target: Target, done: Written, value: str) -> None:
    before = "?" if done.before is None else show(done.before, target.kind)
    if done.after is None:
        print(f"{target}: written; it cannot be read back")
        return
    print(f"{target}: {before} → {show(done.after, target.kind)}")
    wanted = encode(value, target.kind or f"u{8 * len(done.after)}")
    if done.after.rstrip(b"\0") != wanted.rstrip(b"\0"):
        warn(f"it reads back a value other than {value}: the drive rounds it, or has it set elsewhere")


def _listen(line: BusSession) -> Listener:
    listening = ListenSession(LISTEN_S)
    line.run(listening)
    return listening.heard


def _transfer(line: BusSession, node: int, steps: Steps[T], heard: Listener, timeout_s: float) -> T:
    inquiry = SdoSession({node: steps}, heard, lambda node_id: SdoClient(node_id, timeout_s, ATTEMPTS))
    _or_wrong_value(lambda: line.run(inquiry))
    task = inquiry.tasks[node]
    if task.duplicates >= DUPLICATES:
        fail(twins_advice({node}), FAILED)
    if isinstance(task.error, SdoAborted):
        advice = ABORT_ADVICE.get(task.error.code, "")
        fail(f"{task.error}{f'; {advice}' if advice else ''}", FAILED)
    if isinstance(task.error, SdoTimeout):
        fail(f"{task.error}. {line.problem or _who_answers(line, node, heard)}", FAILED)
    if task.result is None:
        fail(f"another program uses the SDO channel of node {node} all the time (a driver that boots it?)", FAILED)
    return task.result


def _who_answers(line: BusSession, node: int, heard: Listener) -> str:
    """Why `node` may not answer: what it sends, and which others answer."""
    listened = heard.nodes.get(node)
    if listened is not None and not listened.sends_nothing:
        return f"It sends frames ({listened.state_text}): in NMT state stopped a node answers no SDO"
    question = Conversation(read(ALL, 0x1000, 0, SLOW_BITRATE, attempts=1))
    line.run(question)
    if question.result is None:
        return "Power, cable, node id? canbase bus scan shows who answers"
    nodes = ", ".join(map(str, question.result)) or "none"
    return f"Nodes that answer SDO: {nodes}. Power, cable, node id, bit rate? canbase bus scan shows more"


def _or_wrong_value(do: Callable[[], object]) -> None:
    try:
        do()
    except ValueError as error:
        fail(f"VALUE: {error}", WRONG_INPUT)
