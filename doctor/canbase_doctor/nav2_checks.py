"""Rows of `canbase doctor` about Nav2: whether its velocities reach the mux, each through the nodes that shall see it.

Pure: from the publishers and subscribers of velocities in the ROS graph. How it should be: canbase_config.nav2_chain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from canbase_config.mux import MuxSource
from canbase_config.nav2_chain import CONTROLLERS, DIRECT, NAVIGATION, NODES, full_name
from canbase_doctor.check import Check, fail, first_failure, ok, warn
from canbase_doctor.evidence import Endpoint, Evidence, VelocityTopic
from canbase_doctor.nav2_speeds import speed_checks

NAME: Final = "Nav2 wiring"
LAUNCH: Final = "start Nav2 with the launch file of canbase print nav2 --launch"
PARAMS: Final = "start Nav2 with the parameters of canbase print nav2"
MUX, FILTER, DRIVER, INPUT = "velocity_mux", "safety_filter", "motor_driver", "cmd_vel"
PLANNERS: Final = {"controller_server", "behavior_server"}
"""They may share a topic: one of them commands at a time."""


@dataclass(frozen=True, slots=True)
class Wiring:
    """The velocity topics of the ROS graph, by their whole names, and the sources of the mux in one namespace."""

    topics: Mapping[str, VelocityTopic]
    sources: Mapping[str, MuxSource]
    """By name in robot.yaml."""
    namespace: str

    @property
    def source_topics(self) -> dict[str, MuxSource]:
        """By whole name of their topic."""
        return {self.name(source.topic): source for source in self.sources.values()}

    @property
    def nav2(self) -> frozenset[str]:
        """Nav2's nodes, by their whole names, whether they run or not."""
        return frozenset(self.name(node.name) for node in NODES)

    @property
    def chain(self) -> frozenset[str]:
        """All nodes that pass velocities on; others only look."""
        return self.nav2 | {self.name(node) for node in (MUX, FILTER, DRIVER)}

    def name(self, relative: str) -> str:
        """With the namespace."""
        return full_name(relative, self.namespace)

    def short(self, whole: str) -> str:
        """Without it, for people."""
        return whole.removeprefix(self.name(""))

    def listed(self, nodes: Sequence[str]) -> str:
        """Their short names in a sentence."""
        return " and ".join(map(self.short, nodes))

    def publishers(self, topic: str) -> list[str]:
        """Their nodes, each once."""
        return list(dict.fromkeys(end.node for end in self.topics.get(topic, VelocityTopic()).publishers))

    def readers(self, topic: str) -> list[str]:
        """The nodes of the chain that subscribe, each once."""
        ends = self.topics.get(topic, VelocityTopic()).subscribers
        return list(dict.fromkeys(end.node for end in ends if end.node in self.chain))

    def next(self, node: str) -> list[tuple[str, str]]:
        """(topic, node of the chain that reads it) for all topics that `node` publishes."""
        return [
            (topic, reader)
            for topic in sorted(self.topics)
            if node in self.publishers(topic)
            for reader in self.readers(topic)
        ]


def nav2_checks(seen: Evidence) -> list[Check]:
    """No row where no node of Nav2 publishes or reads velocities; else a row for each defect, or the way of the
    velocities, and one for speeds.
    """
    wiring = Wiring(seen.velocities, seen.robot.mux.sources, seen.namespace)
    ends = {each.node for topic in wiring.topics.values() for each in (*topic.publishers, *topic.subscribers)}
    if not ends & wiring.nav2:
        return []
    rows = [check for look in LOOKS for check in look(wiring)]
    way = [] if first_failure(rows) else [ok(NAME, _path(wiring))]
    return [*way, *rows, *speed_checks(seen)]


def _loop(wiring: Wiring) -> Iterator[Check]:
    """A command that comes back to a node that has passed it on: the last velocity holds for ever."""
    found = next(filter(None, (_way_back(wiring, node, (node,)) for node in sorted(wiring.nav2))), ())
    if found:
        told = " → ".join(map(wiring.short, found))
        yield fail(NAME, f"a loop: {told}", f"keep the controllers' topic apart from the mux's: {LAUNCH}")


def _way_back(wiring: Wiring, start: str, path: tuple[str, ...]) -> tuple[str, ...]:
    """From the last node of `path` (nodes and topics in turn) to `start`; empty: there is none."""
    for topic, node in wiring.next(path[-1]):
        if node == start:
            return (*path, topic, node)
        if node not in path and (found := _way_back(wiring, start, (*path, topic, node))):
            return found
    return ()


def _unchecked(wiring: Wiring) -> Iterator[Check]:
    """The mux reads what velocity_smoother or collision_monitor have yet to see."""
    for topic in wiring.source_topics:
        readers = wiring.readers(topic)
        skipped = [node for node in readers if node in wiring.nav2]
        if wiring.name(MUX) in readers and skipped:
            told = f"{MUX} reads {topic} before {wiring.listed(skipped)} has smoothed or checked it"
            yield fail(NAME, told, f"keep the controllers' topic apart from the mux's: {LAUNCH}")


def _driver_input(wiring: Wiring) -> Iterator[Check]:
    """Nav2 on cmd_vel: the wheels move without a lease."""
    topic = wiring.name(INPUT)
    if intruders := [node for node in wiring.publishers(topic) if node in wiring.nav2]:
        told = f"{topic}, the input of {DRIVER}, has publishers beside {FILTER}: {wiring.listed(intruders)}"
        yield fail(NAME, f"{told}; the watchdog stops the base", _elsewhere(wiring, intruders))


def _one_publisher(wiring: Wiring) -> Iterator[Check]:
    """The zero of one of two publishers would stop, and arm, the other."""
    for topic in wiring.source_topics:
        nodes = wiring.publishers(topic)
        of_nav2 = [node for node in nodes if node in wiring.nav2]
        if of_nav2 and len(nodes) > 1 and not {wiring.short(node) for node in nodes} <= PLANNERS:
            told = f"{topic}, the topic of one source, has {len(nodes)} publishers: {wiring.listed(nodes)}"
            yield fail(NAME, told, _elsewhere(wiring, of_nav2))


def _elsewhere(wiring: Wiring, nodes: Sequence[str]) -> str:
    """The cure by node: the monitor's topic is a parameter, that of the others a remapping."""
    short = [wiring.short(node) for node in nodes]
    remaps = [f"{node}:{INPUT}:=cmd_vel_{DIRECT[node]}" for node in short if node in DIRECT]
    cures = [f"remap {', '.join(remaps)}: {LAUNCH}"] if remaps else []
    if "collision_monitor" in short:
        cures.append(_monitor_topic(wiring))
    return "; ".join(cures) or LAUNCH


def _monitor_topic(wiring: Wiring) -> str:
    topic = wiring.sources[NAVIGATION].topic if NAVIGATION in wiring.sources else CONTROLLERS
    return f"collision_monitor: cmd_vel_out_topic: {topic}: {PARAMS}"


def _types(wiring: Wiring) -> Iterator[Check]:
    """Twist and TwistStamped on one topic do not meet: nothing arrives, and no node reports it."""
    for name, topic in sorted(wiring.topics.items()):
        readers = [each for each in topic.subscribers if each.node in wiring.chain]
        for sender in dict.fromkeys(topic.publishers):
            for reader in dict.fromkeys(readers):
                if sender.type != reader.type and {sender.node, reader.node} & wiring.nav2:
                    told = f"{wiring.short(sender.node)} publishes {_kind(sender)} on {name}, "
                    told += f"{wiring.short(reader.node)} reads {_kind(reader)}: nothing arrives"
                    yield fail(NAME, told, _one_type(wiring, name, sender))


def _kind(end: Endpoint) -> str:
    return end.type.rpartition("/")[2]


def _one_type(wiring: Wiring, topic: str, sender: Endpoint) -> str:
    if topic not in wiring.source_topics:
        return f"set enable_stamped_cmd_vel of all nodes of Nav2 alike: {PARAMS}"
    stamped = "true" if wiring.source_topics[topic].stamped else "false"
    return f"{wiring.short(sender.node)}: enable_stamped_cmd_vel: {stamped}, as robot.yaml has it: {PARAMS}"


def _read(wiring: Wiring) -> Iterator[Check]:
    """What a node of Nav2 publishes is read by the next node of the chain."""
    for topic in sorted(wiring.topics):
        senders = [node for node in wiring.publishers(topic) if node in wiring.nav2]
        if senders and not wiring.readers(topic):
            yield _unread(wiring, topic, senders)


def _unread(wiring: Wiring, topic: str, senders: Sequence[str]) -> Check:
    """Of nodes that Nav2's launch file always starts, whether somebody wants them or not: a warning."""
    told, short = f"nobody reads {topic} of {wiring.listed(senders)}", [wiring.short(node) for node in senders]
    if direct := [DIRECT[node] for node in short if node in DIRECT]:
        cure = (
            f"to use it, add the source {', '.join(direct)} to mux.sources of robot.yaml: canbase print nav2 prints it"
        )
        return warn(NAME, told, cure)
    if "collision_monitor" in short:
        return fail(NAME, told, _monitor_topic(wiring))
    return fail(NAME, told, f"is the node that reads it running and configured? {LAUNCH}")


LOOKS: Final[tuple[Callable[[Wiring], Iterator[Check]], ...]] = (
    _loop,
    _unchecked,
    _driver_input,
    _one_publisher,
    _types,
    _read,
)
"""What explains most first."""


def _path(wiring: Wiring) -> str:
    """The way of velocities from the controllers to the mux, and of those that are published past the monitor."""
    path = [wiring.name("controller_server")]
    while path[-1] != wiring.name(MUX) and (steps := wiring.next(path[-1])):
        path.extend(steps[0])
    direct = [f"{node} → {step[0]}" for node in DIRECT for step in wiring.next(wiring.name(node))]
    return "; ".join([" → ".join(map(wiring.short, path)), *direct])
