"""Bytes that are no message: one place takes messages and reads them, and there they are dropped and counted."""

from __future__ import annotations

import ast
import contextlib
import random
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import serialize_message

from canbase_runtime.message_reader import MOST_AT_ONCE, MessageReader

ROOT = Path(__file__).parents[3]
PRODUCT = ("action_server", "cli", "commissioning", "deploy", "doctor", "driver", "fleet", "qualification", "recording",
           "runtime", "velocity_mux", "watchdog", "web")  # fmt: skip
READS = {"take_message", "deserialize_message"}
READER = "runtime/canbase_runtime/message_reader.py"
BAD, EMPTY = object(), None


def subscription(*queue: Any) -> Any:
    """Its handle gives what is in the queue; BAD cannot be read."""
    waiting = list(queue)

    def take_message(kind: type, raw: bool) -> Any:
        taken = waiting.pop(0) if waiting else EMPTY
        if taken is BAD:
            raise rclpy_implementation.RCLError("failed to take message: invalid data")
        return taken and (taken, {"received_timestamp": 1})

    class Handle(contextlib.nullcontext[None]):
        def take_message(self, kind: type, raw: bool) -> Any:
            return take_message(kind, raw)

    return SimpleNamespace(handle=Handle(), msg_type=Odometry, raw=False)


def readers(source: str) -> Iterator[str]:
    """Every use of a name that reads messages, whatever it is called on."""
    for node in ast.walk(ast.parse(source)):
        name = getattr(node, "attr", getattr(node, "id", getattr(node, "name", "")))
        if name in READS:
            yield str(name)


def test_a_message_that_cannot_be_read_hides_none_behind_it() -> None:
    reader, queue = MessageReader(), subscription("first", BAD, BAD, "second")
    assert [reader.take(queue) for _ in range(3)] == ["first", "second", None]
    assert reader.dropped == 2


def test_the_times_of_the_middleware_come_with_it() -> None:
    reader = MessageReader()
    assert reader.take_with_times(subscription(BAD, "first")) == ("first", {"received_timestamp": 1})


def test_a_stranger_that_publishes_without_end_holds_nobody_up() -> None:
    reader = MessageReader()
    assert reader.take(subscription(*[BAD] * (MOST_AT_ONCE + 1), "last")) is None
    assert reader.dropped == MOST_AT_ONCE


def test_another_error_is_none_of_the_message() -> None:
    with pytest.raises(AttributeError):
        MessageReader().take(SimpleNamespace(handle=contextlib.nullcontext(), msg_type=Odometry, raw=False))


def test_mutated_bytes_are_a_message_or_dropped() -> None:
    draw, good, reader, read = random.Random(7), serialize_message(Odometry()), MessageReader(), 0
    assert isinstance(reader.read(good, Odometry), Odometry)
    assert reader.dropped == 0
    for _ in range(500):
        data = bytearray(good[: draw.randrange(len(good) + 1)])
        if len(data) > 12:
            at = draw.randrange(len(data) - 3)
            data[at : at + 4] = draw.choice((b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff", b"\0\0\0\1"))
        read += reader.read(bytes(data), Odometry) is not None
    assert reader.dropped == 500 - read
    assert read < 400


def test_nothing_else_takes_or_reads_messages() -> None:
    files = [file for folder in PRODUCT for file in sorted((ROOT / folder).rglob("*.py"))]
    assert len(files) > 400
    found = {str(file.relative_to(ROOT)) for file in files if list(readers(file.read_text("utf-8")))}
    assert found == {READER}


@pytest.mark.parametrize(
    "source",
    [
        "from rclpy.serialization import deserialize_message",
        "message = rclpy.serialization.deserialize_message(data, Odometry)",
        "taken = subscription.handle.take_message(Odometry, False)",
    ],
)
def test_another_place_that_does_is_found(source: str) -> None:
    assert list(readers(source))
