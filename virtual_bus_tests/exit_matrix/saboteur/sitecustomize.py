"""Breaks a process from within, for tests alone: Python imports this file at its start where PYTHONPATH leads to it.

SIGUSR1 carries out the order that stands in the file $CANBASE_SABOTAGE. The product has no way in for this.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from canbase_driver.cia301.frame import Frame
    from canbase_driver.core import DriverCore
    from canbase_driver.motion.kinematics import Twist2D
    from canbase_driver.motion.velocity_command import VelocityCommand
    from canbase_driver.ros.node import MotorDriverNode
    from canbase_driver.snapshot import DriverSnapshot
    from canbase_driver.supervision.stop_history import StopRecord

BUSY_S = 4.0
"""How long a thread is busy. It goes on afterwards, as one does that was only slow."""
FILE = "CANBASE_SABOTAGE"


class InjectedError(RuntimeError):
    """An exception that no part expects."""


def raise_error() -> NoReturn:
    """In the main thread, wherever it is."""
    raise InjectedError("injected")


def be_busy() -> None:
    """Turns round and round and holds Python's lock, as a defect in a loop does."""
    end_s = time.monotonic() + BUSY_S
    while time.monotonic() < end_s:
        pass


def break_control_thread() -> None:
    """The driver's next cycle raises."""
    from canbase_driver.core import DriverCore

    def tick(self: DriverCore, now_s: float, lateness_s: float = 0.0) -> list[Frame]:
        raise InjectedError("injected")

    DriverCore.tick = tick  # type: ignore[method-assign]


def hang_control_thread() -> None:
    """The driver's next cycle takes BUSY_S."""
    from canbase_driver.core import DriverCore

    usual = DriverCore.tick

    def tick(self: DriverCore, now_s: float, lateness_s: float = 0.0) -> list[Frame]:
        DriverCore.tick = usual  # type: ignore[method-assign]
        be_busy()
        return usual(self, now_s, lateness_s)

    DriverCore.tick = tick  # type: ignore[method-assign]


def repeat_setpoints() -> None:
    """The driver sends for ever what it sends next: controlword and target of each axis."""
    from canbase_driver.core import DriverCore

    usual = DriverCore.tick
    stuck: dict[int, Frame] = {}

    def tick(self: DriverCore, now_s: float, lateness_s: float = 0.0) -> list[Frame]:
        frames = usual(self, now_s, lateness_s)
        return [stuck.setdefault(f.cob_id, f) if 0x200 < f.cob_id < 0x380 else f for f in frames]

    DriverCore.tick = tick  # type: ignore[method-assign]


def ignore_zero() -> None:
    """The driver follows each command but zero."""
    from canbase_driver.motion.kinematics import Twist2D
    from canbase_driver.motion.velocity_command import VelocityCommand

    usual = VelocityCommand.target
    last = [Twist2D.ZERO]

    def target(self: VelocityCommand, now_s: float) -> Twist2D:
        wanted = usual(self, now_s)
        if wanted != Twist2D.ZERO:
            last[0] = wanted
        return last[0]

    VelocityCommand.target = target  # type: ignore[method-assign]


def withhold_odometry() -> None:
    """The driver works, and publishes no odometry any more."""
    from canbase_driver.ros.node import MotorDriverNode

    usual = MotorDriverNode.publish

    def publish(self: MotorDriverNode, snapshot: DriverSnapshot, stops: list[StopRecord]) -> None:
        usual(self, replace(snapshot, odometry=replace(snapshot.odometry, valid=False)), stops)

    MotorDriverNode.publish = publish  # type: ignore[method-assign]


ORDERS: Mapping[str, Callable[[], None]] = {
    order.__name__: order
    for order in (
        raise_error,
        be_busy,
        break_control_thread,
        hang_control_thread,
        repeat_setpoints,
        ignore_zero,
        withhold_odometry,
    )
}


def _obey(_number: int, _frame: FrameType | None) -> None:
    ORDERS[Path(os.environ[FILE]).read_text().strip()]()


if FILE in os.environ:
    signal.signal(signal.SIGUSR1, _obey)
