"""What can still act on a drive that has power: a process with a line to it, or the drive itself.

A drive that no process reaches turns on until its own monitoring of its masters stops it. Two kinds do not stop then,
and no software can change it: one that monitors nothing (docs/drives.md), and one whose speed sensor is faulty, since
its own quick stop closes its loop on that sensor. STO, wired, stops both. A watchdog that reaches it resets the node.
"""

from __future__ import annotations

import math

from canbase_campaign.envelope import tolerance_mps
from canbase_campaign.world import World
from canbase_hazards.stated_times import stated_s
from canbase_sim.cia301.dictionary import key
from canbase_sim.cia301.life_guarding import Life
from canbase_sim.cia402.axis import Axis
from canbase_sim.cia402.states import State
from canbase_sim.node import SimulatedNode
from canbase_sim.personality import GENERIC, PERSONALITIES
from canbase_sim.plant.motor import Motor

LEAST_SHARE = 0.5
"""A wheel that brakes with less of its stated deceleration does not brake as it must: docs/bus.md."""
SATURATED = 0.95
"""With this share of the bus taken by the lowest identifier no frame of another one gets through."""
BRAKES_S = 0.3
"""A wheel that turns again after a stop is slow: its drive takes this long to brake it [s]."""


def _ignores_all(node: SimulatedNode) -> bool:
    """Only a reset of the node has an effect on one of its motors."""
    return any(axis.faults.frozen or axis.faults.stuck_on for axis in node.axes)


class Reach:
    """`lost`: a wheel turns with power, and no process reaches its drive; called every step."""

    def __init__(self, world: World) -> None:
        self._world = world
        profile = world.robot.drives[0].profile
        self.personality = PERSONALITIES.get(profile, GENERIC)
        self.alone_s = self.personality.alone_s(world.robot.timeouts.drive_heartbeat_s)
        """After this long without a frame a drive of this kind begins to stop by itself [s]; infinity: never."""
        self._wheels = [(*world.drives.place(wheel), drive.side) for wheel, drive in enumerate(world.robot.drives)]
        self._moves_mps = tolerance_mps(world.robot) / 2.0
        self.lost = False
        self.was_lost = False
        """It was so since the base last stood."""
        self.fastest_mps = 0.0
        """The fastest wheel since the base last stood."""
        self.lost_at = dict.fromkeys(world.drives.bench.nodes, -math.inf)
        """When each drive was lost last, or braked in vain against a motor of its side that is."""
        self._cut_at = dict.fromkeys(world.drives.bench.nodes, -math.inf)
        """When no process reached each drive last: one that does again has its rungs ahead."""
        self._weak: set[int] = set()
        """Drives whose own stop has had hardly an effect since they have power: a ramp that has begun goes on so."""
        self._ran_at = dict.fromkeys(("driver", "watchdog"), world.clock.now_s)
        """When each of them ran last: it is not missed before timeouts.watchdog_s, so it counts as there until then."""
        self._power_from: dict[int, float] = {}
        """Since when each drive has power: it gets none before its settings are written."""
        self._reacts_since: dict[int, float] = {}
        """Drives in a fault reaction that their own sensor never ends; since when the watchdog reaches them."""
        self._reset_s = stated_s("fault_reaction_on_a_lying_sensor", world.robot)
        self._least_mps2 = LEAST_SHARE * world.robot.limits.deceleration_mps2
        self._missed_s = world.robot.timeouts.watchdog_s

    def step(self, stands: bool) -> None:
        """Look at all drives now."""
        now_s, bench = self._world.clock.now_s, self._world.drives.bench
        for name in self._ran_at:
            if self._world.processes[name].running:
                self._ran_at[name] = now_s
        powered = [node for node in bench.nodes.values() if any(axis.motor.powered for axis in node.axes)]
        self._power_from = {node.node_id: self._power_from.get(node.node_id, now_s) for node in powered}
        self._weak = {node.node_id for node in powered if node.node_id in self._weak or self._is_weak(node)}
        lost = {node_id for node_id, _ in self.turning() if not stands and self._is_lost(node_id, now_s)}
        self.lost = bool(lost)
        self.was_lost = self.lost or (self.was_lost and not stands)
        if lost:
            self.lost_at |= dict.fromkeys(lost | self._overpowered(lost), now_s)
        for node in powered:
            if not self._reached(node.node_id):
                self._cut_at[node.node_id] = now_s
        wheel_mps = max(abs(bench.base.v_left_mps), abs(bench.base.v_right_mps))
        self.fastest_mps = 0.0 if stands else max(self.fastest_mps, wheel_mps)

    def stops_alone(self, node_id: int) -> bool:
        """The drive stops when it receives nothing: it monitors its masters, it brakes, and its sensors are right."""
        node = self._world.drives.bench.nodes[node_id]
        was_reset = self._world.intruder.resets_at > self._power_from.get(node_id, math.inf)
        may_forget = self.personality.heeds_masters and (was_reset or node.settings_lost)
        forgot = may_forget and not self._knows_masters(node)
        able = node_id not in self._weak and not self._lies(node)
        return self.alone_s < math.inf and able and not forgot

    def ramp_has_ended(self, node_id: int, axis: int) -> bool:
        """It orders no speed of its motor any more: what is left swings with its velocity loop."""
        motor = self._world.drives.bench.nodes[node_id].axes[axis].motor
        return motor.goal_mps == 0.0 == motor.demand_mps

    def turning(self) -> list[tuple[int, int]]:
        """Node id and axis of each wheel that turns with power: its motor is coupled to it."""
        base, nodes = self._world.drives.bench.base, self._world.drives.bench.nodes
        if base.resting:
            return []
        left, right = abs(base.v_left_mps) > self._moves_mps, abs(base.v_right_mps) > self._moves_mps
        if not (left or right):
            return []
        turn = [(node_id, axis) for node_id, axis, side in self._wheels if (left if side == "left" else right)]
        return [
            (node_id, at)
            for node_id, at in turn
            if (axis := nodes[node_id].axes[at]).motor.powered and not axis.uncoupled
        ]

    def heard(self, node_id: int) -> float:
        """When the drive last received what it monitors: heartbeats, requests that guard it, or setpoints."""
        drives = self._world.drives
        if self.personality.heeds_guarding:
            return drives.guarded[node_id]
        heard = drives.heard if self.personality.heeds_heartbeats else drives.ordered
        return heard[node_id]

    def acts_s(self, now_s: float, lies_s: float) -> float:
        """How long a wheel may turn again after a stop, before a layer has to have acted [s]; 0: none has a reason.

        `lies_s`: for a wheel with power whose encoder is faulty, or whose drive does not brake, or is reached again
        since then. Infinity: for one that no process reaches, until it has ended its setpoint by itself.
        """
        nodes = self._world.drives.bench.nodes
        longest_s = 0.0
        for node_id, _ in self.turning():
            node = nodes[node_id]
            lies = self._lies(node) or self._is_weak(node) or now_s < self._cut_at[node_id] + lies_s
            waits = now_s < self.heard(node_id) + self.alone_s + BRAKES_S
            alone = not self._reached(node_id) and self.stops_alone(node_id) and waits
            longest_s = max(longest_s, lies_s if lies else 0.0, math.inf if alone else 0.0)
        return longest_s

    def _is_lost(self, node_id: int, now_s: float) -> bool:
        """No process reaches it, and it does not stop by itself, or not yet: a vendor's watchdog has its own time."""
        if self._reacts(node_id):
            since = self._reacts_since.setdefault(node_id, now_s)
            if not self._watchdog_reaches(node_id):
                self._reacts_since[node_id] = now_s
            return now_s <= since + self._reset_s
        self._reacts_since.pop(node_id, None)
        waits = not self.personality.heeds_masters and now_s <= self.heard(node_id) + self.alone_s
        return (waits or not self.stops_alone(node_id)) and not self._reached(node_id)

    def _overpowered(self, lost: set[int]) -> set[int]:
        """Nodes with a motor that stops with all its force, beside one of a lost node that drives the same side on."""
        nodes = self._world.drives.bench.nodes
        axes = [(node_id, side, nodes[node_id].axes[axis]) for node_id, axis, side in self._wheels]
        driven = {side for node_id, side, axis in axes if node_id in lost and self._pushes(axis)}
        return {node_id for node_id, side, axis in axes if side in driven and self._brakes_fully(axis.motor)}

    @staticmethod
    def _pushes(axis: Axis) -> bool:
        brakes = axis.encoder.closes_loop and axis.faults.stop_share >= LEAST_SHARE
        return axis.motor.powered and not brakes

    @staticmethod
    def _brakes_fully(motor: Motor) -> bool:
        return motor.saturated and motor.goal_mps == 0.0 and motor.force_n * motor.speed_mps < 0.0

    def _reached(self, node_id: int) -> bool:
        """A driver or a watchdog that is there, and that behaves, has a line to it."""
        world = self._world
        driver, blocked = world.driver, world.bus.disturbance.blocked
        if not world.drives.bench.nodes[node_id].line.hears or world.intruder.babbles >= SATURATED:
            return False
        sane = not driver.bus_problem and not driver.repeats and not driver.ignores_zero
        if sane and self._is_there("driver") and (not blocked or ("driver", f"drive{node_id}") not in blocked):
            return True
        talks = not world.watchdog.is_deaf and self._is_there("watchdog")
        return talks and (not blocked or ("watchdog", f"drive{node_id}") not in blocked)

    def _is_there(self, name: str) -> bool:
        """It runs, or has hung for so short a time that it is not missed."""
        since_s = self._world.clock.now_s - self._ran_at[name]
        return self._world.processes[name].alive and since_s <= self._missed_s

    def _watchdog_reaches(self, node_id: int) -> bool:
        """It is there, and has a line to the drive and from it: it resets no drive from which it receives nothing."""
        world, drive = self._world, f"drive{node_id}"
        line, blocked = world.drives.bench.nodes[node_id].line, world.bus.disturbance.blocked
        ways = {("watchdog", drive), (drive, "watchdog")}
        talks = self._is_there("watchdog") and not world.watchdog.is_deaf
        return talks and line.hears and not line.silent and not ways & blocked

    def _reacts(self, node_id: int) -> bool:
        """In its fault reaction a drive takes no controlword (CiA 402-2, transition 14), and it ends on its sensor.

        Or it does not brake in it. Or its application hangs, or its power stage cannot be switched off.
        """
        node = self._world.drives.bench.nodes[node_id]
        if _ignores_all(node):
            return True
        lies = self._lies(node) or self._is_weak(node)
        return lies and any(axis.state is State.FAULT_REACTION_ACTIVE for axis in node.axes)

    def _is_weak(self, node: SimulatedNode) -> bool:
        """A quick stop, or a fault reaction, of one of its motors has hardly an effect, though its settings demand one;
        or it has lost those. Or it has less than LEAST_SHARE of the slope of its settings."""
        least_mps2 = self._least_mps2
        stopping = [axis for axis in node.axes if axis.motor.stop_mps2 < math.inf]
        weak = [axis for axis in stopping if axis.motor.stop_mps2 < least_mps2]
        softly = any(axis.faults.stop_share < LEAST_SHARE for axis in stopping)
        return softly or any(node.settings_lost or axis.stated_mps2 >= least_mps2 for axis in weak)

    @staticmethod
    def _lies(node: SimulatedNode) -> bool:
        """The loop of one of its motors closes on a sensor on which it cannot brake."""
        return any(not axis.encoder.closes_loop for axis in node.axes) or _ignores_all(node)

    def _knows_masters(self, node: SimulatedNode) -> bool:
        if self.personality.heeds_guarding:
            return node.guarding.life is Life.GUARDED and node.guarding.life_s > 0.0
        subs = range(1, self.personality.heartbeat_entries + 1)
        return any(node.dictionary.values[key(0x1016, sub)] for sub in subs)
