"""Where parameters come from: a drive on the bus with a progress bar, a file, or the boot of a robot.yaml."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.object_dictionary import ABORT_ADVICE
from canbase_commissioning.onbus.bus_session import BusSession
from canbase_commissioning.parameters.reading import Progress, objects_to_read, read_all
from canbase_commissioning.parameters.saved import Parameters
from canbase_commissioning.sdo_session import SdoSession
from canbase_commissioning.session import NodeTask
from canbase_config.eds_file import Eds, EdsObject
from canbase_driver.boot.steps import Steps
from canbase_driver.cia301.sdo_block import BlockSdoClient
from canbase_driver.cia301.sdo_client import SdoAborted, SdoTimeout
from canbase_runtime.terminal import FAILED, fail, with_cursor

T = TypeVar("T")
ATTEMPTS: Final = 3


@contextmanager
def bar(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar on a terminal; elsewhere nothing is printed. Yields what takes the number that is done."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Bar(
        *columns, console=Console(file=with_cursor(sys.stderr)), disable=not sys.stderr.isatty(), transient=True
    ) as shown:
        task = shown.add_task(what, total=total)
        yield lambda done: shown.update(task, completed=done)


def sdo_session(
    node: int, steps: Steps[T], heard: Listener, timeout_s: float, attempts: int = ATTEMPTS
) -> SdoSession[T]:
    """SDO transfers with one node, long objects by block transfer."""
    return SdoSession({node: steps}, heard, lambda node_id: BlockSdoClient(node_id, timeout_s, attempts))


def read_drive(
    line: BusSession, heard: Listener, node: int, eds: Eds, timeout_s: float, only: Sequence[EdsObject] | None = None
) -> Parameters:
    """All objects of the EDS, or some of them. Exits with 1 when the drive does not answer."""
    entries = objects_to_read(eds) if only is None else only
    progress = Progress(len(entries))
    session = sdo_session(node, read_all(node, eds, entries, progress), heard, timeout_s)
    with bar(f"node {node}", progress.total) as show:
        while not session.done:
            line.turn(session)
            show(progress.done)
    return result_of(session.tasks[node], line)


def result_of(task: NodeTask[T], line: BusSession) -> T:
    """What came of the transfers; exits with 1 where nothing did."""
    if isinstance(task.error, SdoTimeout):
        fail(f"{task.error}. {line.problem or 'Power, cable, node id? canbase bus scan shows who answers'}", FAILED)
    if isinstance(task.error, SdoAborted):
        fail(f"{task.error}; {ABORT_ADVICE.get(task.error.code, 'see the manual of the drive')}", FAILED)
    if task.result is None:
        fail(f"another program uses the SDO channel of node {task.node_id} all the time", FAILED)
    return task.result
