"""The simulated drives as members of the bus: each node receives and sends for itself, and the world moves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType

from canbase_campaign.can_bus import NOTHING, REMOTE, CanBus, Receiver
from canbase_campaign.clock import FINE, Pace
from canbase_campaign.robots import DrawnRobot
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID
from canbase_sim.axis_parts import StateChange
from canbase_sim.cia402.axis import Axis
from canbase_sim.node import SimulatedNode
from canbase_sim.odd.draw import OddDrive
from canbase_sim.world.bench import Bench, BenchParameters

HEARTBEATS = {0x700 + DRIVER_NODE_ID: "driver", 0x700 + WATCHDOG_NODE_ID: "watchdog"}
GUARD = 0x700
ROLLS_SHARE = 0.02
"""Of its greatest force: less neither brakes nor drives a wheel."""


class _Port(Receiver):
    """One node's end of the bus."""

    def __init__(self, drives: Drives, node_id: int, node: SimulatedNode) -> None:
        self._drives, self._node_id, self._node = drives, node_id, node

    def hear(self, cob_id: int, data: bytes) -> None:
        self._drives.hear(self._node_id, self._node, cob_id, data)


class Drives:
    """`bench` is the simulated world. `heard`: when each node last received the heartbeat of driver and watchdog."""

    def __init__(
        self, drawn: DrawnRobot, bus: CanBus, pace: Pace = FINE, odd: Mapping[int, OddDrive] = MappingProxyType({})
    ) -> None:
        """`odd`: drives of the kind `odd`, by node id."""
        self._bus, self._clock, self._poll_s = bus, bus.clock, pace.drives_poll_s
        self._robot = drawn.robot
        bandwidth_radps = min(drawn.body.bandwidth_radps, pace.bandwidth_radps)
        body = replace(drawn.body, step_s=pace.plant_step_s, bandwidth_radps=bandwidth_radps)
        self.bench = Bench(drawn.robot, bus.clock.now_s, body, BenchParameters(sdo_delay_s=pace.sdo_delay_s), odd)
        self.bench.base.push_n = drawn.push_n
        self.friction_n = max(0.0, len(drawn.robot.drives) * drawn.body.coulomb_n - abs(drawn.push_n))
        """What is left of the wheels' dry friction on this slope [N]."""
        self.measured: Callable[[int, bytes], bytes] = lambda cob_id, data: data
        """What becomes of a drive's frame before it is sent: sensors with noise."""
        self._members = {
            node_id: bus.join(f"drive{node_id}", _Port(self, node_id, node))
            for node_id, node in self.bench.nodes.items()
        }
        urgent = {0x000, 0x080} | {first + node_id for node_id in self.bench.nodes for first in (0x500, 0x600)}
        self._urgent = [cob_id in urgent for cob_id in range(NOTHING)]
        """By identifier: the world moves before the frame is taken."""
        self.heard = dict.fromkeys(self.bench.nodes, bus.clock.now_s)
        self.guarded = dict.fromkeys(self.bench.nodes, bus.clock.now_s)
        """When each node was last requested to report its state."""
        self.ordered = dict.fromkeys(self.bench.nodes, bus.clock.now_s)
        """When each node last received a setpoint of its own."""
        axes = [self.axis(wheel) for wheel in range(len(drawn.robot.drives))]
        pairs = list(zip(drawn.robot.drives, axes, strict=True))
        self.sides = tuple(tuple(axis for drive, axis in pairs if drive.side == side) for side in ("left", "right"))
        """The axes of each side, whose wheels turn together."""
        self.moved_at = bus.clock.now_s
        self._answers = False
        self._poll()

    @staticmethod
    def rolls(axis: Axis) -> bool:
        """Its wheel rolls: the motor has no power, or no coupling, or its drive sees no motion of a dead encoder."""
        motor = axis.motor
        if axis.uncoupled:
            return True
        blind = not axis.encoder.closes_loop and abs(motor.force_n) <= ROLLS_SHARE * motor.peak_force_n
        return blind or not motor.powered

    @staticmethod
    def roll(axes: Iterable[Axis]) -> bool:
        """All of them do."""
        for axis in axes:  # noqa: SIM110 - every step
            if not Drives.rolls(axis):
                return False
        return True

    def place(self, wheel: int) -> tuple[int, int]:
        """Node id and axis of a wheel, counted in the order of robot.yaml, and round again."""
        drive = self._robot.drives[wheel % len(self._robot.drives)]
        return drive.node_id, drive.axis

    def axis(self, wheel: int) -> Axis:
        """The axis of a wheel."""
        node_id, axis = self.place(wheel)
        return self.bench.nodes[node_id].axes[axis]

    def node(self, wheel: int) -> SimulatedNode:
        """The node of a wheel."""
        return self.bench.nodes[self.place(wheel)[0]]

    def changes(self) -> list[StateChange]:
        """Transitions of all axes since the last call."""
        return self.bench.state_changes()

    def hear(self, node_id: int, node: SimulatedNode, cob_id: int, data: bytes) -> None:
        """A frame for a node. What acts at once, or samples, needs the world of now; all else may be a little early."""
        if self._urgent[cob_id]:
            if self.moved_at < self._clock.now_s:
                self._say()
            node.on_frame(cob_id, data, self._clock.now_s)
            if not self._answers:
                self._answers = True
                self._clock.after(0.0, self._answer)
            return
        now_s = self._clock.now_s
        if cob_id >= REMOTE:
            self._request(node_id, node, cob_id & ~REMOTE)
        elif node.takes(cob_id):
            node.on_frame(cob_id, data, now_s)
            if cob_id in HEARTBEATS and node.line.hears:
                self.heard[node_id] = now_s
        if cob_id & 0x7F == node_id and 0x200 <= cob_id < 0x500 and not cob_id & 0x80:
            self.ordered[node_id] = now_s

    def _request(self, node_id: int, node: SimulatedNode, cob_id: int) -> None:
        """Node guarding: its answer does not wait for the world."""
        node.on_request(cob_id, self._clock.now_s)
        if cob_id == GUARD + node_id and node.line.hears:
            self.guarded[node_id] = self._clock.now_s
            if not self._answers:
                self._answers = True
                self._clock.after(0.0, self._answer)

    def _answer(self) -> None:
        """All nodes have received the frame."""
        self._answers = False
        self._say()

    def _say(self) -> None:
        self.moved_at = self._clock.now_s
        for frame in self.bench.tick(self._clock.now_s):
            self._members[frame.cob_id & 0x7F].send(frame.cob_id, self.measured(frame.cob_id, frame.data))

    def _poll(self) -> None:
        """While SYNCs come they move the world often enough."""
        if self.moved_at < self._clock.now_s - self._poll_s:
            self._say()
        self._clock.after(self._poll_s, self._poll)
