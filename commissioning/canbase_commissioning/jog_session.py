"""`canbase bus jog`: one wheel turns while a key is held on a terminal, and only then. Pure.

A terminal reports only key presses: a held key repeats, and a released key no longer does. So the first press
moves nothing, motion begins with the first repetition, and ends when the next one does not come in time.
"""

from __future__ import annotations

import math

from canbase_commissioning.powered_drives import PoweredDrives
from canbase_driver.cia301.frame import Frame

FIRST_S = 0.8
"""From the first press to the first repetition: 0.25 s to 0.66 s on usual terminals."""
HELD_S = 0.25
"""Between repetitions: 0.03 s to 0.1 s on usual terminals, and the delay of a remote one."""
IDLE_S = 1.0
"""This long after the last motion the voltage is switched off [s]."""
KEYS = {"w": 1, "\x1b[A": 1, "s": -1, "\x1b[B": -1}
"""Forward, arrow up; backward, arrow down. Every other key stops."""
QUIT = ("q", "\x04")
"""q and Ctrl-D; Ctrl-C comes as a signal."""


class DeadMan:
    """What the person wants, from key presses and their times alone [s, monotonic]."""

    def __init__(self) -> None:
        self._key = ""
        self._pressed_at = -math.inf
        self._is_held = False

    def press(self, key: str, now_s: float) -> None:
        """A key arrived. Another one than the last starts again."""
        in_time = now_s - self._pressed_at <= (HELD_S if self._is_held else FIRST_S)
        self._is_held = key in KEYS and key == self._key and in_time
        self._key, self._pressed_at = key, now_s

    def direction(self, now_s: float) -> int:
        """+1 forward, -1 backward, 0 stand."""
        if self._is_held and now_s - self._pressed_at > HELD_S:
            self._is_held, self._key = False, ""
        return KEYS[self._key] if self._is_held else 0


def split_keys(text: str) -> list[str]:
    """The single keys in what a terminal sent at once; arrow keys come as three characters."""
    keys = []
    while text:
        length = 3 if text.startswith("\x1b[") else 1
        keys.append(text[:length])
        text = text[length:]
    return keys


class JogSession:
    """One wheel under a dead-man key. `quit` ends it; its caller must then run safe_stop. Ticks raise RigError."""

    def __init__(self, rig: PoweredDrives, joint: str, speed_mps: float) -> None:
        """`speed_mps`: of the rim [m/s]. Raises KeyError for an unknown joint."""
        self._axis = rig.axes[joint]
        self._rig, self._joint, self._speed_mps = rig, joint, speed_mps
        self._dead_man = DeadMan()
        self._moved_at = -math.inf
        self.done = False

    @property
    def line(self) -> str:
        """What to show: state, speed, way."""
        state = "no status yet" if self._axis.state is None else self._axis.state.text
        way = f"{self._axis.position_rad / (2.0 * math.pi):+.3f} rev"
        return f"{self._joint}: {state}, {self._axis.velocity_mps:+.3f} m/s, {way}"

    def press(self, keys: str, now_s: float) -> None:
        """Characters from the terminal."""
        for key in split_keys(keys):
            self._dead_man.press(key, now_s)
            self.done = self.done or key in QUIT

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame."""
        self._rig.on_frame(frame, now_s)

    def tick(self, now_s: float) -> list[Frame]:
        """Power comes with the first request, and goes a while after the last one."""
        direction = self._dead_man.direction(now_s) if self._rig.ready else 0
        if direction:
            self._moved_at = now_s
            self._rig.speeds_mps = {self._joint: direction * self._speed_mps}
        elif now_s - self._moved_at <= IDLE_S:
            self._rig.speeds_mps = {self._joint: 0.0}
        else:
            self._rig.speeds_mps = {}
        return self._rig.tick(now_s)
