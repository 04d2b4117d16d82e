"""A ROS service that answers when the work is done, while the thread that took the request goes on with others.

rclpy answers when a callback returns, and cannot await inside a service of its events executor. Both of its executors
pass the response, with the header of its request, to `Service.send_response`: here that keeps them for later.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.service import Service


@dataclass(frozen=True, slots=True)
class Asked:
    """One request that waits for its answer."""

    request: Any
    response: Any
    """To be filled in before `answer`."""
    sent_s: float
    """When it was sent, by the system clock of its sender [s]; 0: unknown to the middleware."""
    answer: Callable[[], None]
    """Sends `response`, once, from the thread that spins the service."""


def answer_later(service: Service, on_request: Callable[[Asked], None]) -> None:
    """From now on `on_request` takes the requests of `service`. It must not wait; the answer may come at any time."""
    send = service.send_response
    requests: deque[Any] = deque()

    def take(request: Any, response: Any) -> Any:
        requests.append(request)
        return response

    def hand_over(response: Any, header: Any) -> None:
        sent_s = header.source_timestamp / 1e9
        on_request(Asked(requests.popleft(), response, sent_s, lambda: send(response, header)))

    service.callback = take
    service.send_response = hand_over  # type: ignore[method-assign]
