"""Has the inputs of mux and filter written to a file for each latched stop: the shell around input_ring.py."""

from __future__ import annotations

import os
import time
from pathlib import Path

from canbase_config.robot import Robot
from canbase_runtime.input_files import InputFiles, state_folder
from canbase_velocity.filter_node import FilterNode
from canbase_velocity.input_ring import InputRing, Stop, StopWatch, head, lines
from canbase_velocity.mux_node import MuxNode


class StopRecorder:
    """`record_due_stop` is called in each turn of the executor's thread; another thread writes."""

    def __init__(self, robot: Robot, inputs: InputRing, mux: MuxNode, safety: FilterNode) -> None:
        self._robot, self._inputs, self._mux, self._safety = robot, inputs, mux, safety
        self._watch = StopWatch()
        box = robot.black_box
        folder = state_folder(box.folder, os.environ, Path.home())
        self._files = InputFiles(folder, f"velocity_{robot.name}_", box.files, mux.get_logger().warning)

    def start(self) -> None:
        """The thread that writes."""
        self._files.start()

    def record_due_stop(self, now_s: float) -> None:
        """Keeps the state now and then; hands over what is due."""
        self._inputs.keep_recent(self._mux.core, self._safety.core, now_s)
        due = self._watch.due_stop(self._mux.core.driver_state(now_s), self._safety.estop_free, now_s)
        if due is not None:
            self._hand_over(due, time.time() - now_s)

    def finish(self, timeout_s: float) -> None:
        """Write what waits, at most for this long [s]."""
        if self._watch.open is not None:
            self._hand_over(self._watch.open, time.time() - time.monotonic())
        self._files.finish(timeout_s)

    def _hand_over(self, stop: Stop, wall_offset_s: float) -> None:
        inputs, robot, config = self._inputs.cut(), self._robot, self._safety.config
        self._files.submit(
            stop.at_s + wall_offset_s, stop.cause, lambda: lines(head(robot, config, stop, wall_offset_s), inputs)
        )
