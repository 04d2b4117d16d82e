"""What the watchdog sees in ordinary driving, and with one thing changed. For the tests of the policy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from canbase_watchdog.envelope import Bounds
from canbase_watchdog.frames import DriveState
from canbase_watchdog.lease import Lease
from canbase_watchdog.policy import decide
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.view import Axis, BusView, Node, View
from support.watchdog_story import config

CONFIG = config()
NOW = 100.0
LEFT = Axis(
    CONFIG.drives[0],
    state=DriveState.OPERATION_ENABLED,
    status_at=99.99,
    enabled_since=90.0,
    velocity_mps=0.3,
    velocity_at=99.99,
    target_mps=0.3,
    asks_for_power=True,
    command_at=99.99,
    fed_at=99.99,
    position_at=99.99,
)
RIGHT = replace(LEFT, drive=CONFIG.drives[1])
WELL = View(
    bus=BusView(
        axes=(LEFT, RIGHT),
        nodes=(Node(1, 99.95, 99.99), Node(2, 99.95, 99.99)),
        driver_at=99.95,
        sync_at=99.99,
        sync_since=90.0,
    ),
    bounds=Bounds(0.0, 0.3, 0.0, 0.0),
    started_at=80.0,
    lease=Lease(1, 99_990_000_000, 0.3, 0.0, 0),
    lease_at=99.99,
)
OFF = replace(
    LEFT, state=DriveState.SWITCH_ON_DISABLED, velocity_mps=0.0, target_mps=0.0, asks_for_power=False, standing=True
)
AT_REST = replace(LEFT, velocity_mps=0.0, target_mps=0.0, standing=True)
STANDING = replace(RIGHT, velocity_mps=0.0, target_mps=0.0, standing=True)
ON_THE_BUS = ("nodes", "driver_at", "sync_at", "sync_since", "foreign")


def well(**changes: Any) -> View:
    """Ordinary driving, but for these values."""
    bus = {name: changes.pop(name) for name in ON_THE_BUS if name in changes}
    return replace(WELL, bus=replace(WELL.bus, **bus), **changes)


def of(left: Axis, right: Axis | None = None, **changes: Any) -> View:
    """These wheels; the right one stands, and is enabled like the left one by default."""
    like_left = replace(STANDING, state=left.state, enabled_since=left.enabled_since)
    view = well(**changes)
    return replace(view, bus=replace(view.bus, axes=(left, right or like_left)))


def cause(view: View) -> TripCause:
    return decide(view, CONFIG, NOW).cause
