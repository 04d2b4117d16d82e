"""How a tool uses the bus: a session is given frames and the time, and returns frames, until it is done. No bus.

Putting a session on a real bus is `bus_line.py` of the command line.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from canbase_driver.boot.steps import BootError, Pause, Steps
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.sdo_client import Read, SdoClient, SdoError, Write

T = TypeVar("T")
ECHO_S = 0.1
"""A multicast bus gives a frame back to its sender within this time."""


class Session(Protocol):
    """One conversation with the bus. `now_s` is monotonic [s]."""

    @property
    def done(self) -> bool:
        """Whether it has ended."""

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame that somebody else has sent."""

    def tick(self, now_s: float) -> list[Frame]:
        """Let time pass, at least every 10 ms; what to send, in order."""


class Echo:
    """Distinguishes our own frames that come back (udp_multicast does that) from those of others."""

    def __init__(self) -> None:
        self._sent: deque[tuple[float, Frame]] = deque()

    def sent(self, frame: Frame, now_s: float) -> None:
        """This frame went out."""
        self._sent.append((now_s, frame))

    def is_own(self, frame: Frame, now_s: float) -> bool:
        """Whether a received frame is ours. Each one sent comes back once, so a second one is somebody else's."""
        while self._sent and now_s - self._sent[0][0] > ECHO_S:
            self._sent.popleft()
        for i, (_, own) in enumerate(self._sent):
            if own == frame:
                del self._sent[i]
                return True
        return False


def always(_now: float) -> bool:
    """No other client uses the SDO channel."""
    return True


class NodeTask(Generic[T]):
    """Runs a sequence of SDO transfers with one node. It has ended when `result` or `error` is set.

    `not_before`: monotonic time [s] of the first request. `free`: whether the SDO channel is ours at a time; a request
    waits until it is, `patience_s` at most: then the task ends with `blocked`.
    """

    def __init__(
        self,
        steps: Steps[T],
        client: SdoClient,
        *,
        gap_s: float = 0.0,
        not_before: float = 0.0,
        free: Callable[[float], bool] = always,
        patience_s: float = 5.0,
    ) -> None:
        self.node_id = client.node_id
        self.result: T | None = None
        self.error: SdoError | BootError | None = None
        self.blocked = False
        self._steps, self._client = steps, client
        self._gap_s, self._free, self._patience_s = gap_s, free, patience_s
        self._next: Read | Write | None = None
        self._wake_at, self._waits_since = not_before, 0.0
        self._has_begun = False

    @property
    def done(self) -> bool:
        """Whether it has ended, well or not."""
        return self.result is not None or self.error is not None or self.blocked

    @property
    def duplicates(self) -> int:
        """Requests that were sent once and answered twice: two drives may have this node id."""
        return self._client.duplicates

    def on_frame(self, frame: Frame, now_s: float) -> list[Frame]:
        """Take a frame from the bus; what to send at once."""
        if self.done:
            return []
        if not self._client.busy:
            return self._client.on_frame(frame, now_s)  # it counts second answers
        frames = self._client.on_frame(frame, now_s)
        self._take_answer(now_s)
        return frames

    def tick(self, now_s: float) -> list[Frame]:
        """Let time pass; what to send."""
        if self.done:
            return []
        if self._client.busy:
            frames = self._client.tick(now_s)
            self._take_answer(now_s)
            return frames
        if now_s < self._wake_at:
            return []
        if not self._has_begun or self._next is None:
            self._has_begun = True
            self._advance(None, now_s)
        return self._ask(now_s)

    def _ask(self, now_s: float) -> list[Frame]:
        if self._next is None or self.done or now_s < self._wake_at:
            return []
        if not self._free(now_s):
            self.blocked = now_s - self._waits_since > self._patience_s
            return []
        step, self._next = self._next, None
        return [self._client.start(step, now_s)]

    def _take_answer(self, now_s: float) -> None:
        if self._client.busy:
            return
        try:
            answer = self._client.answer()
        except SdoError as error:
            self._advance(error, now_s)
        else:
            self._advance(answer, now_s)

    def _advance(self, answer: bytes | SdoError | None, now_s: float) -> None:
        try:
            step = self._steps.throw(answer) if isinstance(answer, SdoError) else self._steps.send(answer)
        except StopIteration as end:
            self.result = end.value
            return
        except (SdoError, BootError) as error:
            self.error = error
            return
        self._waits_since = now_s
        self._wake_at = now_s + self._gap_s
        if isinstance(step, Read | Write):
            self._next = step
        elif isinstance(step, Pause):
            self._wake_at = now_s + step.duration_s
        else:
            raise TypeError(f"{step} has no place in a task of SDO transfers")
