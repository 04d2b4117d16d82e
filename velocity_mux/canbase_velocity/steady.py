"""Clocks of nodes that move a robot: timers on the steady clock, and no simulation time.

A timer on the ROS clock stands still while that clock is set back or its simulation is paused: then nobody sends the
zeros and the leases.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.timer import Timer

SIM_TIME: Final = "use_sim_time"
REFUSED: Final = "use_sim_time is refused: this node moves a robot, and its timeouts are of real time"


class SimTimeError(RuntimeError):
    """A node that moves a robot was started with use_sim_time."""


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> Timer:
    """A timer that no step of the system clock and no simulation holds up."""
    return node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


def refuse_sim_time(node: Node) -> None:
    """Raises SimTimeError for a node that was started with use_sim_time, and refuses it while the node runs."""
    if node.get_parameter(SIM_TIME).value:
        raise SimTimeError(f"{node.get_fully_qualified_name()}: {REFUSED}; start it without use_sim_time:=true")

    def refuse(parameters: Sequence[Parameter]) -> SetParametersResult:
        wanted = any(parameter.name == SIM_TIME and parameter.value for parameter in parameters)
        return SetParametersResult(successful=not wanted, reason=REFUSED if wanted else "")

    node.add_on_set_parameters_callback(refuse)
