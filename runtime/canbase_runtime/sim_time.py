"""Nodes that move a robot refuse simulation time: with a clock that is paused or set back no node would send zeros."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

from canbase_runtime.wrong_start import WrongStartError

SIM_TIME: Final = "use_sim_time"
REFUSED: Final = "use_sim_time is refused: this node moves a robot, and its timeouts are of real time"


def refuse_sim_time(node: Any, result: Callable[..., Any]) -> None:
    """Raises WrongStartError for a node that was started with use_sim_time, and refuses it while the node runs.

    `node`: an rclpy node; `result`: rcl_interfaces' SetParametersResult. This package imports no ROS.
    """
    if node.get_parameter(SIM_TIME).value:
        raise WrongStartError(f"{node.get_fully_qualified_name()}: {REFUSED}; start it without use_sim_time:=true")

    def refuse(parameters: Sequence[Any]) -> Any:
        wanted = any(parameter.name == SIM_TIME and parameter.value for parameter in parameters)
        return result(successful=not wanted, reason=REFUSED if wanted else "")

    node.add_on_set_parameters_callback(refuse)
