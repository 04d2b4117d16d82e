"""One or several SDO tasks as a session that shares the bus: it listens, and keeps off a channel that others use."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.session import NodeTask
from canbase_driver.boot.steps import Steps
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.sdo_client import SdoClient

T = TypeVar("T")


class SdoSession(Generic[T]):
    """Runs one sequence of transfers on each of some nodes at once. `tasks` has what came of them, by node id."""

    def __init__(
        self,
        steps: Mapping[int, Steps[T]],
        heard: Listener,
        client: Callable[[int], SdoClient],
        *,
        gap_s: float = 0.0,
    ) -> None:
        self._heard = heard
        self._pending: list[Frame] = []
        self.tasks = {node_id: self._task(each, client(node_id), gap_s) for node_id, each in steps.items()}

    @property
    def done(self) -> bool:
        """Whether all have ended."""
        return all(task.done for task in self.tasks.values())

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame."""
        self._heard.on_frame(frame, now_s)
        for task in self.tasks.values():
            self._pending += task.on_frame(frame, now_s)

    def tick(self, now_s: float) -> list[Frame]:
        """What is to be sent."""
        frames, self._pending = self._pending, []
        for task in self.tasks.values():
            frames += task.tick(now_s)
        return frames

    def _task(self, steps: Steps[T], client: SdoClient, gap_s: float) -> NodeTask[T]:
        return NodeTask(steps, client, gap_s=gap_s, free=lambda now_s: self._heard.sdo_free(client.node_id, now_s))
