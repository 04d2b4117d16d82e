"""ROS parameters of safety_filter: values of robot.yaml to read, and speed limits to lower while the robot runs.

The shell of speed_limit.py. It lives in the process of mux and filter: the control process has none of it, and a caller
that floods these services holds up orders and leases together, which stops the base. Nav2's SpeedLimit comes in here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from canbase_config.robot import Robot
from canbase_runtime.wrong_start import WrongStartError
from canbase_velocity.speed_limit import RefusedLimitError, SpeedLimits

try:
    from nav2_msgs.msg import SpeedLimit
except ModuleNotFoundError:  # a robot without Nav2
    SpeedLimit = None

LIMIT: Final = "speed_limit"
TOPIC: Final = "speed_limit"
UNITS: Final = {f"{LIMIT}.linear_mps": "m/s", f"{LIMIT}.angular_radps": "rad/s"}
READABLE: Final = ("rates", "base", "limits")
"""Sections of robot.yaml."""
LOWER: Final = f"To go slower at run time, set {LIMIT}.linear_mps and {LIMIT}.angular_radps"
DEPTH: Final = 10
Change = Callable[[SpeedLimits, str], None]


class Parameters:
    """Declares them on `node`. `changed`: called with the new limits and who has changed them, in words."""

    def __init__(self, node: Node, robot: Robot, changed: Change, refused: Callable[[str], None]) -> None:
        self._changed, self._refused = changed, refused
        self.limits = SpeedLimits.of(robot)
        self._readable = readable(robot)
        node.add_on_set_parameters_callback(self._check)
        for name, value in self._readable.items():
            described = ParameterDescriptor(description="of robot.yaml; cannot be changed while the robot runs")
            node.declare_parameter(name, value, described, ignore_override=True)
        self._declare_limits(node)
        node.add_post_set_parameters_callback(self._set)
        if SpeedLimit is not None:
            node.create_subscription(SpeedLimit, TOPIC, self._on_nav2, DEPTH)

    def _declare_limits(self, node: Node) -> None:
        """Raises WrongStartError where the command line has one that cannot be."""
        try:
            for name, unit in UNITS.items():
                most = getattr(self.limits.most, name.removeprefix(f"{LIMIT}."))
                what = f"at most, 0: no motion; not above robot.yaml [{unit}]"
                described = ParameterDescriptor(
                    description=what, dynamic_typing=True
                )  # `0` is an integer for ros2 param
                node.declare_parameter(name, most, described)
        except (InvalidParameterValueException, InvalidParameterTypeException) as error:
            raise WrongStartError(f"{node.get_fully_qualified_name()}: {error}") from error
        self._set([node.get_parameter(name) for name in UNITS])

    def _check(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """All of one request, or none."""
        try:
            self._after(parameters)
        except RefusedLimitError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _after(self, parameters: Sequence[Parameter]) -> SpeedLimits:
        limits = self.limits
        for each in parameters:
            section, _, key = each.name.partition(".")
            if each.name in self._readable and each.value != self._readable[each.name]:
                raise RefusedLimitError(f"{each.name} is a key of robot.yaml: change it there. {LOWER}")
            if section == LIMIT and hasattr(limits.most, key):
                limits = limits.parameter(key, each.value)
        return limits

    def _set(self, parameters: Sequence[Parameter]) -> None:
        self._apply(self._after(parameters), "set by a parameter")

    def _on_nav2(self, message: Any) -> None:
        try:
            limits = self.limits.nav2(message.speed_limit, percentage=message.percentage)
        except RefusedLimitError as error:
            self._refused(f"{TOPIC}: {error}")
            return
        self._apply(limits, f"set by Nav2 on {TOPIC}")

    def _apply(self, limits: SpeedLimits, how: str) -> None:
        before, self.limits = self.limits, limits
        if limits.effective != before.effective:
            self._changed(limits, how)


def readable(robot: Robot) -> Mapping[str, Any]:
    """Name → value of all keys below READABLE, as robot.yaml has them or by default."""
    values = robot.model_dump()
    return {f"{section}.{key}": value for section in READABLE for key, value in values[section].items()}
