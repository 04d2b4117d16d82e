"""The notes of a black box, as they stand between its frames. `canbase explain` reads them. Pure.

What a part reports is `printable` already: one line, bounded.
"""

from __future__ import annotations

from canbase_driver.causes import DriverCause
from canbase_driver.snapshot import DriverSnapshot

SAID_BY_THE_STATE = (DriverCause.NONE, DriverCause.BOOTING, DriverCause.ENABLING)


def title(stopped_by: str, cause: str, detail: str) -> str:
    """What the recording was written for: its first line."""
    return f"stop by {stopped_by}: {cause} ({detail})"


def command_note(linear_mps: float, angular_radps: float) -> str:
    """A command on cmd_vel."""
    return f"cmd_vel {_twist(linear_mps, angular_radps)}"


def filter_note(cause: str, detail: str, linear_mps: float, angular_radps: float, lease: int) -> str:
    """The state of the safety filter, what it orders, and the number of its last lease."""
    said = f"safety_filter {cause} {detail}".rstrip()
    return f"{said}; orders {_twist(linear_mps, angular_radps)}, lease {lease}"


def mux_note(active: str, detail: str) -> str:
    """The source that the mux follows, empty: none; and why not the others."""
    return f"velocity_mux {active or 'no source'}; {detail}"


def driver_note(text: str) -> str:
    """A sentence of motor_driver: `state_text`, or a problem at boot."""
    return f"motor_driver {text}"


def state_text(snapshot: DriverSnapshot) -> str:
    """The driver's state, its cause and what ends it; for the log too."""
    finding = snapshot.finding
    why = f": {finding.cause.value}" if finding.cause not in SAID_BY_THE_STATE else ""
    detail = f" ({finding.detail})" if finding.detail else ""
    clears = f"; ends with: {finding.clears_on}" if finding.clears_on else ""
    return f"{snapshot.state.name}{why}{detail}{clears}"


def _twist(linear_mps: float, angular_radps: float) -> str:
    return f"{linear_mps:.4f} m/s {angular_radps:.4f} rad/s"
