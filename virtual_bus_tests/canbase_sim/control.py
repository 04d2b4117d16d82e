"""The simulator's control socket as clients see it: ground truth, its trace, faults. JSON lines on a Unix stream.

{"get": "truth"} → Truth's fields · {"get": "trace", "since": t} → rows · {"fault": {"node": 1, "kind": "silent"}}
Answers are {"truth": …}, {"trace": …}, {"done": …} or {"error": "what was expected"}. Times are CLOCK_MONOTONIC [s].
"""

from __future__ import annotations

import json
import socket
from pathlib import Path
from types import TracebackType
from typing import Any

from canbase_config.robot import Robot
from canbase_sim.world.bench import Truth
from canbase_sim.world.trace import Row

SOCKET_NAME = "sim.sock"


class ControlError(RuntimeError):
    """The simulator cannot be reached, went away, or refused a request; the text has the reason and the remedy."""


def control_path(robot: Robot) -> Path:
    """The default control socket of a robot's simulator: beside its lease socket."""
    return Path(robot.lease.socket).parent / SOCKET_NAME


class SimControl:
    """A connection to a running simulator. Raises ControlError; every answer comes within `timeout_s`."""

    def __init__(self, path: Path | str, timeout_s: float = 2.0) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(timeout_s)
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            raise ControlError(
                f"no simulator at {path} ({error.strerror}); start it with `canbase serve sim`"
            ) from error
        self._lines = self._socket.makefile("rb")

    def __enter__(self) -> SimControl:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Hang up."""
        self._lines.close()
        self._socket.close()

    def truth(self) -> Truth:
        """What the robot really does now."""
        return Truth(**self._ask({"get": "truth"}, "truth"))

    def trace(self, since: float) -> list[Row]:
        """The samples from the monotonic time `since` on; the simulator keeps two minutes."""
        return [tuple(row) for row in self._ask({"get": "trace", "since": since}, "trace")]

    def fault(self, node: int, kind: str, **arguments: Any) -> None:
        """Break something in one node; kinds and arguments are those of `faults.KINDS`."""
        self._ask({"fault": {"node": node, "kind": kind, **arguments}}, "done")

    def _ask(self, request: dict[str, Any], wanted: str) -> Any:
        try:
            self._socket.sendall(json.dumps(request).encode() + b"\n")
            line = self._lines.readline()
        except OSError as error:
            raise ControlError(f"the simulator does not answer ({error}); is it still running?") from error
        if not line:
            raise ControlError("the simulator hung up; is it still running?")
        answer = json.loads(line)
        if wanted not in answer:
            raise ControlError(str(answer.get("error", answer)))
        return answer[wanted]
