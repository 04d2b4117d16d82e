"""`canbase bus scan`, active part: queries the identity of every node id by SDO reads (CiA 301, 1000h, 1018h).

Names and firmware (1008h, 100Ah) take segmented transfers and are read only where no other client uses the channel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.session import NodeTask
from canbase_driver.boot.steps import Steps, unsigned
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.sdo_client import Read, SdoAborted, SdoClient, SdoTimeout

STAGGER_S = 0.002
"""Between the first questions to two node ids: 127 of them at once would fill every transmit buffer."""
UNHEARD_ATTEMPTS, HEARD_ATTEMPTS = 1, 3
DUPLICATES = 2
"""After this many answers that came twice two drives have the node id; one may be an answer to another client."""


@dataclass(frozen=True, slots=True)
class NodeCard:
    """The identity of one node; None: it lacks the object. `profile_402`: 1000h names a motor drive."""

    node_id: int
    device_type: int | None
    vendor_id: int | None
    product_code: int | None
    revision: int | None
    serial: int | None
    heartbeat_ms: int | None
    name: str
    firmware: str

    @property
    def profile_402(self) -> bool:
        """Whether 1000h names a motor drive (CiA 402)."""
        return self.device_type is not None and self.device_type & 0xFFFF == 402


def identify(node_id: int, with_texts: bool, is_twice: Callable[[], bool]) -> Steps[NodeCard | bool]:
    """Reads the identity of one node; False: no node answers at this id.

    `is_twice`: whether an answer has come twice. Then two drives have this node id: their serial numbers differ, so on
    a real cable their answers would destroy each other. Serial number and texts are not read.
    """
    try:
        device_type = yield from _number(0x1000, 0)
    except SdoTimeout:
        return False
    vendor_id = yield from _number(0x1018, 1)
    product_code = yield from _number(0x1018, 2)
    revision = yield from _number(0x1018, 3)
    serial = None if is_twice() else (yield from _number(0x1018, 4))
    heartbeat_ms = yield from _number(0x1017, 0)
    texts = with_texts and not is_twice()
    name = (yield from _text(0x1008)) if texts else ""
    firmware = (yield from _text(0x100A)) if texts else ""
    return NodeCard(node_id, device_type, vendor_id, product_code, revision, serial, heartbeat_ms, name, firmware)


def _number(index: int, sub: int) -> Steps[int | None]:
    try:
        return unsigned((yield Read(index, sub)))
    except SdoAborted:
        return None


def _text(index: int) -> Steps[str]:
    try:
        data: bytes = yield Read(index)
    except (SdoAborted, SdoTimeout):
        return ""
    return data.decode("latin-1").strip(" \0")


class Identification:
    """Reads `node_ids`, with more tries where frames were received. `cards` has the nodes that answered, by node id."""

    def __init__(self, node_ids: Iterable[int], heard: Listener, timeout_s: float, *, with_texts: bool) -> None:
        self._node_ids = tuple(node_ids)
        self._heard = heard
        self._timeout_s = timeout_s
        self._with_texts = with_texts
        self._tasks: list[NodeTask[NodeCard | bool]] = []
        self._clients: dict[int, SdoClient] = {}
        self._pending: list[Frame] = []
        self.lost: dict[int, str] = {}
        """Nodes that were there and then failed, with the reason."""

    @property
    def done(self) -> bool:
        """Whether all have answered or not."""
        return bool(self._tasks) and all(task.done for task in self._tasks)

    @property
    def cards(self) -> dict[int, NodeCard]:
        """The nodes that answered."""
        return {task.node_id: task.result for task in self._tasks if isinstance(task.result, NodeCard)}

    @property
    def twins(self) -> frozenset[int]:
        """Node ids at which two drives or more answer."""
        return frozenset(n for n, client in self._clients.items() if client.duplicates >= DUPLICATES)

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame."""
        self._heard.on_frame(frame, now_s)
        for task in self._tasks:
            self._pending += task.on_frame(frame, now_s)

    def tick(self, now_s: float) -> list[Frame]:
        """The questions that are due."""
        if not self._tasks:
            self._tasks = [self._task(node_id, now_s + i * STAGGER_S) for i, node_id in enumerate(self._node_ids)]
        frames, self._pending = self._pending, []
        for task in self._tasks:
            frames += task.tick(now_s)
            if task.error is not None:
                self.lost[task.node_id] = str(task.error)
        return frames

    def _task(self, node_id: int, not_before: float) -> NodeTask[NodeCard | bool]:
        attempts = HEARD_ATTEMPTS if node_id in self._heard.nodes else UNHEARD_ATTEMPTS
        client = self._clients[node_id] = SdoClient(node_id, self._timeout_s, attempts)
        return NodeTask(
            identify(node_id, self._with_texts, lambda: client.duplicates > 0),
            client,
            not_before=not_before,
            free=lambda now_s: self._heard.sdo_free(node_id, now_s),
        )
