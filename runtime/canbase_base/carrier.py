"""Whether a CAN interface has a carrier: a controller that is bus-off has none.

The kernel takes what is sent on such an interface, drops it, and reports no error. It reports bus-off once, by an
error frame at that moment: a process that opens the interface later receives no report (linux: can_bus_off, net/sched
noop_qdisc).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

INTERFACES = Path("/sys/class/net")


def is_without_carrier(arguments: Mapping[str, Any], interfaces: Path = INTERFACES) -> bool:
    """Whether the kernel reports it of the interface of a bus with these arguments of `can.Bus`.

    False where the kernel reports nothing: without SocketCAN; and while the interface is down, when sending fails.
    """
    if arguments.get("interface") != "socketcan":
        return False
    try:
        return (interfaces / str(arguments.get("channel")) / "carrier").read_text("ascii").strip() == "0"
    except OSError:
        return False
