"""The bench: the simulated drives of one robot.yaml and the robot on them, stepped together. Pure.

Works in virtual time (call `on_frame` and `tick` with any rising `now_s`) and in real time (`loop.py` does).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

from canbase_config.drive import Drive
from canbase_config.robot import Robot
from canbase_sim.axis_parts import AxisParts, StateChange
from canbase_sim.cia301.dictionary import AXIS_STRIDE, key
from canbase_sim.cia305.bit_timing import FACTORY_BITRATE, FACTORY_NODE_ID
from canbase_sim.cia402.raw_units import Scale
from canbase_sim.frame import Frame
from canbase_sim.node import SimulatedNode
from canbase_sim.odd.draw import OddDrive
from canbase_sim.odd.odd_node import OddNode
from canbase_sim.personality import GENERIC, PERSONALITIES, Personality
from canbase_sim.plant.base import Base, MountedWheel, PlantParameters
from canbase_sim.plant.battery import Battery

DEFAULT_BODY = PlantParameters()
"""An empty robot of 30 kg on dry floor."""


@dataclass(frozen=True, slots=True)
class BenchParameters:
    """Properties of the drives that robot.yaml does not have."""

    boot_delay_s: float = 0.1
    """From power on to the boot-up message [s]."""
    sdo_delay_s: float = 0.001
    """From an SDO request to its answer [s]. Below 1 ms: an STM32 with CANopenNode; 30 ms: Lenze 9400 (its manual)."""
    encoder_offset: int = 123_456
    """6064h at the start; each further axis is at a multiple of it."""
    factory_fresh: bool = False
    """Every drive has node id 1 and 125 kbit/s, as many makers deliver them."""


@dataclass(frozen=True, slots=True)
class Truth:
    """What the robot really does. Pose in the frame where it started (REP 103), rim speeds forward positive."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    linear_mps: float
    angular_radps: float
    v_left_mps: float
    v_right_mps: float
    travel_m: float
    """Signed way of the base's centre, forward positive."""
    path_m: float
    """Way of the base's centre, backward counted positive too."""
    standing_s: float
    """Since a rim last moved faster than base.standstill_mps."""


class Bench:
    """Simulated nodes, axes and body of `robot`. `nodes` and `base` are open to tests and faults.

    `nodes` is by the node ids of robot.yaml, whatever id LSS has given the node meanwhile.
    """

    def __init__(
        self,
        robot: Robot,
        now_s: float = 0.0,
        body: PlantParameters = DEFAULT_BODY,
        parameters: BenchParameters | None = None,
        odd: Mapping[int, OddDrive] = MappingProxyType({}),
    ) -> None:
        """`odd`: drives of the kind `odd`, by node id."""
        self._robot, self._odd, self._parameters = robot, odd, parameters or BenchParameters()
        self._start, self._steps, self._h = now_s, 0, body.step_s
        self._motors = [body.motor(len(robot.drives)) for _ in robot.drives]
        self.battery = Battery(self._motors)
        self.base = Base(
            body,
            robot.base.track_m,
            robot.base.standstill_mps,
            left=self._wheels("left"),
            right=self._wheels("right"),
            now_s=now_s,
        )
        node_ids = sorted({drive.node_id for drive in robot.drives})
        self.nodes = {node_id: self._node(node_id, now_s) for node_id in node_ids}
        self._all_nodes = tuple(self.nodes.values())

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """A frame from the bus: the world moves up to `now_s`, then every node receives it."""
        self._advance(now_s)
        for node in self._all_nodes:
            if frame.remote:
                node.on_request(frame.cob_id, now_s)
            else:
                node.on_frame(frame.cob_id, frame.data, now_s)

    def tick(self, now_s: float) -> list[Frame]:
        """The world moves up to `now_s`; the frames that the nodes send, in order."""
        self._advance(now_s)
        return [frame for node in self._all_nodes for frame in node.tick(now_s)]

    def tick_rated(self, now_s: float) -> list[tuple[int, Frame]]:
        """As `tick`; each frame with the bit rate of its node [bit/s]. A node that is changing it sends none."""
        self._advance(now_s)
        sent = [(node.bitrate, frame) for node in self._all_nodes for frame in node.tick(now_s)]
        return [(bitrate, frame) for bitrate, frame in sent if bitrate]

    def truth(self, now_s: float) -> Truth:
        """The state of the world at `now_s`."""
        self._advance(now_s)
        b = self.base
        return Truth(
            now_s,
            b.x_m,
            b.y_m,
            b.yaw_rad,
            b.v_mps,
            b.w_radps,
            b.v_left_mps,
            b.v_right_mps,
            b.travel_m,
            b.path_m,
            max(0.0, now_s - b.time_of_motion),
        )

    def state_changes(self) -> list[StateChange]:
        """The transitions of all axes since the last call."""
        changes = [change for node in self._all_nodes for change in node.changes]
        for node in self._all_nodes:
            node.changes.clear()
        return changes

    def lost_heartbeats(self) -> list[tuple[int, int]]:
        """Each heartbeat that a node has missed since the last call: the node, and the watched one (node ids; 0: the
        master that guarded it)."""
        lost = [(node.node_id, producer) for node in self._all_nodes for producer in node.lost_producers]
        for node in self._all_nodes:
            node.lost_producers.clear()
        return lost

    def _advance(self, now_s: float) -> None:
        """Inner steps lie on a fixed grid from the start, so the result does not depend on when one looks."""
        target = int((now_s - self._start) / self._h + 1e-6)
        base, h, start = self.base, self._h, self._start
        while self._steps < target:
            if base.resting and not base.push_n and all(motor.at_rest for motor in self._motors):
                self._steps = target
                return
            self._steps += 1
            base.step(start + self._steps * h)

    def _wheels(self, side: str) -> list[MountedWheel]:
        pairs = zip(self._motors, self._robot.drives, strict=True)
        return [MountedWheel(motor, drive.direction) for motor, drive in pairs if drive.side == side]

    def _node(self, node_id: int, now_s: float) -> SimulatedNode:
        mounted = {d.axis: i for i, d in enumerate(self._robot.drives) if d.node_id == node_id}
        parts = [self._axis(mounted.get(axis)) for axis in range(max(mounted) + 1)]
        personality = _personality(self._robot.drives[next(iter(mounted.values()))])
        fixed = {key(0x1018, 4): node_id}
        for axis, i in mounted.items():
            drive = self._robot.drives[i]
            fixed[key(0x608F + axis * AXIS_STRIDE, 1)] = drive.counts_per_motor_rev
            fixed |= _identity(drive)
        of = self._parameters
        if node_id in self._odd:
            odd = self._odd[node_id]
            return OddNode(
                node_id,
                parts,
                now_s,
                odd.manner,
                odd.seed,
                of.boot_delay_s,
                fixed,
                of.sdo_delay_s,
                lambda: self.battery.voltage_v,
            )
        return SimulatedNode(
            FACTORY_NODE_ID if of.factory_fresh else node_id,
            parts,
            now_s,
            of.boot_delay_s,
            fixed,
            personality,
            of.sdo_delay_s,
            lambda: self.battery.voltage_v,
            FACTORY_BITRATE if of.factory_fresh else self._robot.bus.bitrate,
        )

    def _axis(self, i: int | None) -> AxisParts:
        """The axis of drive `i`; None: an axis of the controller to which nothing is connected."""
        if i is None:
            idle = DEFAULT_BODY.motor(1)
            return AxisParts(idle, _scale_of(self._robot, self._robot.drives[0]), _nowhere, 0)
        drive = self._robot.drives[i]
        odd = self._odd.get(drive.node_id)
        scale = _scale_of(self._robot, drive, odd.manner.personality if odd else None)
        offset = self._parameters.encoder_offset * (i + 1)
        return AxisParts(self._motors[i], scale, self._travel(drive), offset, partial(self.base.hold, drive.side))

    def _travel(self, drive: Drive) -> Callable[[], float]:
        base, direction = self.base, drive.direction
        if drive.side == "left":
            return lambda: direction * base.travel_left_m
        return lambda: direction * base.travel_right_m


def _personality(drive: Drive) -> Personality:
    """The bench plays the drive that robot.yaml names; one of the user's own profiles is played as a generic drive."""
    return PERSONALITIES.get(drive.profile, GENERIC)


def _scale_of(robot: Robot, drive: Drive, personality: Personality | None = None) -> Scale:
    return Scale.of(drive, robot.base.radius_m(drive.side), personality or _personality(drive))


def _identity(drive: Drive) -> dict[int, int]:
    """1018h as robot.yaml expects it: the bench stands in for that drive."""
    known = drive.identity
    given = {1: known.vendor_id, 2: known.product_code, 3: known.revision, 4: known.serial}
    return {key(0x1018, subindex): value for subindex, value in given.items() if value is not None}


def _nowhere() -> float:
    return 0.0
