"""can_msgs/msg/Frame and std_msgs/msg/String in CDR: frames and notes of a recording in an MCAP file. Pure.

Both have one layout as long as their frame id is empty, so a struct is all that is needed, here and where the file is
read again: neither needs ROS. Sources: can_msgs/msg/Frame.msg of ros_canopen; CDR, little endian (OMG DDSI-RTPS).
"""

from __future__ import annotations

import struct
from typing import Final

FRAME_TYPE, TEXT_TYPE = "can_msgs/msg/Frame", "std_msgs/msg/String"
FRAMES_TOPIC, NOTES_TOPIC = "/can_frames", "/recording_notes"
FRAME_DEFINITION: Final = """std_msgs/Header header
uint32 id
bool is_rtr
bool is_extended
bool is_error
uint8 dlc
uint8[8] data
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
TEXT_DEFINITION: Final = "string data\n"
SENT: Final = b"t"
"""A frame id of one character has the length of none with its padding: frames that the recorder sent have this one."""
_FRAME: Final = struct.Struct("<4siII2s2xI???B8s")
_LITTLE_ENDIAN: Final = b"\x00\x01\x00\x00"


def pack_frame(at_ns: int, can_id: int, data: bytes, *, sent: bool, remote: bool, extended: bool, error: bool) -> bytes:
    """One message. At most eight bytes of `data` are kept."""
    seconds, nanoseconds = divmod(at_ns, 1_000_000_000)
    frame_id = SENT + b"\0" if sent else b"\0\0"
    length = 2 if sent else 1
    kept = data[:8]
    return _FRAME.pack(
        _LITTLE_ENDIAN, seconds, nanoseconds, length, frame_id, can_id, remote, extended, error, len(kept), kept
    )


def unpack_frame(message: bytes) -> tuple[int, bytes, bool, bool, bool, bool]:
    """Identifier, data, sent, remote, extended, error. Raises ValueError for a message of another layout."""
    if len(message) != _FRAME.size or message[:2] != _LITTLE_ENDIAN[:2]:
        raise ValueError(
            f"a frame of {len(message)} bytes, expected {_FRAME.size}: its frame id is not that of canbase"
        )
    _, _, _, length, _, can_id, remote, extended, error, dlc, data = _FRAME.unpack(message)
    if length > 2 or dlc > 8:
        raise ValueError(f"a frame with {dlc} bytes and a frame id of {length}: not of canbase record export")
    return can_id, data[:dlc], length == 2, remote, extended, error


def pack_text(text: str) -> bytes:
    """A std_msgs/msg/String."""
    data = text.encode() + b"\0"
    return _LITTLE_ENDIAN + struct.pack("<I", len(data)) + data


def unpack_text(message: bytes) -> str:
    """Its text. Raises ValueError for anything else."""
    if len(message) < 9 or message[:2] != _LITTLE_ENDIAN[:2]:
        raise ValueError(f"a text of {len(message)} bytes")
    length = int.from_bytes(message[4:8], "little")
    if len(message) < 8 + length:
        raise ValueError(f"a text of {length} bytes in {len(message)}")
    return message[8 : 7 + length].decode(errors="replace")
