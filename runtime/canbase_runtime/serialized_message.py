"""A ROS message that is published often and of which only numbers change, kept as bytes.

rclpy makes a Python object of each nested message, checks each field, and converts all of it field by field: 0.3 ms for
an Odometry, with its 72 covariances. Here rclpy serializes the message once; after that only the numbers are written.
"""

from __future__ import annotations

import array
import struct
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from rclpy.serialization import serialize_message

_MARK = bytes.fromhex("d3 71 b9 4e a5 68 9c 3b")
"""A number that no message has: its bytes show where a field lies."""


class SerializedMessage:
    """The bytes of a message. `Publisher.publish` takes them as it takes the message."""

    def __init__(self, message: Any, *fields: str) -> None:
        """`message`: with all that does not change, such as names and the lengths of sequences.

        `fields`: dotted names of those that change, such as `pose.pose.position.x`: each a float64, an int32 or uint32
        (those of a stamp), or an array or sequence of float64 with at least one element. Raises ValueError for
        anything else, for two names of one place, and for a field whose place is not certain.
        """
        places = []
        first = 0
        for name in fields:
            count, form = _form(message, name)
            places.append((_offset(message, name, form), form * count, slice(first, first + count)))
            first += count
        if len({offset for offset, _, _ in places}) != len(places):
            raise ValueError(f"two of the fields are one: {', '.join(fields)}")
        self._count = first
        self._places = [(offset, struct.Struct(f"={form}"), part) for offset, form, part in places]
        self._bytes = bytearray(serialize_message(message))

    def pack(self, *values: float) -> bytes:
        """With these numbers: those of the first field, then those of the next. Raises ValueError for a wrong count,
        struct.error for what is no number."""
        if len(values) != self._count:
            raise ValueError(f"{len(values)} numbers for {self._count}")
        for offset, form, part in self._places:
            form.pack_into(self._bytes, offset, *values[part])
        return bytes(self._bytes)


def _owner(message: Any, name: str) -> tuple[Any, str]:
    *path, last = name.split(".")
    for part in path:
        message = message[int(part)] if part.isdigit() else getattr(message, part)
    return message, last


def _form(message: Any, name: str) -> tuple[int, str]:
    """How many numbers it has, and the format of one of them, for `struct`."""
    owner, last = _owner(message, name)
    value, kind = getattr(owner, last), owner.get_fields_and_field_types()[last]
    if kind in ("double", "int32", "uint32"):
        return 1, {"double": "d", "int32": "i", "uint32": "I"}[kind]
    if kind.startswith(("double[", "sequence<double")) and len(value) > 0:
        return len(value), "d"
    raise ValueError(f"{name} is {kind} with {value!r}: no number, and no array of numbers")


def _offset(message: Any, name: str, form: str) -> int:
    """Where the first byte of the field lies in the serialized message: where the mark appears when it is put there.

    A byte that differs is not enough: what pads a string to its place has any value.
    """
    owner, last = _owner(message, name)
    kept, size = getattr(owner, last), struct.calcsize(f"={form}")
    mark = _MARK[:size]
    (number,) = struct.unpack(f"={form}", mark)
    before = bytes(serialize_message(message))
    setattr(owner, last, number if isinstance(kept, int | float) else _with_first(kept, number))
    after = bytes(serialize_message(message))
    setattr(owner, last, kept)
    places = [at for at in range(len(after)) if after[at : at + size] == mark != before[at : at + size]]
    if len(places) != 1:
        raise ValueError(f"{name} lies at {places} of the serialized message: not at one place")
    return places[0]


def _with_first(values: Any, number: float) -> Any:
    changed = array.array("d", values)
    changed[0] = number
    return changed


class SerializedTwist:
    """A velocity command (geometry_msgs/TwistStamped) in one frame."""

    def __init__(self, frame_id: str) -> None:
        """`frame_id`: of the base (REP 105: base_link)."""
        message = TwistStamped()
        message.header.frame_id = frame_id
        fields = ("header.stamp.sec", "header.stamp.nanosec", "twist.linear.x", "twist.angular.z")
        self._message = SerializedMessage(message, *fields)

    def pack(self, linear_mps: float, angular_radps: float, stamp: Time) -> bytes:
        """This velocity, forward and to the left, at this time."""
        return self._message.pack(stamp.sec, stamp.nanosec, linear_mps, angular_radps)
