"""A small good robot.yaml with its line numbers, and how a test breaks single lines of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

GOOD = """\
bus:
  interface: virtual
  channel: test
  extra: {}
drives:
  - joint: left_wheel
    node_id: 1
    side: left
    gear_ratio: 20.0
    counts_per_motor_rev: 4096
  - joint: right_wheel
    node_id: 2
    side: right
    gear_ratio: 20.0
    counts_per_motor_rev: 4096
    velocity_unit: 0.1rpm
base:
  wheel_radius_m: 0.1
  track_m: 0.5
limits:
  linear_mps: 0.8
  angular_radps: 2.0
  acceleration_mps2: 0.8
  deceleration_mps2: 1.0
  emergency_deceleration_mps2: 2.0
  angular_acceleration_radps2: 4.0
  angular_deceleration_radps2: 5.0
safety:
  footprint: {front_m: 0.3, rear_m: 0.3, left_m: 0.3, right_m: 0.3}
  scan:
    required: false
  estop:
    required: false
lease:
  socket: /tmp/lease.sock
"""
LAST_LINE = 35


def write(folder: Path, changes: Mapping[int, str]) -> Path:
    """robot.yaml in `folder`: GOOD with the lines of these numbers replaced (by several, or by nothing if empty)."""
    lines = GOOD.splitlines()
    texts = [changes.get(number, line) for number, line in enumerate([*lines, ""], start=1)]
    file = folder / "robot.yaml"
    file.write_text("\n".join(text for text in texts if text) + "\n", encoding="utf-8")
    return file
