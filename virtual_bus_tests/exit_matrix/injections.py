"""What can be done to a scene: each breaks something for real, or makes it whole again."""

from __future__ import annotations

import time
from collections.abc import Callable
from signal import SIGCONT, Signals

from std_msgs.msg import Bool

from canbase_campaign.twins import SPEED_MPS
from exit_matrix.driven_robot import Scene

Inject = Callable[[Scene], float]
"""Breaks something; the moment from which the stop is measured (time.monotonic)."""
Undo = Callable[[Scene], None]


def nothing(scene: Scene) -> None:
    """It is over by itself, or is repaired by starting the process again."""


def sends(part: str, number: Signals) -> Inject:
    """A signal."""
    return lambda scene: scene.send_signal(part, number)


def breaks(part: str, order: str) -> Inject:
    """A defect inside the process, by the saboteur."""
    return lambda scene: scene.sabotage(part, order)


def resumes(part: str) -> Undo:
    """A process that was stopped goes on."""

    def undo(scene: Scene) -> None:
        scene.send_signal(part, SIGCONT)

    return undo


def ends(part: str) -> Undo:
    """The only cure of a process that is broken inside; it is started again before the next row."""

    def undo(scene: Scene) -> None:
        scene.robot.stack.end(part)

    return undo


def fault(kind: str, *nodes: int, **arguments: object) -> Inject:
    """A fault of simulated drives; of all of them without `nodes`."""
    return lambda scene: scene.fault(kind, *nodes, **arguments)


def heal(scene: Scene) -> None:
    """The simulated drives are whole again."""
    scene.fault("heal")


def then_zero(inject: Inject, wait_s: float = 0.2) -> Inject:
    """Breaks what shows only when the speed changes; measured from when the joystick orders zero."""

    def both(scene: Scene) -> float:
        inject(scene)
        scene.node.spin_for(wait_s)
        return scene.push(0.0)

    return both


def publish_straight(scene: Scene) -> float:
    """Past mux and filter, four times as often as these."""
    return scene.push_straight(SPEED_MPS)


def publish_no_more(scene: Scene) -> None:
    """The publisher on cmd_vel stops publishing."""
    scene.straight.message = None


def second_master(scene: Scene) -> float:
    """Another one sends setpoints."""
    return scene.begin_second_master()


def no_second_master(scene: Scene) -> None:
    """It is gone."""
    scene.end_second_master()


def joystick_dies(scene: Scene) -> float:
    """It stops publishing."""
    scene.joystick.message = None
    return time.monotonic()


def scan_dies(scene: Scene) -> float:
    """It stops publishing."""
    scene.scan.message = None
    return time.monotonic()


def estop_dies(scene: Scene) -> float:
    """It stops publishing."""
    scene.estop.message = None
    return time.monotonic()


def estop_pressed(scene: Scene) -> float:
    """The button publishes a press."""
    scene.estop.message = Bool(data=True)
    return time.monotonic()
