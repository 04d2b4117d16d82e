"""Quality of service of the topics of mux and filter."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data

COMMAND = QoSProfile(depth=1)
"""Velocities and the emergency stop: only the newest counts."""
STATE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Latched: who comes late sees the newest state."""
EVENT = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Latched, as the motor driver's on the same topic: who comes late sees why the robot was stopped."""
SCAN = qos_profile_sensor_data
"""Best effort: it fits every scanner's publisher, reliable or not."""
