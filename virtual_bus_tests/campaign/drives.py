"""The simulated drives as members of the bus: each node hears and sends for itself, and the world moves under them."""

from __future__ import annotations

from functools import partial

from campaign.can_bus import CanBus
from campaign.clock import FINE, Pace
from canbase_bench.axis_parts import StateChange
from canbase_bench.node import SimulatedNode
from canbase_bench.plant.base import PlantParameters
from canbase_bench.world.bench import Bench, BenchParameters
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID, Robot

HEARTBEATS = {0x700 + DRIVER_NODE_ID: "driver", 0x700 + WATCHDOG_NODE_ID: "watchdog"}


class Drives:
    """`bench` is the simulated world. `heard`: when each node last heard the heartbeat of driver and watchdog."""

    def __init__(self, robot: Robot, bus: CanBus, pace: Pace = FINE) -> None:
        self._bus, self._clock, self._poll_s = bus, bus.clock, pace.drives_poll_s
        body = PlantParameters(step_s=pace.plant_step_s, bandwidth_radps=pace.bandwidth_radps)
        self.bench = Bench(robot, bus.clock.now, body, BenchParameters(sdo_delay_s=pace.sdo_delay_s))
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
        if self.moved_at < self._clock.now - self._poll_s:
            self._say()
        self._clock.after(self._poll_s, self._poll)
