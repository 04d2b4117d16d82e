"""Requests of `canbase doctor` to the nodes of Nav2: it reads speeds out of their parameters and changes none.

One request for each parameter: a node answers a list with one unknown name by nothing at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node

from canbase_doctor.nav2_speeds import SPEEDS

_NUMBERS: Final = {
    ParameterType.PARAMETER_DOUBLE: lambda value: (value.double_value,),
    ParameterType.PARAMETER_INTEGER: lambda value: (float(value.integer_value),),
    ParameterType.PARAMETER_DOUBLE_ARRAY: lambda value: tuple(value.double_array_value),
}


class Nav2Prober:
    """Sends each request once, as soon as its node is there."""

    def __init__(self, node: Node) -> None:
        names = dict.fromkeys(speed.node for speed in SPEEDS)
        self._clients = {name: node.create_client(GetParameters, f"{name}/get_parameters") for name in names}
        self._asked: dict[tuple[str, str], Any] = {}

    def step(self) -> None:
        """To be called as often as possible."""
        ready = {name for name, client in self._clients.items() if client.service_is_ready()}
        for speed in SPEEDS:
            if speed.node in ready and speed.key not in self._asked:
                request = GetParameters.Request(names=[speed.parameter])
                self._asked[speed.key] = self._clients[speed.node].call_async(request)

    def values(self) -> Mapping[tuple[str, str], tuple[float, ...]]:
        """The numbers that were answered so far; what a node does not have is left out."""
        answered = {key: call.result().values for key, call in self._asked.items() if call.done()}
        numbers = {key: _numbers(values[0]) for key, values in answered.items() if values}
        return {key: found for key, found in numbers.items() if found}


def _numbers(value: Any) -> tuple[float, ...]:
    return _NUMBERS[value.type](value) if value.type in _NUMBERS else ()
