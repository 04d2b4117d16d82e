"""Which of the stops that robot.yaml describes are not certain: sentences with numbers, the key, and the way out.

What cannot be used at all is refused by `robot.py`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from canbase_config.errors import Loc
from canbase_config.stopping import (
    CYCLES_TO_SETPOINT,
    longest_quick_stop_s,
    max_wheel_mps,
    quick_stop,
    ramp,
    stuck_otherwise_s,
    stuck_s,
)

if TYPE_CHECKING:
    from canbase_config.drive import Drive
    from canbase_config.robot import Robot
    from canbase_config.safety import Scan

DISABLE_VOLTAGE: Final = 2
"""6007h: a drive that loses its masters lets its motor coast (CiA 402-2)."""

LONGEST_STUCK_S: Final = 1.0
"""A driver that hangs may be followed this long without a warning [s]."""
SLOWEST_HZ: Final = 50.0
"""Below this the peak speed of a wheel without an encoder is noticeably above that of the bench."""
RUNAWAY_MPS2: Final = 5.0
"""A wheel of the bench gains so much by the whole force of its motor, when its encoder is dead."""
_HALVINGS: Final = 30


def uncertain_stops(robot: Robot) -> Iterator[tuple[Loc, str]]:
    """The place of each in robot.yaml, and a sentence."""
    for index, drive in enumerate(robot.drives):
        sentence = _own_ramp(robot, drive) or _cut_short(robot, drive)
        if sentence:
            yield ("drives", index, "profile"), sentence
    if robot.watchdog.stand_proof == "none":
        yield ("watchdog", "stand_proof"), _unproven_stand(robot)
    if stuck_otherwise_s(robot) > LONGEST_STUCK_S:
        yield ("limits", "jerk_mps3"), _stuck(robot)
    if robot.rates.control_hz < SLOWEST_HZ:
        yield ("rates", "control_hz"), _slow_cycles(robot)
    yield from _unknown_ages(robot)
    yield from _short_ranges(robot)


def _short_ranges(robot: Robot) -> Iterator[tuple[Loc, str]]:
    for index, scan in enumerate(robot.safety.scans):
        needs_m = needed_range_m(robot, scan, robot.limits.linear_mps)
        if scan.range_m is not None and scan.range_m < needs_m:
            place: Loc = ("safety", "scan") if index == 0 else ("safety", "more_scans", index - 1)
            yield (*place, "range_m"), _short_range(robot, scan, scan.range_m, needs_m)


def _short_range(robot: Robot, scan: Scan, range_m: float, needs_m: float) -> str:
    slow_mps, fast_mps = 0.0, robot.limits.linear_mps
    for _ in range(_HALVINGS):
        middle = (slow_mps + fast_mps) / 2.0
        slow_mps, fast_mps = (
            (middle, fast_mps) if needed_range_m(robot, scan, middle) <= range_m else (slow_mps, middle)
        )
    return (
        f"limits.linear_mps {robot.limits.linear_mps:g} needs a scanner with a range of {needs_m:.2f} m: until the "
        f"base is stationary, by a scan as old as timeout_s; the range of {scan.topic} is {range_m:g} m, so straight "
        f"on, where no other scanner looks, the base drives at most {max(slow_mps, robot.safety.blind_mps):.2f} m/s"
    )


def needed_range_m(robot: Robot, scan: Scan, linear_mps: float) -> float:
    """From the scanner to the farthest corner of the footprint where the base is stationary again, straight on the way
    that the scanner looks [m]. As the safety filter has it (velocity_mux, obstacle.py, rule 6)."""
    safety = robot.safety
    moves_s = scan.timeout_s + 1.0 / robot.rates.command_hz + safety.reaction_s
    way_m = safety.stop_distance_m + linear_mps * moves_s + ramp(robot.limits, linear_mps).distance_m
    forward = math.cos(scan.yaw_rad) >= 0.0
    edge_m = safety.footprint.front_m - scan.x_m if forward else safety.footprint.rear_m + scan.x_m
    aside_m = max(safety.footprint.left_m - scan.y_m, safety.footprint.right_m + scan.y_m)
    return math.hypot(edge_m + safety.padding_m + way_m, aside_m + safety.padding_m)


def _unknown_ages(robot: Robot) -> Iterator[tuple[Loc, str]]:
    """Messages whose age nobody can know, and which speed that leaves."""
    for index, scan in enumerate(robot.safety.scans):
        place: Loc = ("safety", "scan") if index == 0 else ("safety", "more_scans", index - 1)
        if not scan.noisy:
            yield (*place, "noisy"), _simulated_scans(robot, scan.topic)
        elif not scan.same_clock:
            yield (*place, "same_clock"), _scans_of_any_age(robot, scan.topic)
    for name, source in robot.mux.sources.items():
        if not (source.stamped and source.same_clock):
            key = "same_clock" if source.stamped else "stamped"
            yield ("mux", "sources", name, key), _commands_of_any_age(robot, name)


def _simulated_scans(robot: Robot, topic: str) -> str:
    return (
        f"scans on {topic} may be of any age: noisy false is for a simulator, whose stamps are of another time; a real "
        f"base could meet what they do not show yet at {robot.limits.linear_mps:g} m/s"
    )


def _scans_of_any_age(robot: Robot, topic: str) -> str:
    return (
        f"how old the scans on {topic} are is unknown, so the base drives at most {robot.safety.blind_mps:g} m/s "
        "(safety.blind_mps) where no other scanner looks; same_clock true, with clocks that chrony or PTP keeps in "
        "step, lifts that"
    )


def _commands_of_any_age(robot: Robot, name: str) -> str:
    return (
        f"how old the commands of {name} are is unknown: after its last command the base drives "
        f"on for as long as the network delays them, up to {robot.limits.linear_mps:g} m each second; stamped commands "
        "with same_clock true end that"
    )


def _unproven_stand(robot: Robot) -> str:
    mute = [drive.joint for drive in robot.drives if drive.kind.options.torque == "none"]
    if mute:
        return (
            f"{', '.join(mute)} cannot be watched for a dead encoder at standstill: the drive reports no torque "
            "(options.torque of its profile), and after a short push of the joystick the wheel may run away; let_go "
            "takes its power off for a moment at each standstill"
        )
    return (
        "a dead encoder at standstill is detected only where its drive gives half of the rated torque for "
        f"watchdog.motion_missing_s ({robot.watchdog.motion_missing_s:g}); let_go takes the power off for a moment "
        "instead"
    )


def _stuck(robot: Robot) -> str:
    zero_s, other_s, mps = stuck_s(robot), stuck_otherwise_s(robot), robot.limits.linear_mps
    return (
        f"jerk_mps3 {robot.limits.jerk_mps3:g} draws every ramp out, and a driver that hangs and repeats its setpoints "
        f"looks like one on such a ramp: from {mps:g} m/s it is followed for up to {zero_s:.2f} s "
        f"({zero_s * mps:.2f} m) after an order of zero, and for up to {other_s:.2f} s ({other_s * mps:.2f} m) after "
        "another one; a higher jerk_mps3 makes it shorter"
    )


def _slow_cycles(robot: Robot) -> str:
    hz, missing_s = robot.rates.control_hz, robot.watchdog.motion_missing_s
    found_s = missing_s + CYCLES_TO_SETPOINT / hz
    return (
        f"with {hz:g} cycles a second a wheel whose encoder is dead keeps its power for up to {found_s:.2f} s "
        f"(watchdog.motion_missing_s {missing_s:g} and two cycles); a motor that gives it {RUNAWAY_MPS2:g} m/s² makes "
        f"it up to {RUNAWAY_MPS2 * found_s:.1f} m/s faster than ordered meanwhile; {SLOWEST_HZ:g} Hz or more make it "
        "less"
    )


def _own_ramp(robot: Robot, drive: Drive) -> str:
    kind = drive.kind
    if kind.options.ramps == "no":
        why = "it has no 6085h"
    elif kind.is_unproven("options.ramps") or kind.is_unproven("units.acceleration"):
        why = "the unit of its 6085h has no source"
    else:
        return ""
    stop = quick_stop(robot, max_wheel_mps(robot))
    return (
        f"the quick stop of a {kind.title} may not be the stated one, {stop.time_s:.2f} s and {stop.distance_m:.2f} m "
        f"from {max_wheel_mps(robot):g} m/s: {why}; measure it before the first drive (docs/commissioning.md)"
    )


def _cut_short(robot: Robot, drive: Drive) -> str:
    own, longest_s = drive.kind.self_stop, longest_quick_stop_s(robot)
    if own.abort_connection_code != DISABLE_VOLTAGE or longest_s <= robot.timeouts.drive_heartbeat_s:
        return ""
    return (
        f"a quick stop takes up to {longest_s:.2f} s; when driver and watchdog end meanwhile, a {drive.kind.title} "
        f"coasts after timeouts.drive_heartbeat_s ({robot.timeouts.drive_heartbeat_s:g}), as its profile's "
        "self_stop.abort_connection_code is 2; 3 would let it brake to the end"
    )
