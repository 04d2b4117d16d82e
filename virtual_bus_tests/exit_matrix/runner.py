"""Runs rows of the matrix, one after the other, on one robot as long as that gets well again.

SPEED ────────╮ failure                    ╭┄┄ the joystick orders motion: nothing, where the stop holds
0     ────────╰────── stands ── QUIET_S ───┴── undo ── QUIET_S ── reset ── the next row drives
              │←time→│  by the simulator's ground truth; the limit by the layer that caught it (`layers.py`)

Where driver, watchdog or drives hold the stop, somebody orders motion on cmd_vel as well, until after `undo`.
"""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from signal import SIGKILL, SIGXCPU
from types import TracebackType
from typing import Final

from std_msgs.msg import Bool

from canbase_action_server.goal_errors import DriveError
from canbase_campaign.twins import SPEED_MPS
from canbase_sim.control import ControlError
from exit_matrix.driven_robot import CHANGES, Scene, sabotaged
from exit_matrix.evidence import Evidence
from exit_matrix.failures import SERVER, Row
from exit_matrix.log_evidence import Catch
from exit_matrix.stop_limits import Layer
from support.running_robot import RESTS_M, Standstill, own_domain, robot_on
from support.surroundings import scan

QUIET_S: Final = 1.0
RESTART_S: Final = 2.0
"""A process that was started again is at work by then."""
STANDS_WITHIN_S: Final = 6.0
"""Longer than any limit: what takes longer has not stopped."""
TRIES: Final = 3
"""To get a robot that drives: a loaded computer may starve the scanner or the client of this process."""
END_S: Final = 8.0
"""A process that ends by itself may take this long [s]."""


@dataclass(frozen=True, slots=True)
class Result:
    """What came of a row. `problem` is empty when it passed; without a `stop` it was not measured."""

    row: Row
    caught: tuple[Catch, ...] = ()
    stop: Standstill | None = None
    limit_s: float = 0.0
    problem: str = ""


class FailedError(AssertionError):
    """The robot did not do what the row demands."""


class Runner:
    """Owns the robot. Use it with `with`."""

    def __init__(self) -> None:
        self._after = ExitStack()
        self._scene: Scene | None = None
        self._restarted = False

    def __enter__(self) -> Runner:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._forget()

    def run(self, row: Row) -> Result:
        """The row, on a robot that is well. It never raises for what the robot does."""
        try:
            result = self._measure(row, self._driving_scene(row))
        except (AssertionError, DriveError, ControlError) as error:
            self._forget()
            return Result(row, problem=f"{type(error).__name__}: {error}")
        if row.ended == (SERVER, -SIGKILL):
            self._forget()  # for 20 s DDS takes a server that was killed for alive, and its clients with it
        return result

    def _driving_scene(self, row: Row) -> Scene:
        """A robot that drives at its speed, and to which nothing was done yet. Raises what the last try raised."""
        for _ in range(TRIES - 1):
            try:
                return self._start_driving(row)
            except (AssertionError, DriveError, ControlError) as error:
                print(f"{row.name}: once more, it does not drive yet: {error}")
                self._forget()
        return self._start_driving(row)

    def _start_driving(self, row: Row) -> Scene:
        scene = self._ready_scene()
        scene.start_driving(row.driven_by)
        return scene

    def _ready_scene(self) -> Scene:
        """The robot of the last row, made well; another one when it does not get well."""
        if self._scene is not None:
            try:
                self._scene.recover(restarted=self._restarted)
            except AssertionError:
                self._forget()
        if self._scene is None:
            self._scene = self._new_scene()
        return self._scene

    def _new_scene(self) -> Scene:
        folder = Path(self._after.enter_context(tempfile.TemporaryDirectory(prefix="canbase-exit-", dir="/tmp")))
        domain = self._after.enter_context(own_domain())
        robot = self._after.enter_context(robot_on(domain, changes=CHANGES, start=False, env=sabotaged(folder)))
        robot.stack.start()
        scene = Scene(robot)
        self._after.callback(scene.close)
        scene.scan.message, scene.estop.message = scan(), Bool(data=False)
        robot.wait_whole()
        return scene

    def _forget(self) -> None:
        self._scene = None
        self._after.close()

    def _measure(self, row: Row, scene: Scene) -> Result:
        evidence = Evidence(scene)
        moment_s = row.inject(scene)
        scene.robot.wait_standing(timeout_s=STANDS_WITHIN_S)
        stop = scene.robot.standstill_after(moment_s)
        _check_rest(scene, "by itself")
        catches = evidence.catches()
        caught = [layer for layer in row.caught_by if (layer.who, layer.cause) in catches]
        limit_s = min((layer.limit_s(scene.robot.robot, SPEED_MPS) for layer in caught), default=0.0)
        problem = judge(row, stop, caught, catches, limit_s)
        self._check_rest_of(row, scene)
        return Result(row, tuple((layer.who, layer.cause) for layer in caught), stop, limit_s, problem)

    def _check_rest_of(self, row: Row, scene: Scene) -> None:
        if row.latched_behind_filter:
            scene.push_straight(SPEED_MPS)
        if row.holds:
            scene.push(SPEED_MPS)
            _check_rest(scene, "when a joystick ordered it, or somebody on cmd_vel")
        scene.joystick.message = None
        _check_end(row, scene)
        row.undo(scene)
        running = len(scene.robot.stack.pids)
        scene.robot.stack.start()
        self._restarted = len(scene.robot.stack.pids) > running
        _check_rest(scene, "after it was undone", RESTART_S if self._restarted else QUIET_S)
        scene.straight.message = None


def judge(row: Row, stop: Standstill, caught: list[Layer], catches: set[Catch], limit_s: float) -> str:
    """What is wrong with a stop, in a sentence; empty when it is as it should be."""
    if not caught:
        expected = " or ".join(f"{layer.who}: {layer.cause}" for layer in row.caught_by)
        heard = ", ".join(sorted(f"{who}: {cause}" for who, cause in catches)) or "nobody"
        return f"expected that {expected} catches it; {heard} did"
    if stop.after_s > limit_s:
        return f"stood after {stop.after_s:.3f} s, limit {limit_s:.3f} s"
    return ""


def _check_rest(scene: Scene, when: str, for_s: float = QUIET_S) -> None:
    way_m = scene.robot.moved_since(time.monotonic(), for_s)
    if way_m >= RESTS_M:
        raise FailedError(f"moved {way_m * 1000.0:.1f} mm again {when}")


def _check_end(row: Row, scene: Scene) -> None:
    """The part that must end has ended, with its exit code; the others run."""
    stack = scene.robot.stack
    if row.ended is not None:
        part, exit_code = row.ended
        scene.node.wait_for(lambda: stack.death() is not None, END_S, f"the end of {part}")
        death = stack.death()
        if death is None or (death.part, death.exit_code) != (part, exit_code):
            raise FailedError(f"{death}; expected {part} with exit code {exit_code}")
        stack.end(part)
        return
    death = stack.death()
    if death is not None and (death.part, death.exit_code) == (row.starves, -SIGXCPU):
        stack.end(row.starves)
    elif death is not None:
        raise FailedError(str(death))
