"""What the bus says, per axis and node: the last values and when they came. No judgement here: that is policy.py.

Ages count from the local monotonic receive time. A frame that cannot be understood is counted and changes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from canbase_config.watchdog import WatchdogConfig, WatchedDrive
from canbase_watchdog import frames
from canbase_watchdog.frames import DriveState
from canbase_watchdog.lease import Lease

NEVER = -math.inf
"""Receive time of what has not come yet."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One wheel as the bus shows it. Speeds in m/s at its rim, forward positive; times monotonic in s."""

    drive: WatchedDrive
    state: DriveState | None = None
    status_at: float = NEVER
    enabled_since: float = NEVER
    velocity_mps: float = 0.0
    velocity_at: float = NEVER
    target_mps: float = 0.0
    asks_for_power: bool = False
    command_at: float = NEVER

    @property
    def enabled(self) -> bool:
        """True when its last statusword said OPERATION ENABLED."""
        return self.state is DriveState.OPERATION_ENABLED

    @property
    def powered(self) -> bool:
        """True when its last statusword said a state in which the motor has current."""
        return self.state in _POWERED

    @property
    def fed_at(self) -> float:
        """When both statusword and velocity were last known."""
        return min(self.status_at, self.velocity_at)


_POWERED = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE)


@dataclass(frozen=True, slots=True)
class Node:
    """One drive on the bus: when its last heartbeat and its last frame of any kind came."""

    node_id: int
    heartbeat_at: float = NEVER
    heard_at: float = NEVER


@dataclass(frozen=True, slots=True)
class View:
    """All that the policy decides from. `sync_since`: start of the present run of SYNCs without a gap."""

    axes: tuple[Axis, ...]
    nodes: tuple[Node, ...]
    started_at: float
    driver_at: float = NEVER
    sync_at: float = NEVER
    sync_since: float = NEVER
    lease: Lease | None = None
    lease_at: float = NEVER
    tick_gap_s: float = 0.0

    def node(self, node_id: int) -> Node:
        """The node with this id. Raises StopIteration for one that is not configured."""
        return next(node for node in self.nodes if node.node_id == node_id)


class Observer:
    """Keeps the last values of everything on the bus that concerns the configured drives."""

    def __init__(self, config: WatchdogConfig) -> None:
        """Listens for the drives in `config`; the lower axis number of a node uses the PDOs of its first axis."""
        self._gap_s = config.feedback_timeout_s
        self._axes = {(drive.node_id, drive.axis): Axis(drive) for drive in config.drives}
        self._nodes = {node_id: Node(node_id) for node_id, _ in self._axes}
        self._driver_at = self._sync_at = self._sync_since = NEVER
        self._routes: dict[int, Callable[[bytes, float], bool]] = {}
        self.dropped = 0
        """Frames with a watched identifier that could not be understood."""
        self._add_routes()

    def on_frame(self, cob_id: int, data: bytes, now: float) -> None:
        """Take in one received frame. Never raises for what is on the bus."""
        route = self._routes.get(cob_id)
        if route is not None and not route(data, now):
            self.dropped += 1

    def view(self, started_at: float, lease: Lease | None, lease_at: float, tick_gap_s: float) -> View:
        """Everything as it stands, with what the caller knows of leases and of its own loop."""
        return View(
            tuple(self._axes.values()),
            tuple(self._nodes.values()),
            started_at,
            self._driver_at,
            self._sync_at,
            self._sync_since,
            lease,
            lease_at,
            tick_gap_s,
        )

    def _add_routes(self) -> None:
        self._routes[frames.SYNC] = self._on_sync
        self._routes[frames.DRIVER_HEARTBEAT] = self._on_driver_heartbeat
        for node_id in self._nodes:
            self._routes[frames.HEARTBEAT + node_id] = partial(self._on_heartbeat, node_id)
            self._routes[frames.SDO_ANSWER + node_id] = partial(self._on_sdo, node_id)
            for place, key in enumerate(sorted(key for key in self._axes if key[0] == node_id)):
                self._add_axis_routes(place, key)

    def _add_axis_routes(self, place: int, key: tuple[int, int]) -> None:
        node_id = key[0]
        self._routes[frames.STATUS_TPDO[place] + node_id] = partial(self._on_status, key)
        self._routes[frames.VELOCITY_TPDO[place] + node_id] = partial(self._on_velocity, key)
        self._routes[frames.SETPOINT_RPDO[place] + node_id] = partial(self._on_setpoint, key)

    def _on_sync(self, data: bytes, now: float) -> bool:
        if len(data) > 1:
            return False
        if now >= self._sync_at + self._gap_s:
            self._sync_since = now
        self._sync_at = now
        return True

    def _on_driver_heartbeat(self, data: bytes, now: float) -> bool:
        if len(data) != 1:
            return False
        self._driver_at = now
        return True

    def _on_heartbeat(self, node_id: int, data: bytes, now: float) -> bool:
        if len(data) != 1:
            return False
        self._nodes[node_id] = Node(node_id, heartbeat_at=now, heard_at=now)
        return True

    def _on_status(self, key: tuple[int, int], data: bytes, now: float) -> bool:
        statusword = frames.decode_status(data)
        return statusword is not None and self._note_state(key, statusword, now)

    def _note_state(self, key: tuple[int, int], statusword: int, now: float) -> bool:
        state = frames.decode_state(statusword)
        if state is None:
            return False
        axis = self._axes[key]
        newly = state is DriveState.OPERATION_ENABLED and not axis.enabled
        since = now if newly else axis.enabled_since
        self._axes[key] = replace(axis, state=state, status_at=now, enabled_since=since)
        self._hear(key[0], now)
        return True

    def _on_velocity(self, key: tuple[int, int], data: bytes, now: float) -> bool:
        bits = frames.decode_velocity(data)
        return bits is not None and self._note_velocity(key, bits, now)

    def _note_velocity(self, key: tuple[int, int], bits: int, now: float) -> bool:
        axis = self._axes[key]
        self._axes[key] = replace(axis, velocity_mps=bits * axis.drive.mps_per_bit, velocity_at=now)
        self._hear(key[0], now)
        return True

    def _on_setpoint(self, key: tuple[int, int], data: bytes, now: float) -> bool:
        setpoint = frames.decode_setpoint(data)
        if setpoint is None:
            return False
        word, bits = setpoint
        axis = self._axes[key]
        target_mps = bits * axis.drive.mps_per_bit
        power = frames.asks_for_power(word)
        self._axes[key] = replace(axis, target_mps=target_mps, asks_for_power=power, command_at=now)
        return True

    def _on_sdo(self, node_id: int, data: bytes, now: float) -> bool:
        """Answers to anybody's reading of 6041h and 606Ch are as true as a TPDO; all others are not for us."""
        self._hear(node_id, now)
        answer = frames.decode_sdo(data)
        for key in self._axes:
            offset = key[1] * frames.AXIS_OFFSET
            if answer is None or key[0] != node_id:
                continue
            if answer[0] == frames.STATUSWORD + offset:
                return self._note_state(key, answer[1], now)
            if answer[0] == frames.VELOCITY + offset:
                return self._note_velocity(key, answer[1], now)
        return True

    def _hear(self, node_id: int, now: float) -> None:
        self._nodes[node_id] = replace(self._nodes[node_id], heard_at=now)
