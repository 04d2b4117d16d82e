"""The row of `canbase doctor` about `canbase serve metrics`: a process that a robot may have, and does not need."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from canbase_doctor.check import Check, ok, warn
from canbase_doctor.evidence import Evidence

NODE: Final = "canbase_metrics"
"""Name of its node."""
READS: Final = "motor_driver/status"
UNITS: Final = Path("/etc/systemd/system")


def enabled_unit(config: Path, name: str, units: Path = UNITS) -> str:
    """The unit that starts it with the robot; empty: none. `config`: robot.yaml, whose installed name is its stem, or
    else `name`, that of the robot."""
    for robot in (config.stem, name):
        unit = f"canbase-metrics@{robot}.service"
        if (units / f"canbase@{robot}.target.wants" / unit).is_symlink():
            return unit
    return ""


def metrics(evidence: Evidence) -> list[Check]:
    """Whether it runs. No row where it does not and its unit is not enabled: it is optional."""
    unit = evidence.metrics_unit
    nodes = [each.node for each in evidence.subscribers.get(READS, ()) if each.node.endswith(f"/{NODE}")]
    if len(nodes) > 1:
        return [warn(NODE, f"runs {len(nodes)} times and each serves the same", "end all but one")]
    if nodes:
        return [ok(NODE, f"{nodes[0]} runs" + (f", by {unit}" if unit else ""))]
    if unit:
        found = f"{unit} is enabled, and no node {NODE} reads {READS}: nothing can be scraped"
        return [warn(NODE, found, f"systemctl status {unit}; the robot itself needs it for nothing")]
    return []
