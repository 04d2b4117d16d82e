"""The values of the black box's events: of states that the driver has and receives. Texts of others are printable."""

from __future__ import annotations

from typing import Any

from canbase.msg import MuxState, SafetyState

from canbase_driver.snapshot import DriverSnapshot
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable

MOST_NAMED = 32
"""Sources and locks of one message that are kept."""


def filter_values(message: SafetyState) -> dict[str, Any]:
    """Of safety_filter/state, by the names of its fields; its scanners and clearances are left out."""
    return {
        "action": message.action,
        "cause": printable(message.cause),
        "detail": printable(message.detail, SENTENCE_LENGTH),
        "clears_on": printable(message.clears_on, SENTENCE_LENGTH),
        "estop": message.estop,
        "emergency": message.emergency,
        "ordered_linear_mps": message.ordered_linear_mps,
        "ordered_angular_radps": message.ordered_angular_radps,
        "lease_sequence": message.lease_sequence,
        "lease_errors": message.lease_errors,
    }


def mux_values(message: MuxState) -> dict[str, Any]:
    """Of velocity_mux/state: the active source, how each source stands, and the locks that hold."""
    return {
        "active": printable(message.active),
        "ready": message.ready,
        "not_ready": printable(message.not_ready, SENTENCE_LENGTH),
        "standing": {printable(source.name): source.standing for source in message.sources[:MOST_NAMED]},
        "locks": [printable(lock.name) for lock in message.locks[:MOST_NAMED] if lock.holds],
    }


def driver_values(snapshot: DriverSnapshot) -> dict[str, Any]:
    """State and finding of the driver."""
    finding = snapshot.finding
    return {
        "state": snapshot.state.name,
        "cause": finding.cause.value,
        "detail": finding.detail,
        "clears_on": finding.clears_on,
    }
