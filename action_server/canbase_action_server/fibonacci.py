"""An action without a robot, to learn actions with: what the sequence is, and when a goal is refused or cannot go on.

Pure. The server is in fibonacci_node.py, the client in fibonacci_client.py.
"""

from __future__ import annotations

MAX_ORDER = 1000
LARGEST = 2**31 - 1
"""The interface carries int32."""


def refusal(order: int) -> str | None:
    """Why a goal of this order is rejected; None: it is accepted."""
    return None if 1 <= order <= MAX_ORDER else f"order is {order}, outside 1 to {MAX_ORDER}"


def next_number(sequence: list[int]) -> int | None:
    """What follows; None: it does not fit into the interface."""
    number = sequence[-1] + sequence[-2]
    return number if number <= LARGEST else None
