"""The simulated drives as members of the bus: each node hears and sends for itself, and the world moves under them."""

from __future__ import annotations

from functools import partial

from campaign.can_bus import CanBus
from canbase_bench.axis_parts import StateChange
from canbase_bench.node import SimulatedNode
from canbase_bench.world.bench import Bench
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID, Robot

POLL_S = 0.005
"""How often the drives look at their own timers: heartbeats, and heartbeats that are missing."""
HEARTBEATS = {0x700 + DRIVER_NODE_ID: "driver", 0x700 + WATCHDOG_NODE_ID: "watchdog"}


class Drives:
    """`bench` is the simulated world. `heard`: when each node last heard the heartbeat of driver and watchdog."""

    def __init__(self, robot: Robot, bus: CanBus) -> None:
        self._bus, self._clock = bus, bus.clock
        self.bench = Bench(robot, bus.clock.now)
        self._members = {
            node_id: bus.join(f"drive{node_id}", partial(self._hear, node_id, node))
            for node_id, node in self.bench.nodes.items()
        }
        self._urgent = {0x000, 0x080}
        for node_id in self.bench.nodes:
            self._urgent |= {0x500 + node_id, 0x600 + node_id}
        self.heard = dict.fromkeys(self.bench.nodes, bus.clock.now)
        self.moved_at = bus.clock.now
        self._answers = False
        self._poll()

    def changes(self) -> list[StateChange]:
        """Transitions of all axes since the last call."""
        return self.bench.state_changes()

    def _hear(self, node_id: int, node: SimulatedNode, cob_id: int, data: bytes) -> None:
        """What acts at once, or samples, needs the world as it is now; all else may be some milliseconds early."""
        if cob_id in self._urgent:
            if self.moved_at < self._clock.now:
                self._say()
            node.on_frame(cob_id, data, self._clock.now)
            if not self._answers:
                self._answers = True
                self._clock.after(0.0, self._answer)
            return
        node.on_frame(cob_id, data, self._clock.now)
        if cob_id in HEARTBEATS and not node.line.cut:
            self.heard[node_id] = self._clock.now

    def _answer(self) -> None:
        """All nodes have heard the frame."""
        self._answers = False
        self._say()

    def _say(self) -> None:
        self.moved_at = self._clock.now
        for frame in self.bench.tick(self._clock.now):
            self._members[frame.cob_id & 0x7F].send(frame.cob_id, frame.data)

    def _poll(self) -> None:
        """While SYNCs come they move the world often enough."""
        if self.moved_at < self._clock.now - POLL_S:
            self._say()
        self._clock.after(POLL_S, self._poll)
