"""The hand on the joystick: starts joystick.py and says what to order."""

from __future__ import annotations

import subprocess
import sys

from vm.guest.system import BrokenPromiseError

NONE = "none"
TOPIC = "cmd_vel_joy"


class Stick:
    """One joystick, for all scenarios of a boot. It ends with this process."""

    def __init__(self, topic: str = TOPIC) -> None:
        words = [sys.executable, "-m", "vm.guest.joystick", topic]
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        if not self._process.stdout.readline():
            raise BrokenPromiseError("the joystick of the scenarios did not start")

    def order(self, speed_mps: float | None) -> None:
        """From now on, and again and again; None: let go."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{NONE if speed_mps is None else speed_mps}\n")
        self._process.stdin.flush()
