"""What the driver's boot would set in a drive that has the saved parameters: its own steps, run against the file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.comparison import Difference
from canbase_commissioning.parameters.saved import Parameters
from canbase_commissioning.parameters.value_text import to_text
from canbase_config.drive import Drive
from canbase_config.eds_file import Eds
from canbase_config.object_map import CONTROLWORD, STATUSWORD, TARGET_VELOCITY, place
from canbase_config.robot import Robot
from canbase_driver.boot.sequence import boot
from canbase_driver.boot.steps import BootError, Step, WaitBootUp
from canbase_driver.cia301.sdo_client import NO_OBJECT, NO_SUB_INDEX, READ_ONLY, Read, SdoAborted, SdoError, Write

NO_POWER: Final = 0x0250
"""Statusword of SWITCH ON DISABLED (CiA 402-2): the boot finds nothing to stop."""
MOST_STEPS: Final = 10_000
_FIXED: Final = ("ro", "const")


@dataclass(frozen=True, slots=True)
class BootValues:
    """`written`: every object that the boot writes another value to. `problem`: why it would fail; empty: it would not.

    `notes`: what the boot would remark, as `canbase doctor` shows it.
    """

    written: tuple[Difference, ...]
    after: Parameters
    notes: tuple[str, ...]
    problem: str


def boot_values(saved: Parameters, eds: Eds, drives: tuple[Drive, ...], robot: Robot) -> BootValues:
    """Runs the boot of `drives`, the axes of one node, on the saved values."""
    node_id = drives[0].node_id
    paper = _PaperDrive(saved.for_node(node_id, eds), eds, node_id)
    for drive in drives:
        at = place(drive.kind, STATUSWORD, drive.axis)
        paper.values[Address(at.index, at.sub)] = NO_POWER.to_bytes(2, "little") * (at.bits // 16)
    before = dict(paper.values)
    notes, problem = _run(paper, drives, robot)
    ours = {(at.index, at.sub) for drive in drives for at in _commands(drive)}
    changed = [
        _difference(at, before, paper)
        for at in sorted(paper.written, key=lambda at: (at.index, at.sub))
        if paper.values[at] != before.get(at) and (at.index, at.sub) not in ours
    ]
    after = Parameters(node_id, paper.values, saved.refused, saved.identity, "what the boot sets")
    return BootValues(tuple(changed), after, notes, problem)


def _commands(drive: Drive) -> list[Address]:
    """What a driver that drives changes all the time."""
    places = (place(drive.kind, index, drive.axis) for index in (CONTROLWORD, TARGET_VELOCITY))
    return [Address(at.index, at.sub) for at in places]


def _difference(at: Address, before: dict[Address, bytes], paper: _PaperDrive) -> Difference:
    entry = paper.eds.objects.get((at.index, at.sub))
    kind, name = (entry.data_type, entry.name) if entry else (None, "")
    old = before.get(at)
    return Difference(at, name, None if old is None else to_text(old, kind), to_text(paper.values[at], kind))


class _PaperDrive:
    """Answers the boot's requests out of saved values, and keeps what is written."""

    def __init__(self, saved: Parameters, eds: Eds, node_id: int) -> None:
        self.values = dict(saved.values)
        self.written: set[Address] = set()
        self.eds, self._node_id = eds, node_id
        self._indexes = {at.index for at in saved.values}

    def answer(self, step: Step) -> bytes | bool | SdoError | None:
        """The drive's answer to one step."""
        if isinstance(step, Write):
            return self._write(step)
        if isinstance(step, Read):
            at = Address(step.index, step.sub)
            return self.values[at] if at in self.values else self._refusal(step)
        return True if isinstance(step, WaitBootUp) else None

    def _write(self, step: Write) -> bytes | SdoError:
        at = Address(step.index, step.sub)
        entry = self.eds.objects.get((at.index, at.sub))
        if at not in self.values and entry is None:
            return self._refusal(step)
        if entry is not None and entry.access in _FIXED:
            return SdoAborted(self._node_id, step, READ_ONLY)
        self.values[at] = step.data
        self.written.add(at)
        return b""

    def _refusal(self, step: Read | Write) -> SdoError:
        return SdoAborted(self._node_id, step, NO_SUB_INDEX if step.index in self._indexes else NO_OBJECT)


def _run(paper: _PaperDrive, drives: tuple[Drive, ...], robot: Robot) -> tuple[tuple[str, ...], str]:
    """Notes, and the problem that ends the boot."""
    steps = boot(drives[0].node_id, drives, robot)
    answer: bytes | bool | SdoError | None = None
    for _ in range(MOST_STEPS):
        try:
            step = steps.throw(answer) if isinstance(answer, SdoError) else steps.send(answer)
        except StopIteration as end:
            return end.value.notes, ""
        except BootError as error:
            return (), str(error)
        answer = paper.answer(step)
    return (), f"the boot does not end within {MOST_STEPS} steps"
