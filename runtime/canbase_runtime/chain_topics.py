"""The topics of the chain that belong to one node: who publishes there, and of what type. One table.

Rule. A ROS message does not contain its publisher, so a topic with a second publisher (a recording that is replayed, a
robot without namespace, a leftover process) has no known sender. velocity_mux finds that publisher in the ROS graph.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

STAMPED: Final = "geometry_msgs/msg/TwistStamped"


class Use(Enum):
    """What a message on the topic does."""

    VELOCITY = "moves the base"
    SHOWN = "is displayed; the command itself stays in the process"
    STATE = "a goal depends on it"


@dataclass(frozen=True, slots=True)
class ChainTopic:
    """One topic (relative name), the node that owns it, and its message type."""

    topic: str
    node: str
    type: str
    use: Use


ODOM: Final = ChainTopic("odom", "motor_driver", "nav_msgs/msg/Odometry", Use.STATE)
DRIVER_STATUS: Final = ChainTopic("motor_driver/status", "motor_driver", "canbase/msg/DriverStatus", Use.STATE)
SAFETY_STATE: Final = ChainTopic("safety_filter/state", "safety_filter", "canbase/msg/SafetyState", Use.STATE)
MUX_STATE: Final = ChainTopic("velocity_mux/state", "velocity_mux", "canbase/msg/MuxState", Use.STATE)

CHAIN: Final = (
    ChainTopic("cmd_vel_mux", "velocity_mux", STAMPED, Use.SHOWN),
    ChainTopic("cmd_vel", "safety_filter", STAMPED, Use.VELOCITY),
    ODOM,
    DRIVER_STATUS,
    SAFETY_STATE,
    MUX_STATE,
)
