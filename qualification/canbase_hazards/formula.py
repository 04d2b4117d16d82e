"""Times and distances as formulas over robot.yaml: `timeouts.lease_s + 2 / rates.control_hz`. Not Python's eval."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

from canbase_config import stopping
from canbase_config.robot import Robot

_OPERATORS: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_STOPPING: dict[str, Callable[[Robot], float]] = {
    each.__name__: each for each in (stopping.longest_ramp_s, stopping.standstill_s, stopping.stuck_s)
}
"""Times that robot.yaml decides by more than + - * /, by their name behind `stopping.`."""
_FUNCTIONS: dict[str, Callable[..., float]] = {"max": max, "min": min}


class FormulaError(ValueError):
    """The text is no formula over robot.yaml; the message says which part is not."""


def evaluate(text: str, robot: Robot) -> float:
    """The value of a formula for one robot, in the unit of its keys.

    Known are numbers, + - * /, max(), min(), the keys of robot.yaml by their path, and `stopping.stuck_s` and others of
    canbase_config/stopping.py. Raises FormulaError otherwise.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except SyntaxError as error:
        raise FormulaError(f"{text!r} is not a formula: {error.msg}") from error
    return _number(_value(tree.body, robot), text)


def _value(node: ast.expr, robot: Robot) -> Any:
    if isinstance(node, ast.Constant):
        return _number(node.value, ast.unparse(node))
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        left, right = (_number(_value(side, robot), ast.unparse(side)) for side in (node.left, node.right))
        return _OPERATORS[type(node.op)](left, right)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS:
        return _FUNCTIONS[node.func.id](*(_number(_value(each, robot), ast.unparse(each)) for each in node.args))
    if isinstance(node, ast.Name):
        return _key(robot, node.id, ast.unparse(node))
    if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "stopping" and node.attr in _STOPPING:
        return _STOPPING[node.attr](robot)
    if isinstance(node, ast.Attribute):
        return _key(_value(node.value, robot), node.attr, ast.unparse(node))
    raise FormulaError(f"{ast.unparse(node)!r}: only numbers, + - * /, max(), min() and keys of robot.yaml are known")


def _key(section: Any, name: str, path: str) -> Any:
    found = section.get(name) if isinstance(section, Mapping) else getattr(section, name, None)
    if found is None or name.startswith("_") or callable(found):
        raise FormulaError(f"robot.yaml has no key {path}")
    return found


def _number(value: Any, text: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FormulaError(f"{text!r} is not a number")
    return float(value)
