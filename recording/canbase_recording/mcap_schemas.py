"""The topics of a recording in an MCAP file: name, ROS type, and its definition in the form of `ros2msg`. Pure.

Sources: can_msgs/msg/Frame.msg of ros_canopen, common_interfaces and rcl_interfaces of Jazzy;
mcap.dev/spec/registry, "ros2msg": the definition, then each contained type once, between lines of `=`.
"""

from __future__ import annotations

from typing import Final

FRAMES_TOPIC, NOTES_TOPIC = "/can_frames", "/recording_notes"
JOINTS_TOPIC, ORDERED_TOPIC, COMMAND_TOPIC, LOG_TOPIC = "/joint_states", "/joint_states_ordered", "/cmd_vel", "/rosout"
SENT: Final = "t"
"""The frame_id of a frame that the recorder sent."""
_CONTAINED: Final = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
}
_FIELDS: Final = {
    "can_msgs/msg/Frame": "std_msgs/Header header\nuint32 id\nbool is_rtr\nbool is_extended\nbool is_error\nuint8 dlc\n"
    "uint8[8] data",
    "std_msgs/msg/String": "string data",
    "sensor_msgs/msg/JointState": "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    "float64[] effort",
    "geometry_msgs/msg/TwistStamped": "std_msgs/Header header\ngeometry_msgs/Twist twist",
    "rcl_interfaces/msg/Log": "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n"
    "string function\nuint32 line",
}
FRAME, TEXT, JOINTS, COMMAND, LOG = _FIELDS
TYPES: Final = {
    FRAMES_TOPIC: FRAME, NOTES_TOPIC: TEXT, JOINTS_TOPIC: JOINTS, ORDERED_TOPIC: JOINTS, COMMAND_TOPIC: COMMAND,
    LOG_TOPIC: LOG,
}  # fmt: skip


def definition(type_name: str) -> str:
    """Of one of these types, whole."""
    parts, known = [_FIELDS[type_name]], list[str]()
    for part in parts:  # grows on the way
        for name in (line.split()[0] for line in part.splitlines()):
            if name in _CONTAINED and name not in known:
                known.append(name)
                parts.append(f"{'=' * 80}\nMSG: {name}\n{_CONTAINED[name]}")
    return "\n".join(parts)
