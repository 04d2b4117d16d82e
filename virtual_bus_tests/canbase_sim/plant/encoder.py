"""The one sensor of a motor: 6064h, 606Ch and the drive's own loops all come from it, so they fail together.

A healthy encoder gives the truth. A faulty one counts another motion, or jumps: the velocity loop and the
quick-stop ramp of the drive then control what it shows, and the wheel does whatever the physics makes of that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class EncoderFault:
    """What a faulty encoder makes of the motion."""

    factor: float = 0.0
    """It counts the motion times this: 0 lost, -1 reversed, 0.5 scaled."""
    holds_speed: bool = False
    """The velocity keeps its last value, like a register that is no longer refreshed."""
    residue_mps: float | None = None
    """The velocity keeps this value; None: its last one."""
    off_s: float = 0.0
    """Above 0: the factor holds for this long, then all of the motion counts for `on_s`, and so on."""
    on_s: float = 0.0
    """0: as long as `off_s`."""
    most_mps: float = math.inf
    """It loses counts of a faster motion, and shows this speed."""
    jump_m: float = 0.0
    """So far it jumps ahead and back in turn, within one inner step ..."""
    every_s: float = 0.0
    """... once in this time."""


class Encoder:
    """Position and velocity as they are measured, positive in the motor's own positive direction."""

    def __init__(self, travel_m: Callable[[], float], step_s: float) -> None:
        """`travel_m`: true travel of the rim since the start; `step_s`: time between two calls of `sample`."""
        self._true_m, self._step_s = travel_m, step_s
        self._fault: EncoderFault | None = None
        self._factor = 1.0
        self._shown_m = self._at_m = 0.0
        self._time_s = self._sign = 0.0
        self._held_mps = 0.0

    @property
    def travel_m(self) -> float:
        """Travel as the encoder counts it [m]."""
        return self._shown_m + self._factor * (self._true_m() - self._at_m)

    @property
    def is_faulty(self) -> bool:
        """Something is wrong with it."""
        return self._fault is not None

    @property
    def closes_loop(self) -> bool:
        """A velocity loop on it can brake: it counts motion, all the time and in the right direction."""
        return self._fault is None or (self._fault.factor > 0.0 and not self._fault.holds_speed)

    @property
    def scale(self) -> float:
        """It counts the motion times this; 1 for one that counts none of it, or backward."""
        return self._factor if self.closes_loop else 1.0

    def suffer(self, fault: EncoderFault, speed_mps: float) -> None:
        """From now on `fault` holds; `speed_mps` was measured last."""
        self._count(fault.factor)
        self._fault, self._time_s, self._sign = fault, 0.0, 1.0
        self._held_mps = speed_mps if fault.residue_mps is None else fault.residue_mps

    def heal(self) -> None:
        """From now on it counts every motion; what it has missed is lost."""
        self._count(1.0)
        self._fault = None

    def follow(self, travel_m: Callable[[], float]) -> None:
        """From now on it counts another travel: that of a motor whose coupling to its wheel is broken."""
        self._shown_m, self._at_m = self.travel_m, travel_m()
        self._true_m = travel_m

    def sample(self, speed_mps: float) -> float:
        """One inner step at this true speed; the speed that is measured."""
        fault = self._fault
        if fault is None:
            return speed_mps
        self._time_s += self._step_s
        if fault.off_s:
            period_s = fault.off_s + (fault.on_s or fault.off_s)
            self._count(1.0 if self._time_s % period_s >= fault.off_s else fault.factor)
        if fault.most_mps < math.inf:
            self._count(min(1.0, fault.most_mps / max(abs(speed_mps), fault.most_mps)))
        if fault.holds_speed:
            return self._held_mps
        return self._factor * speed_mps + self._jump(fault)

    def _jump(self, fault: EncoderFault) -> float:
        """The speed that a jump looks like, in the step in which it comes."""
        if not fault.jump_m or self._time_s < fault.every_s:
            return 0.0
        self._time_s = 0.0
        by_m, self._sign = self._sign * fault.jump_m, -self._sign
        self._shown_m += by_m
        return by_m / self._step_s

    def _count(self, factor: float) -> None:
        """From now on the motion counts times this."""
        if factor != self._factor:
            self._shown_m, self._at_m = self.travel_m, self._true_m()
            self._factor = factor
