"""How velocities run through Nav2's nodes, and how they meet the mux of a robot.yaml: topics and remappings. Pure.

Source: `navigation_launch.py` of nav2_bringup and the nodes that it starts, branches jazzy and main of
github.com/ros-navigation/navigation2. Only names are taken from there. Controllers and behaviors publish `cmd_vel`,
which the launch file remaps to `cmd_vel_nav` for velocity_smoother; collision_monitor reads `cmd_vel_smoothed` and
publishes where a parameter says. docking_server and following_server publish `cmd_vel` directly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from canbase_config.mux import JOINTS, NEUTRAL_AFTER_S
from canbase_config.robot import Robot

VELOCITY: Final = "cmd_vel"
"""The name in the source of Nav2's nodes, before remappings. In a robot of canbase it is the driver's input."""
CONTROLLERS: Final = "cmd_vel_nav"
"""Between controllers and velocity_smoother, as Nav2's launch file has it: what no node has smoothed or checked."""
RENAMED: Final = "cmd_vel_controller"
"""The same where a source of the mux is called cmd_vel_nav."""
SMOOTHED: Final = "cmd_vel_smoothed"
"""Between velocity_smoother and collision_monitor."""
TELEOP: Final = "cmd_vel_teleop"
"""What the behavior assisted_teleop reads."""
NAVIGATION: Final = "navigation"
"""The source of the mux that collision_monitor publishes."""


@dataclass(frozen=True, slots=True)
class Nav2Node:
    """A node of Nav2 with velocities. Topics as in its source; `launch_remap`: what Nav2's launch makes of cmd_vel."""

    name: str
    publishes: str
    receives: str | None = None
    launch_remap: str | None = None


NODES: Final = (
    Nav2Node("controller_server", VELOCITY, None, CONTROLLERS),
    Nav2Node("behavior_server", VELOCITY, TELEOP, CONTROLLERS),
    Nav2Node("velocity_smoother", SMOOTHED, VELOCITY, CONTROLLERS),
    Nav2Node("collision_monitor", VELOCITY, SMOOTHED),
    Nav2Node("docking_server", VELOCITY),
    Nav2Node("following_server", VELOCITY),
)
DIRECT: Final = {"docking_server": "docking", "following_server": "following"}
"""Nodes that publish past the smoother and the monitor, each with its source of the mux."""
DIRECT_PRIORITY: Final = {"docking": 55, "following": 54}
"""Proposed: above navigation, whose last zeros would hold the base for 2.5 s."""


@dataclass(frozen=True, slots=True)
class Chain:
    """The topics and message types of one robot. `direct`: node → topic of its source."""

    controllers: str
    out: str
    stamped: bool
    timeout_s: float
    direct: Mapping[str, str]
    direct_stamped: Mapping[str, bool]
    notes: tuple[str, ...] = ()
    """What a person has to know or to add to robot.yaml."""

    @property
    def remappings(self) -> tuple[tuple[str, str], ...]:
        """(from, to), each for one node alone: `docking_server:cmd_vel`. Only those that Nav2's launch file lacks."""
        renamed = self.controllers != CONTROLLERS
        inner = [(node.name, self.controllers) for node in NODES if renamed and node.launch_remap]
        return tuple((f"{node}:{VELOCITY}", to) for node, to in (*inner, *self.direct.items()))

    def stamped_of(self, node: str) -> bool:
        """The parameter enable_stamped_cmd_vel of `node`."""
        return self.direct_stamped.get(node, self.stamped)


def chain(robot: Robot, namespace: str = "") -> Chain:
    """The chain of `robot` with Nav2 in the same namespace. Raises ValueError where robot.yaml does not permit one."""
    sources = robot.mux.sources
    if NAVIGATION not in sources:
        raise ValueError(
            f"mux.sources has no source called {NAVIGATION}, only {', '.join(sources)}: give Nav2's source that name"
        )
    if sources[NAVIGATION].type == JOINTS:
        raise ValueError(
            f"mux.sources.{NAVIGATION} has the type {JOINTS}, wheel speeds, which Nav2 does not publish: rename it, "
            f"and add a source {NAVIGATION} of type twist, or let Nav2 publish to the controller (docs/ros2_control.md)"
        )
    taken = {full_name(source.topic, namespace): name for name, source in sources.items()}
    if name := taken.get(full_name(SMOOTHED, namespace)):
        raise ValueError(
            f"mux.sources.{name}.topic is {SMOOTHED}, which Nav2 uses between velocity_smoother and collision_monitor: "
            f"the mux would drive past collision_monitor; choose another topic, such as {CONTROLLERS}"
        )
    direct = {node: sources.get(source) for node, source in DIRECT.items()}
    return Chain(
        controllers=RENAMED if full_name(CONTROLLERS, namespace) in taken else CONTROLLERS,
        out=sources[NAVIGATION].topic,
        stamped=sources[NAVIGATION].stamped,
        timeout_s=sources[NAVIGATION].timeout_s,
        direct={node: each.topic if each else f"cmd_vel_{DIRECT[node]}" for node, each in direct.items()},
        direct_stamped={node: each.stamped if each else True for node, each in direct.items()},
        notes=(*_missing_sources(robot), *_teleop(taken.get(full_name(TELEOP, namespace)))),
    )


def full_name(topic: str, namespace: str) -> str:
    """`topic` as the ROS graph has it; `namespace`: empty, or as ROS wants it, `/robot1`."""
    return topic if topic.startswith("/") else f"{namespace.rstrip('/')}/{topic}"


def _missing_sources(robot: Robot) -> list[str]:
    return [
        f"{node} cannot move the base: mux.sources of robot.yaml has no source called {source}. To use it, add\n"
        f"    {source}: {{topic: cmd_vel_{source}, priority: {DIRECT_PRIORITY[source]}, timeout_s: 0.5, "
        f"neutral_after_s: {NEUTRAL_AFTER_S}, nodes: [{node}]}}"
        for node, source in DIRECT.items()
        if source not in robot.mux.sources
    ]


def _teleop(source: str | None) -> list[str]:
    if source is None:
        return []
    return [
        f"mux.sources.{source}.topic is {TELEOP}, which Nav2's assisted_teleop reads too: the mux follows it directly, "
        "without Nav2's collision check; give assisted_teleop a topic of its own"
    ]
