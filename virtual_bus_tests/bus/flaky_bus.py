"""python-can's virtual bus with faults on demand. The tests that use it put it in the place of "virtual"."""

from __future__ import annotations

from typing import Any, ClassVar

import can
from can.interfaces.virtual import VirtualBus


class FlakyBus(VirtualBus):
    """`broken`: sending, receiving and opening raise CanOperationError. `deaf`: sending alone does."""

    broken: ClassVar[bool] = False
    deaf: ClassVar[bool] = False

    def __init__(self, channel: Any = None, **arguments: Any) -> None:
        self.check()
        super().__init__(channel, **arguments)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """As VirtualBus. Raises CanOperationError while `broken` or `deaf`."""
        self.check()
        if FlakyBus.deaf:
            raise can.CanOperationError("transmit buffer full")
        super().send(msg, timeout)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self.check()
        return super()._recv_internal(timeout)

    @staticmethod
    def check() -> None:
        """Raises CanOperationError while `broken`."""
        if FlakyBus.broken:
            raise can.CanOperationError("network is down")
