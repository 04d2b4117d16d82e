"""The processes of one robot, started and ended together. Used by `canbase up` and `canbase demo`.

Each part is a process of its own (`child.py`) that gets SIGTERM when this one dies, however it dies. The order of the
end: the sources of commands first, the parts that stop the robot last.
"""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final

from canbase_runtime.own_modules import module_command

START_ORDER: Final = ("sim", "watchdog", "velocity", "driver", "action-server")
END_ORDER: Final = ("action-server", "velocity", "driver", "watchdog", "sim")
WITHOUT_ROS: Final = ("sim", "watchdog")
GRACE_S: Final = 10.0
"""A part that still runs this long after SIGTERM is killed; the driver needs the time of its ramp [s]."""
POLL_S: Final = 0.02


@dataclass(frozen=True, slots=True)
class Death:
    """A part that ended by itself. `exit_code` is negative when a signal ended it."""

    part: str
    exit_code: int

    def __str__(self) -> str:
        if self.exit_code < 0:
            return f"{self.part} was ended by {signal.Signals(-self.exit_code).name}"
        return f"{self.part} ended by itself with exit code {self.exit_code}"


class Stack:
    """Runs the parts. With `with` they are ended at the latest when the block is left."""

    def __init__(
        self,
        config: Path,
        *,
        namespace: str = "",
        sim: bool,
        ros_args: Sequence[str] = (),
        logs: Path | None = None,
        env: Mapping[str, str] | None = None,
        quiet_sim: bool = False,
        stop_files: Path | None = None,
    ) -> None:
        """`sim`: simulated drives too. `ros_args`: for the parts with ROS. `logs`: a folder for the parts' output, one
        file each; None: they write to this terminal. `env`: their environment; None: that of this process.
        `quiet_sim`: the simulated drives print warnings only. `stop_files`: a folder for what `post_stop` needs; the
        caller then sends the stop frames after the end of driver and watchdog; None: they are sent by themselves."""
        self._config = config
        self._options = ["--config", str(config), *(["--namespace", namespace] if namespace else [])]
        self._ros_args = list(ros_args)
        stop_file = [] if stop_files is None else ["--stop-file", str(stop_files / "stop.json")]
        sim_options = ["--quiet"] if quiet_sim else []
        self._own_options = {"sim": sim_options, "driver": stop_file, "watchdog": stop_file}
        self._parts = [part for part in START_ORDER if sim or part != "sim"]
        self._logs = logs
        self._env = None if env is None else dict(env)
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Stack:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    @property
    def pids(self) -> dict[str, int]:
        """Process ids of the parts that were started."""
        return {part: process.pid for part, process in self._running.items()}

    def start(self) -> None:
        """Starts the parts that do not run; they find each other by themselves, in whatever order they get ready."""
        for part in self._parts:
            if part not in self._running:
                self._running[part] = self._spawn(part)

    def death(self) -> Death | None:
        """The first part found that has ended, None while all run."""
        for part, process in self._running.items():
            code = process.poll()
            if code is not None:
                return Death(part, code)
        return None

    def stop(self) -> dict[str, int]:
        """Ends all parts in order, the robot standing; exit codes. A part that does not end in time is killed."""
        return {part: self.end(part) for part in END_ORDER if part in self._running}

    def end(self, part: str) -> int:
        """Ends one part; its exit code. `start` starts it again."""
        return _end(self._running.pop(part))

    def log(self, part: str) -> str:
        """What a part has written, where output goes to files."""
        return "" if self._logs is None else (self._logs / f"{part}.log").read_text(errors="replace")

    def _spawn(self, part: str) -> subprocess.Popen[bytes]:
        argv = module_command("canbase_cli.child", str(os.getpid()), "serve", part, *self._options)
        argv += self._own_options.get(part, [])
        if part not in WITHOUT_ROS:
            argv += self._ros_args
        with ExitStack() as opened:
            log = None if self._logs is None else opened.enter_context((self._logs / f"{part}.log").open("ab"))
            # A session of its own: Ctrl-C reaches this process alone, and this one ends the parts in order.
            return subprocess.Popen(
                argv,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=None if log is None else subprocess.STDOUT,
                start_new_session=True,
                env=self._env,
            )


def _end(process: subprocess.Popen[bytes]) -> int:
    process.terminate()
    process.send_signal(signal.SIGCONT)  # a stopped process gets its SIGTERM only then
    try:
        return process.wait(GRACE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()
