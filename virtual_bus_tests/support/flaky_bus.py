"""python-can's virtual bus with faults on demand. The tests that use it put it in the place of "virtual"."""

from __future__ import annotations

from typing import Any, ClassVar

import can
from can.interfaces.virtual import VirtualBus


class FlakyBus(VirtualBus):
    """`broken`: sending, receiving and opening raise an error. `deaf`: sending alone does. `down`: all but opening.

    `error`: what they raise: a class and its arguments. `timeouts`: those that frames were sent with [s].
    """

    broken: ClassVar[bool] = False
    deaf: ClassVar[bool] = False
    down: ClassVar[bool] = False
    error: ClassVar[Exception] = can.CanOperationError("network is down")
    timeouts: ClassVar[set[float | None]] = set()

    def __init__(self, channel: Any = None, **arguments: Any) -> None:
        if FlakyBus.broken:
            raise FlakyBus.error
        super().__init__(channel, **arguments)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """As VirtualBus. Raises CanOperationError while `broken` or `deaf`."""
        self.check()
        FlakyBus.timeouts.add(timeout)
        if FlakyBus.deaf:
            raise can.CanOperationError("transmit buffer full")
        super().send(msg, timeout)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self.check()
        return super()._recv_internal(timeout)

    @staticmethod
    def check() -> None:
        """Raises `error` while `broken` or `down`."""
        if FlakyBus.broken or FlakyBus.down:
            raise FlakyBus.error

    @staticmethod
    def heal() -> None:
        """As new."""
        FlakyBus.broken = FlakyBus.deaf = FlakyBus.down = False
        FlakyBus.error = can.CanOperationError("network is down")
        FlakyBus.timeouts = set()
