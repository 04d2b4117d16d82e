"""A CAN interface as `ip -details -statistics -json link show` reports it (iproute2, SocketCAN). Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from canbase_driver.supervision.bus_health import ControllerState

COUNTERS = ("bus_error", "error_warning", "error_passive", "bus_off", "restarts")
"""Of the CAN controller since the interface was set up."""
_STATES: dict[object, ControllerState] = {
    "ERROR-ACTIVE": ControllerState.ERROR_ACTIVE,
    "ERROR-WARNING": ControllerState.ERROR_WARNING,
    "ERROR-PASSIVE": ControllerState.ERROR_PASSIVE,
    "BUS-OFF": ControllerState.BUS_OFF,
    "STOPPED": ControllerState.STOPPED,
    "SLEEPING": ControllerState.SLEEPING,
}
"""The words of iproute2 (iplink_can.c)."""


@dataclass(frozen=True, slots=True)
class Link:
    """One interface. `kind`: can, vcan, …; `bitrate` [bit/s] and `restart_ms` 0: none is set."""

    name: str
    kind: str
    is_up: bool
    bitrate: int = 0
    state: ControllerState = ControllerState.UNKNOWN
    send_errors: int = 0
    receive_errors: int = 0
    """The controller's two counters, 0 to 256."""
    restart_ms: int = 0
    queue_length: int = 0
    counters: Mapping[str, int] = field(default_factory=dict)


def parse_link(text: str) -> Link | None:
    """The first interface in the output of ip; None when there is none in it."""
    try:
        found = json.loads(text)
    except ValueError:
        return None
    links = (
        [entry for entry in found if isinstance(entry, dict) and "ifname" in entry] if isinstance(found, list) else []
    )
    return _link(links[0]) if links else None


def _link(entry: dict[str, Any]) -> Link:
    info = entry.get("linkinfo", {})
    data, statistics = info.get("info_data", {}), info.get("info_xstats", {})
    errors = data.get("berr_counter", {})
    return Link(
        name=entry["ifname"],
        kind=info.get("info_kind", entry.get("link_type", "")),
        is_up="UP" in entry.get("flags", ()),
        bitrate=data.get("bittiming", {}).get("bitrate", 0),
        state=_STATES.get(data.get("state"), ControllerState.UNKNOWN),
        send_errors=errors.get("tx", 0),
        receive_errors=errors.get("rx", 0),
        restart_ms=data.get("restart_ms", 0),
        queue_length=entry.get("txqlen", 0),
        counters={name: statistics[name] for name in COUNTERS if name in statistics},
    )
