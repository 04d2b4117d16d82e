"""What the policy decides from: the bus, the leases and the watchdog itself at one moment, as plain values."""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.watchdog import WatchedDrive
from canbase_watchdog.envelope import Bounds
from canbase_watchdog.frames import DriveState, is_powered
from canbase_watchdog.lease import Lease
from canbase_watchdog.motion_evidence import Evidence
from canbase_watchdog.plausibility import Feedback
from canbase_watchdog.second_master import Sign
from canbase_watchdog.torque_evidence import TorqueEvidence

NEVER = -math.inf
"""Receive time of what has not come yet."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One wheel as the bus shows it. Speeds in m/s at its rim, forward positive; times monotonic in s.

    `target_mps` came last, at `command_at`; `setpoint_mps` is the one that a SYNC made effective, at `setpoint_at`.
    """

    drive: WatchedDrive
    state: DriveState | None = None
    status_at: float = NEVER
    enabled_since: float = NEVER
    disabled_since: float = NEVER
    velocity_mps: float = 0.0
    velocity_at: float = NEVER
    target_mps: float = 0.0
    asks_for_power: bool = False
    command_at: float = NEVER
    setpoint_mps: float = 0.0
    setpoint_at: float = NEVER
    feedback: Feedback = Feedback()  # noqa: RUF009 - immutable
    evidence: Evidence = Evidence()  # noqa: RUF009 - immutable
    fed_at: float = NEVER
    """When the older one of its TPDOs came: status and velocity. What somebody reads by SDO is not fed."""
    standing: bool = False
    """Its encoder and its velocity show that the wheel is at standstill: standstill.py."""
    position_at: float = NEVER
    missed_setpoints: float = 0.0
    """SYNCs without a setpoint while it was enabled, less half of those with one."""
    double_answers: float = 0.0
    """SYNCs that were answered twice while it was enabled, less half of the others."""
    torque: TorqueEvidence = TorqueEvidence()  # noqa: RUF009 - immutable
    sudden: bool = False
    """It stopped as no wheel can, by its last values: standstill.py."""
    unproven: bool = False
    """The same, for some samples."""
    copied_at: float = NEVER
    """When the last one of its status TPDOs came that has the data of the one just before it: copies.py."""

    @property
    def enabled(self) -> bool:
        """True when its last statusword was OPERATION ENABLED."""
        return self.state is DriveState.OPERATION_ENABLED

    @property
    def powered(self) -> bool:
        """True when its last statusword was a state in which the motor has current."""
        return is_powered(self.state)

    @property
    def trusted(self) -> bool:
        """False when its sensor was found to show no motion, or a wrong one: no standstill is proven by it.

        Operation enabled, motion_evidence.py distinguishes a wheel that met something hard from a dead sensor.
        """
        return self.evidence.trusted and (self.enabled or not self.unproven)

    @property
    def seen_at(self) -> float:
        """When statusword, position and velocity were all known, by a TPDO or from an answer to an SDO."""
        status_or_velocity_at = min(self.status_at, self.velocity_at)
        return min(status_or_velocity_at, self.position_at)


@dataclass(frozen=True, slots=True)
class Node:
    """One drive on the bus: when its last heartbeat and its last frame of any kind came."""

    node_id: int
    heartbeat_at: float = NEVER
    last_frame_at: float = NEVER
    boot_up_at: float = NEVER
    """When a boot-up came from it although it had just reported that it was enabled."""
    configured_at: float = NEVER
    """When a client last used its SDO for anything but its motion: a boot or a tool."""
    operational: bool = False
    """Its last heartbeat said NMT operational: a driver has configured it, and may have given it power."""


@dataclass(frozen=True, slots=True)
class BusView:
    """What came over the bus. `sync_since`: start of the present run of SYNCs without a gap."""

    axes: tuple[Axis, ...]
    nodes: tuple[Node, ...]
    driver_at: float = NEVER
    sync_at: float = NEVER
    sync_since: float = NEVER
    foreign: Sign | None = None


@dataclass(frozen=True, slots=True)
class View:
    """All that the policy decides from."""

    bus: BusView
    bounds: Bounds
    started_at: float
    lease: Lease | None = None
    lease_at: float = NEVER
    skew: str = ""
    """Why the setpoints of both sides do not go together, for two SYNCs in a row; empty when they do."""
    twist: str = ""
    """Why the base has not moved as ordered for `twist_s`; empty when it has."""
    setpoint_at_rest: str = ""
    """Which wheel is ordered to turn, and for how long, while no lease allows it; empty: none."""
    tick_gap_s: float = 0.0
    bus_failed_since: float = math.inf
    ramp_to_zero: str = ""
    """Which wheel's setpoint does not fall while nothing but zero is leased, for two SYNCs in a row; empty: all do."""

    @property
    def axes(self) -> tuple[Axis, ...]:
        """All wheels."""
        return self.bus.axes

    @property
    def enabled(self) -> bool:
        """True when any drive is enabled."""
        return any(axis.enabled for axis in self.bus.axes)

    def node(self, node_id: int) -> Node:
        """The node with this id. Raises StopIteration for one that is not configured."""
        for node in self.bus.nodes:
            if node.node_id == node_id:
                return node
        raise StopIteration(node_id)
