"""Wheels up: which way each wheel turns, and how far. One wheel at a time, slowly; a person enters what it did."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from canbase_commissioning.calibration import Scale, Turned, scale
from canbase_commissioning.guide import Ask, CommissionError, Script, Tell, Until, number, one_of, wait
from canbase_commissioning.powered_drives import RAMP_MPS2, PoweredDrives
from canbase_commissioning.self_stop_test import spin
from canbase_config.drive import Drive

FIRST_MPS = 0.03
"""The first motion ever: if the unit in robot.yaml is ten times too small, it is still slow."""
FIRST_S = 3.0
LEAST_SHARE = 0.05
"""An encoder that shows less of the ordered way does not count."""
TIMEOUT_FACTOR = 2.0
MOST_REVOLUTIONS = 100.0


@dataclass(frozen=True, slots=True)
class WheelFound:
    """What was found out about one wheel; `turned` None: its scale was not measured."""

    joint: str
    direction: int
    scale: Scale | None = None
    turned: Turned | None = None


class Seen(Enum):
    """What the person saw while one wheel was ordered forward. The values are the answers."""

    FORWARD = "forward"
    BACKWARD = "backward"
    NOTHING = "nothing"
    OTHER = "other"
    """Another wheel turned."""


AGAIN = ".again"
"""Ends the key of a question that is repeated after a correction."""


def find_direction(rig: PoweredDrives, drive: Drive, again: str = "") -> Script[WheelFound]:
    """Turns one wheel forward, as robot.yaml has it, and prompts. Raises CommissionError when something else happens.

    `again`: AGAIN after a correction.
    """
    joint = drive.joint
    yield Tell(f"{joint} turns now, at {FIRST_MPS:g} m/s, for {FIRST_S:g} s: it should turn forward. Watch it")
    yield from spin(rig, {joint: FIRST_MPS})
    start_m = rig.axes[joint].travel.travel_m
    yield wait(FIRST_S)
    moved_m = rig.axes[joint].travel.travel_m - start_m
    yield from rest(rig)
    if moved_m < -LEAST_SHARE * FIRST_MPS * FIRST_S:
        raise CommissionError(
            f"{joint}: the encoder (6064h) counts against the velocity that was ordered: exchange two phases of the "
            "motor or two tracks of the encoder, or set its polarity with the manufacturer's tool; do not drive it so"
        )
    text = f"Which way did {joint} turn: forward, backward, nothing, other (another wheel turned)?"
    seen: Seen = yield Ask(f"direction.{joint}{again}", text, one_of(Seen))
    if seen is Seen.OTHER:
        raise CommissionError(
            f"another wheel than {joint} turned: exchange node_id (or axis) of the drives in robot.yaml"
        )
    if seen is Seen.NOTHING or moved_m < LEAST_SHARE * FIRST_MPS * FIRST_S:
        raise CommissionError(
            f"{joint}: {'it was not seen to turn' if seen is Seen.NOTHING else 'it turned'}, its encoder moved by "
            f"{moved_m * 1000:.1f} mm: brake, coupling, encoder cable, or a scale that is far off in robot.yaml"
        )
    return WheelFound(joint, drive.direction * (1 if seen is Seen.FORWARD else -1))


def measure_scale(
    rig: PoweredDrives, drive: Drive, revolutions: float, speed_mps: float, again: str = ""
) -> Script[tuple[Scale, Turned]]:
    """Turns one wheel by `revolutions` as robot.yaml counts them, and prompts. Raises CommissionError,
    CalibrationError.

    `again`: AGAIN after a correction.
    """
    joint, rim_m = drive.joint, 2.0 * math.pi * rig.robot.base.radius_m(drive.side)
    confirm = f"Mark the top of {joint} (tape): it will make {revolutions:g} revolutions. Count them. Ready?"
    yield Ask(f"mark.{joint}{again}", confirm, confirms=True)
    axis = rig.axes[joint]
    start_m, integral = axis.travel.travel_m, _Integral(rig, joint)
    goal_m = revolutions * rim_m - braking_way_m(rig, speed_mps)
    rig.speeds_mps = {joint: speed_mps}
    needed_s = TIMEOUT_FACTOR * revolutions * rim_m / speed_mps + 3.0
    yield Until(lambda now_s: integral.add(now_s) and axis.travel.travel_m - start_m >= goal_m, needed_s)
    rig.speeds_mps = {joint: 0.0}
    yield Until(lambda now_s: integral.add(now_s) and abs(axis.velocity_mps) < rig.robot.base.standstill_mps, 5.0)
    yield Until(lambda now_s: not integral.add(now_s), 0.3)
    rig.speeds_mps = {}
    by_position = (axis.travel.travel_m - start_m) / rim_m
    text = f"How many revolutions did {joint} make, to a twentieth?"
    seen = yield Ask(f"revolutions.{joint}{again}", text, number(0.05, MOST_REVOLUTIONS))
    turned = Turned(by_position, integral.way_m / rim_m, float(seen))
    return scale(drive, turned), turned


def rest(rig: PoweredDrives) -> Script[None]:
    """Brings all wheels to rest, then takes the power away."""
    rig.speeds_mps = dict.fromkeys(rig.speeds_mps, 0.0)
    yield Until(lambda _now: rig.standing, 5.0)
    yield wait(0.3)
    rig.speeds_mps = {}
    yield Until(lambda _now: not rig.powered, 1.0)


def braking_way_m(rig: PoweredDrives, speed_mps: float) -> float:
    """Way of a rim from `speed_mps` to rest down the rig's ramp [m]."""
    return speed_mps**2 / (2.0 * min(RAMP_MPS2, rig.robot.limits.acceleration_mps2))


class _Integral:
    """The way of a wheel by its 606Ch [m]."""

    def __init__(self, rig: PoweredDrives, joint: str) -> None:
        self.way_m = 0.0
        self._axis = rig.axes[joint]
        self._at = rig.now_s

    def add(self, now_s: float) -> bool:
        """To be called each turn."""
        self.way_m += self._axis.velocity_mps * (now_s - self._at)
        self._at = now_s
        return True
