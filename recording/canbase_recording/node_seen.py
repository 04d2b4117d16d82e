"""A node and its CiA 402 axes, as far as the frames of a recording show them. Pure."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_config.object_map import TARGET_VELOCITY, VELOCITY_ACTUAL
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia402 import Command, DriveState
from canbase_recording.beat import Beat

MOVES_SHARE: Final = 0.05
"""Of the greatest speed so far: less is noise, or creeping."""


@dataclass(slots=True)
class AxisSeen:
    """One CiA 402 axis. `state` None: no statusword came; `command` None: no controlword came."""

    state: DriveState | None = None
    command: Command | None = None
    target: int = 0
    velocity: int = 0
    peak: int = 0
    """The greatest number of both so far: what is a motion without knowing the unit."""
    halted_s: float = -math.inf
    """When canbase's watchdog last sent it its quick stop or disable voltage."""

    def on_speed(self, base: int, value: int) -> None:
        """60FFh or 606Ch; other objects say nothing about its motion."""
        if base == TARGET_VELOCITY:
            self.target = value
        elif base == VELOCITY_ACTUAL:
            self.velocity = value
        else:
            return
        self.peak = max(self.peak, abs(value))

    @property
    def is_enabled(self) -> bool:
        """It reports operation enabled."""
        return self.state is DriveState.OPERATION_ENABLED

    @property
    def moves(self) -> bool:
        """Motion is ordered or measured."""
        return max(abs(self.target), abs(self.velocity)) > MOVES_SHARE * self.peak


@dataclass(slots=True)
class NodeSeen:
    """One node, as far as its frames show it."""

    node_id: int
    frames: int = 0
    first_s: float = math.nan
    last_s: float = math.nan
    nmt: NmtState | None = None
    ordered: str = ""
    """The NMT command that it got after it last reported its state; empty: none."""
    polled_s: float = -math.inf
    """When a remote frame last asked for its state (node guarding)."""
    heartbeat: Beat = field(default_factory=Beat)
    guarded: bool = False
    """It answers node guarding."""
    boot_ups: int = 0
    emergencies: Counter[int] = field(default_factory=Counter)
    aborts: Counter[tuple[Address, int]] = field(default_factory=Counter)
    axes: dict[int, AxisSeen] = field(default_factory=dict)
    is_assumed: bool = False
    """Something of its axes was read by the default mapping of CiA 402, which is assumed."""
    identity: dict[int, int] = field(default_factory=dict)
    """1018h by sub-index, where the recording shows it being read."""

    def axis(self, number: int) -> AxisSeen:
        """One of its axes, from now on."""
        return self.axes.setdefault(number, AxisSeen())

    @property
    def owes_heartbeat(self) -> bool:
        """It sends by itself, or the last request of a recording that shows them is not answered."""
        return not self.guarded or self.polled_s > self.heartbeat.last_s or math.isinf(self.polled_s)

    @property
    def is_enabled(self) -> bool:
        """One of its axes reports operation enabled."""
        return any(axis.is_enabled for axis in self.axes.values())
