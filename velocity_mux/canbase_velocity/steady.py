"""Timers on the steady clock, and what is due in them: no step of the system clock holds up zeros and leases."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.timer import Timer


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> Timer:
    """A timer of `node` on the steady clock."""
    return node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


def next_turn(due_s: float, now_s: float, period_s: float) -> float:
    """When something periodic that is due at `due_s` is due next, looked at at `now_s`. Cycles that come late do not
    add up, after a pause nothing is made up for, and what is published in between delays none."""
    if now_s < due_s:
        return due_s
    return due_s + period_s if due_s + period_s > now_s else now_s + period_s
