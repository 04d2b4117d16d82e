"""Messages that no executor delivers: the only place that takes them from a subscription or reads their bytes.

Every node may publish any bytes on any topic. What is no message is dropped and counted, and ends nothing.
"""

from __future__ import annotations

from typing import Any, Final, TypeVar

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import deserialize_message

T = TypeVar("T")
MOST_AT_ONCE: Final = 50
"""Messages that cannot be read, in one `take`: a stranger could publish without end."""
_UNREADABLE: Final = (rclpy_implementation.RCLError, rclpy_implementation.RMWError, UnicodeDecodeError)


class MessageReader:
    """`dropped`: how many messages could not be read."""

    def __init__(self) -> None:
        self.dropped = 0

    def take(self, subscription: Any) -> Any:
        """The oldest message that waits and can be read, bytes if the subscription is raw; None: none does."""
        taken = self.take_with_times(subscription)
        return None if taken is None else taken[0]

    def take_with_times(self, subscription: Any) -> tuple[Any, Any] | None:
        """As `take`, with what the middleware knows of the message: a mapping with its times."""
        for _ in range(MOST_AT_ONCE):
            try:
                with subscription.handle:
                    taken: tuple[Any, Any] | None = subscription.handle.take_message(
                        subscription.msg_type, subscription.raw
                    )
            except _UNREADABLE:
                self.dropped += 1
                continue
            return taken
        return None

    def read(self, serialized: bytes, kind: type[T]) -> T | None:
        """The message of a raw subscription; None: these bytes are none of that type."""
        try:
            message: T = deserialize_message(serialized, kind)
        except _UNREADABLE:
            self.dropped += 1
            return None
        return message
