"""The driver's setpoints once more: cmd_vel through its command timeout and limiter, beside the recorded ones. Pure.

The state of the driver is not replayed: as recorded, it follows commands while it is ENABLED and its controlword
enables the operation. Other states (ramp, quick stop, power off) are not compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from canbase_config.robot import Robot
from canbase_config.watchdog import WatchdogConfig, WatchedDrive
from canbase_driver.cia301.frame import Frame
from canbase_driver.motion.kinematics import Twist2D, wheel_speeds
from canbase_driver.motion.limiter import Limiter, MotionState
from canbase_driver.motion.velocity_command import Command
from canbase_driver.supervision.watchdog_link import STATE_COB_ID, WatchdogLink
from canbase_recording.recorded_inputs import RecordedInputs
from canbase_runtime.driver_state import DriverState
from canbase_watchdog import frames

CYCLES: Final = 2
"""A command may have been taken in so many cycles sooner or later: what the ramp does then is no difference."""
LASTING: Final = 3
"""So many cycles in a row make a difference."""
MOST_DIFFERENCES: Final = 20


@dataclass(frozen=True, slots=True)
class Setpoints:
    """One cycle: its time [s], the targets of the left and the right side [m/s], and whether all axes are enabled."""

    at_s: float
    left_mps: float
    right_mps: float
    enabled: bool


@dataclass(frozen=True, slots=True)
class SetpointDifference:
    """From and to [s], and where it is greatest: the targets of one side [m/s], recorded and replayed."""

    from_s: float
    until_s: float
    recorded_mps: float
    replayed_mps: float


@dataclass(frozen=True, slots=True)
class SetpointReplay:
    """`compared`: cycles in which the driver followed commands. `greatest_mps`: of all differences, small ones too."""

    compared: int
    greatest_mps: float
    tolerance_mps: float
    differences: tuple[SetpointDifference, ...]


def recorded_setpoints(inputs: RecordedInputs) -> list[Setpoints]:
    """Of each cycle in which all axes got one."""
    axes = _axes(inputs.watchdog)
    latest: dict[int, tuple[int, float]] = {}
    begin_s, found = math.nan, []
    for frame in inputs.frames:
        drive = axes.get(frame.cob_id)
        if drive is not None and (setpoint := frames.decode_setpoint(frame.data, drive.layout)) is not None:
            begin_s = frame.at_s if not latest else begin_s
            latest[frame.cob_id] = setpoint[0], setpoint[1] * drive.mps_per_bit
        elif frame.cob_id == frames.SYNC:
            if len(latest) == len(axes):
                found.append(_cycle(begin_s, axes, latest))
            latest = {}
    return found


def replay_setpoints(inputs: RecordedInputs, robot: Robot) -> SetpointReplay:
    """`robot`: as recorded, or another one."""
    cycles = recorded_setpoints(inputs)
    followed = list(_followed(inputs, robot, cycles))
    fastest = max(robot.limits.acceleration_mps2, robot.limits.deceleration_mps2)
    turning = max(robot.limits.angular_acceleration_radps2, robot.limits.angular_deceleration_radps2)
    step_mps = (fastest + turning * robot.base.track_m / 2.0) / robot.rates.control_hz
    bit_mps = max(abs(drive.mps_per_bit) for drive in inputs.watchdog.drives)
    tolerance_mps = CYCLES * step_mps + bit_mps
    off = [_worst(cycle, motion, robot) for cycle, motion in followed]
    greatest_mps = max((abs(recorded - replayed) for _, recorded, replayed in off), default=0.0)
    return SetpointReplay(len(off), greatest_mps, tolerance_mps, tuple(_differences(off, tolerance_mps)))


def _axes(config: WatchdogConfig) -> dict[int, WatchedDrive]:
    """By the identifier of the setpoint; the lower axis number of a node uses its first RPDO."""
    found: dict[int, WatchedDrive] = {}
    for node_id in {drive.node_id for drive in config.drives}:
        mine = sorted((drive for drive in config.drives if drive.node_id == node_id), key=lambda drive: drive.axis)
        found |= {frames.SETPOINT_RPDO[place] + node_id: drive for place, drive in enumerate(mine)}
    return found


def _cycle(at_s: float, axes: dict[int, WatchedDrive], latest: dict[int, tuple[int, float]]) -> Setpoints:
    def of(side: str) -> float:
        return next(latest[cob_id][1] for cob_id, drive in axes.items() if drive.side == side)

    return Setpoints(at_s, of("left"), of("right"), all(frames.asks_for_power(word) for word, _ in latest.values()))


def _followed(
    inputs: RecordedInputs, robot: Robot, cycles: Sequence[Setpoints]
) -> Iterator[tuple[Setpoints, MotionState]]:
    """The cycles in which the driver followed commands, each with what it would have ordered."""
    command, limiter = Command(robot.timeouts.command_s), Limiter(robot.limits, robot.base.track_m)
    watchdog = WatchdogLink(robot.timeouts.watchdog_s)
    command.take(Twist2D.ZERO, -math.inf)  # what moves at the begin was released before it
    events = iter(_events(inputs))
    event, state, before_s = next(events, None), DriverState.ENABLED.name, math.nan
    motion: MotionState | None = None
    for cycle in cycles:
        while event is not None and event[0] <= cycle.at_s:
            state = _take(command, watchdog, event, state)
            event = next(events, None)
        if not cycle.enabled or state != DriverState.ENABLED.name:
            motion, before_s = None, cycle.at_s
            continue
        if motion is None or not watchdog.reports:  # until its first state frame nobody knows how hard it brakes
            motion = _as_recorded(cycle, robot)
        else:
            hard = watchdog.brakes_hard(cycle.at_s)
            motion = limiter.step(motion, command.target(cycle.at_s), cycle.at_s - before_s, emergency=hard)
        before_s = cycle.at_s
        yield cycle, motion


Event = tuple[float, str, object]


def _events(inputs: RecordedInputs) -> list[Event]:
    commands = [(each.at_s, "command", Twist2D(each.linear_mps, each.angular_radps)) for each in inputs.commands]
    states = [(each.at_s, "state", each.values.get("state")) for each in inputs.of("motor_driver/state")]
    states_sent = (frame for frame in inputs.frames if frame.cob_id == STATE_COB_ID)
    watchdog = [(frame.at_s, "watchdog", Frame(frame.cob_id, frame.data)) for frame in states_sent]
    everything: list[Event] = [*commands, *states, *watchdog]
    return sorted(everything, key=lambda event: event[0])


def _take(command: Command, watchdog: WatchdogLink, event: Event, state: str) -> str:
    """The state of the driver after it."""
    at_s, what, value = event
    if isinstance(value, Twist2D):
        command.take(value, at_s)
    elif isinstance(value, Frame):
        watchdog.on_frame(value, at_s)
    elif what == "state":
        if value == DriverState.ENABLED.name != state:
            command.await_zero()
        return str(value)
    return state


def _as_recorded(cycle: Setpoints, robot: Robot) -> MotionState:
    linear_mps = (cycle.left_mps + cycle.right_mps) / 2.0
    return MotionState(Twist2D(linear_mps, (cycle.right_mps - cycle.left_mps) / robot.base.track_m))


def _worst(cycle: Setpoints, motion: MotionState, robot: Robot) -> tuple[float, float, float]:
    """Time [s], recorded and replayed target of the side that differs more [m/s]."""
    left_mps, right_mps = wheel_speeds(motion.twist, robot.base.track_m)
    sides = ((cycle.left_mps, left_mps), (cycle.right_mps, right_mps))
    recorded, replayed = max(sides, key=lambda side: abs(side[0] - side[1]))
    return cycle.at_s, recorded, replayed


def _differences(off: Sequence[tuple[float, float, float]], tolerance_mps: float) -> Iterator[SetpointDifference]:
    run: list[tuple[float, float, float]] = []
    found = 0
    for each in [*off, (math.inf, 0.0, 0.0)]:
        if abs(each[1] - each[2]) > tolerance_mps:
            run.append(each)
            continue
        if len(run) >= LASTING and found < MOST_DIFFERENCES:
            found += 1
            _, recorded, replayed = max(run, key=lambda one: abs(one[1] - one[2]))
            yield SetpointDifference(run[0][0], run[-1][0], recorded, replayed)
        run = []
