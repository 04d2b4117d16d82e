"""The parameters of Nav2 that follow from a robot.yaml: frames, topics, message types, limits, footprint. Pure.

The names are those of `nav2_params.yaml` of nav2_bringup, branches jazzy and main, and of the nodes' sources. What does
not follow from robot.yaml is left to Nav2's own file. REP 103 and REP 105.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from canbase_config.action import BEHAVIORS
from canbase_config.commissioned import uncommissioned, uncommissioned_mps
from canbase_config.nav2_chain import NODES, SMOOTHED, Chain, chain, full_name
from canbase_config.robot import Robot
from canbase_config.safety import Footprint, Scan

Path = tuple[str, ...]
ROS: Final = "ros__parameters"
CONTROLLER: Final = "FollowPath"
MPPI: Final = "nav2_mppi_controller::MPPIController"
"""The controller of Nav2's own parameter file; the names of its limits are known here, those of others are not."""
ODOM: Final = "odom"
FILTERED: Final = "odometry/filtered"
"""Topic of robot_localization, which publishes the transform in place of motor_driver."""
PLUGINS: Final = ("spin", "backup", "drive_on_heading", "assisted_teleop", "wait")
"""behavior_plugins of Nav2's own parameter file."""
CELL_M: Final = 0.05
"""Lengths of the costmap are rounded up to its resolution."""


@dataclass(frozen=True, slots=True)
class Bounded:
    """A number that Nav2 chooses, within limits that robot.yaml sets. `usual`: without a file of Nav2."""

    usual: float
    low: float = -math.inf
    high: float = math.inf

    def of(self, given: object) -> float:
        """What is `given` in Nav2's file, or the usual value, within the limits."""
        number = given if isinstance(given, (int, float)) and not isinstance(given, bool) else self.usual
        return _tidy(min(max(float(number), self.low), self.high))


@dataclass(frozen=True, slots=True)
class BoundedList:
    """A list of numbers that Nav2 chooses, each within limits."""

    numbers: tuple[Bounded, ...]

    def of(self, given: object) -> list[float]:
        """What is `given` in Nav2's file, or the usual list, within the limits."""
        chosen = given if isinstance(given, list) and len(given) == len(self.numbers) else [None] * len(self.numbers)
        return [bounded.of(number) for bounded, number in zip(self.numbers, chosen, strict=True)]


@dataclass(frozen=True, slots=True)
class Without:
    """A list of names that Nav2 chooses, without those that canbase serves. `usual`: without a file of Nav2."""

    usual: tuple[str, ...]
    names: tuple[str, ...]

    def of(self, given: object) -> list[str]:
        """What is `given` in Nav2's file, or the usual list, without `names`."""
        chosen = given if isinstance(given, list) else self.usual
        return [name for name in chosen if name not in self.names]


@dataclass(frozen=True, slots=True)
class Speeds:
    """What the base does at most, [m/s] and [rad/s], as magnitudes."""

    linear_mps: float
    angular_radps: float


def speeds(robot: Robot) -> Speeds:
    """What filter and driver let through: `limits`, `safety.ceiling`, and before commissioning uncommissioned_mps."""
    ceiling, limits = robot.safety.ceiling, robot.limits
    linear_mps = min(limits.linear_mps, ceiling.linear_mps if ceiling else math.inf)
    angular_radps = min(limits.angular_radps, ceiling.angular_radps if ceiling else math.inf)
    if uncommissioned(robot):
        linear_mps = min(linear_mps, uncommissioned_mps(robot))
    return Speeds(linear_mps, angular_radps)


def parameters(robot: Robot, namespace: str = "") -> dict[Path, Any]:
    """Path in a parameter file of Nav2 → value; where Nav2's own value stays, within limits, what those are.

    A tuned speed is lowered, never raised.

    Raises ValueError as `chain` does.
    """
    wiring, odom = chain(robot, namespace), _odom(robot)
    sections: dict[Path, dict[str, Any]] = {
        ("amcl",): _amcl(robot),
        ("bt_navigator",): {"robot_base_frame": robot.base.base_frame, "odom_topic": odom},
        ("controller_server",): {"odom_topic": odom, CONTROLLER: _mppi(robot)},
        ("local_costmap", "local_costmap"): _costmap(robot, namespace, "voxel_layer")
        | {"global_frame": robot.base.odom_frame},
        ("global_costmap", "global_costmap"): _costmap(robot, namespace, "obstacle_layer"),
        ("behavior_server",): _behaviors(robot),
        ("smoother_server",): {"robot_base_frame": robot.base.base_frame},
        ("route_server",): {"base_frame": robot.base.base_frame},
        ("velocity_smoother",): _smoother(robot, wiring),
        ("collision_monitor",): _monitor(robot, wiring),
        ("docking_server",): _docking(robot),
        ("following_server",): {"base_frame": robot.base.base_frame, "fixed_frame": robot.base.odom_frame},
    }
    for node in NODES:
        sections[(node.name,)]["enable_stamped_cmd_vel"] = wiring.stamped_of(node.name)
    return {(*node, ROS, *path): value for node, section in sections.items() for path, value in _flat(section)}


def _flat(section: Mapping[str, Any]) -> Iterator[tuple[Path, Any]]:
    for key, value in section.items():
        if isinstance(value, dict):
            yield from (((key, *path), inner) for path, inner in _flat(value))
        else:
            yield (key,), value


def _amcl(robot: Robot) -> dict[str, Any]:
    frames = {"base_frame_id": robot.base.base_frame, "odom_frame_id": robot.base.odom_frame}
    return frames | {"scan_topic": robot.safety.scan.topic}


def _odom(robot: Robot) -> str:
    return ODOM if robot.odometry.publish_tf else FILTERED


def _at_most(value: float) -> Bounded:
    return Bounded(value, high=value)


def _at_least(value: float) -> Bounded:
    return Bounded(value, low=value)


def _mppi(robot: Robot) -> dict[str, Any]:
    most, limits = speeds(robot), robot.limits
    return {
        "vx_max": _at_most(most.linear_mps),
        "vx_min": Bounded(-0.35, low=-most.linear_mps),
        "wz_max": _at_most(most.angular_radps),
        "ax_max": _at_most(limits.acceleration_mps2),
        "ax_min": _at_least(-limits.deceleration_mps2),
        "az_max": _at_most(limits.angular_acceleration_radps2),
    }


def _costmap(robot: Robot, namespace: str, layer: str) -> dict[str, Any]:
    names = _scan_names(robot)
    scans = {name: _costmap_scan(scan, namespace) for name, scan in names.items()}
    return {
        "robot_base_frame": robot.base.base_frame,
        "footprint": _polygon(robot.safety.footprint),
        "inflation_layer": {"inflation_radius": Bounded(0.7, low=_inflation_m(robot))},
        layer: {"observation_sources": " ".join(names), **scans},
    }


def _costmap_scan(scan: Scan, namespace: str) -> dict[str, Any]:
    """Its whole topic: Jazzy and later versions look for a relative one in different namespaces."""
    return {
        "topic": full_name(scan.topic, namespace),
        "data_type": "LaserScan",
        "marking": True,
        "clearing": True,
    }


def _behaviors(robot: Robot) -> dict[str, Any]:
    turning_radps, limits = speeds(robot).angular_radps, robot.limits
    turning_radps2 = min(limits.angular_acceleration_radps2, limits.angular_deceleration_radps2)
    served = {"behavior_plugins": Without(PLUGINS, BEHAVIORS)} if robot.action.nav2_behaviors else {}
    return served | {
        "local_frame": robot.base.odom_frame,
        "robot_base_frame": robot.base.base_frame,
        "max_rotational_vel": Bounded(1.0, high=turning_radps),
        "min_rotational_vel": Bounded(0.4, high=turning_radps),
        "rotational_acc_lim": Bounded(3.2, high=turning_radps2),
    }


def _smoother(robot: Robot, wiring: Chain) -> dict[str, Any]:
    most, limits, sideways = speeds(robot), robot.limits, Bounded(0.0, low=0.0, high=0.0)
    linear_mps, angular_radps = most.linear_mps, most.angular_radps
    return {
        "odom_topic": _odom(robot),
        "max_velocity": BoundedList((_at_most(linear_mps), sideways, _at_most(angular_radps))),
        "min_velocity": BoundedList((_at_least(-linear_mps), sideways, _at_least(-angular_radps))),
        "max_accel": BoundedList(
            (_at_most(limits.acceleration_mps2), sideways, _at_most(limits.angular_acceleration_radps2))
        ),
        "max_decel": BoundedList(
            (_at_least(-limits.deceleration_mps2), sideways, _at_least(-limits.angular_deceleration_radps2))
        ),
        "velocity_timeout": Bounded(1.0, high=wiring.timeout_s),
    }


def _monitor(robot: Robot, wiring: Chain) -> dict[str, Any]:
    names = _scan_names(robot)
    return {
        "base_frame_id": robot.base.base_frame,
        "odom_frame_id": robot.base.odom_frame,
        "cmd_vel_in_topic": SMOOTHED,
        "cmd_vel_out_topic": wiring.out,
        "FootprintApproach": {"footprint_topic": "local_costmap/published_footprint"},
        "observation_sources": list(names),
        **{name: {"type": "scan", "topic": scan.topic} for name, scan in names.items()},
    }


def _docking(robot: Robot) -> dict[str, Any]:
    most = speeds(robot).linear_mps
    return {
        "base_frame": robot.base.base_frame,
        "fixed_frame": robot.base.odom_frame,
        "controller": {"v_linear_min": Bounded(0.15, high=most), "v_linear_max": Bounded(0.15, high=most)},
    }


def _scan_names(robot: Robot) -> dict[str, Scan]:
    """The first scanner has the name that it has in Nav2's own file."""
    further = {scan.topic.strip("/").replace("/", "_"): scan for scan in robot.safety.more_scans}
    return {"scan": robot.safety.scan, **further}


def _polygon(footprint: Footprint) -> str:
    front_m, rear_m, left_m, right_m = footprint.front_m, -footprint.rear_m, footprint.left_m, -footprint.right_m
    corners = [[front_m, left_m], [front_m, right_m], [rear_m, right_m], [rear_m, left_m]]
    return str([[_tidy(value) for value in corner] for corner in corners])


def _inflation_m(robot: Robot) -> float:
    """So far from an obstacle the filter stops no direction of travel: the farthest corner, and the stop distance."""
    footprint = robot.safety.footprint
    corner_m = math.hypot(max(footprint.front_m, footprint.rear_m), max(footprint.left_m, footprint.right_m))
    return _tidy(CELL_M * math.ceil((corner_m + robot.safety.stop_distance_m) / CELL_M - 1e-9))


def _tidy(value: float) -> float:
    return float(f"{value:.6g}") + 0.0  # never -0.0
