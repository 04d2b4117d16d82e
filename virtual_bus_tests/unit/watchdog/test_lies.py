"""Every way to run away that is known, told to the real driver core and the simulated drives: who lies, and until when.

    lie ──── trip, by its cause ──── standstill: the drives' quick stop brakes with 2 m/s²

All of it in virtual time. The robot drives at 0.5 m/s, and wheels stand when they are slower than 5 mm/s.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, cast

import pytest

from canbase_driver.cia301.frame import Frame
from canbase_driver.core import DriverCore
from canbase_driver.motion.kinematics import Twist2D
from canbase_sim.frame import Frame as BenchFrame
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State
from support.chain_world import BITS_PER_MPS, STEP_S, World

SPEED = Twist2D(0.5, 0.0)
ARC = Twist2D(0.4, 0.8)
EMERGENCY_MPS2 = 2.0
COASTING_MPS2 = 0.35
"""What a simulated wheel loses without power. A drive whose sensor lies has its power taken, and does not brake."""

EachStep = Callable[[], None]
Edit = Callable[[int, int], int]
"""A target as it should be of a COB-ID, and what is made of it."""


def truthful() -> None:
    """Nothing to do in a step."""


def edited(frame: Frame, edit: Edit) -> Frame:
    if frame.cob_id not in (0x201, 0x202):
        return frame
    word, target = struct.unpack("<Hi", frame.data)
    return Frame(frame.cob_id, struct.pack("<Hi", word, edit(frame.cob_id, target)))


class LyingDriver:
    """The real driver, whose setpoints are changed on their way; `parrot`: it sends the last cycle for ever."""

    def __init__(self, driver: DriverCore, edit: Edit, parrot: bool = False) -> None:
        self._driver, self._edit = driver, edit
        self._parrot: list[Frame] | None = [] if parrot else None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._driver, name)

    def tick(self, now_s: float) -> list[Frame]:
        frames = self._driver.tick(now_s)
        if self._parrot is None:
            return [edited(frame, self._edit) for frame in frames]
        beats = [frame for frame in frames if frame.cob_id == 0x77F]
        self._parrot = self._parrot or [frame for frame in frames if frame.cob_id in (0x201, 0x202, 0x080)]
        return beats + self._parrot


def lies(world: World, edit: Edit, parrot: bool = False) -> None:
    world.driver = cast(DriverCore, LyingDriver(world.core, edit, parrot))


# --- the driver


def driver_repeats_its_last_setpoint(world: World) -> EachStep:
    lies(world, lambda cob_id, target: target, parrot=True)
    world.command = Twist2D.ZERO
    return truthful


def driver_doubles_its_targets(world: World) -> EachStep:
    lies(world, lambda cob_id, target: 2 * target)
    return truthful


def driver_turns_one_wheel_around(world: World) -> EachStep:
    lies(world, lambda cob_id, target: -target if cob_id == 0x201 else target)
    return truthful


def driver_gives_one_wheel_nothing(world: World) -> EachStep:
    lies(world, lambda cob_id, target: 0 if cob_id == 0x201 else target)
    return truthful


def driver_follows_half_of_a_stop(world: World) -> EachStep:
    begin = world.now_s
    straight = round(0.25 * BITS_PER_MPS)

    def at_least_half(cob_id: int, target: int) -> int:
        sign = 1 if cob_id == 0x201 else -1
        return sign * straight if world.now_s > begin and sign * target < straight else target

    lies(world, at_least_half)
    world.command = Twist2D.ZERO
    return truthful


def somebody_publishes_straight_to_cmd_vel(world: World) -> EachStep:
    """The filter orders zero, with its leases; the driver hears a command all the same."""
    world.leases = False
    sequence = 1_000_000

    def zero_leases() -> None:
        nonlocal sequence
        sequence += 1
        zero = lease_datagram(sequence, round(world.now_s * 1e9), Twist(0.0, 0.0), brakes_hard=False)
        assert world.watchdog is not None
        world.watchdog.on_lease(zero, None, world.now_s)

    return each(world, 0.02, zero_leases)


# --- the drive


def misread(world: World, edit: Edit) -> None:
    """The drives understand other targets than those on the bus."""
    hear = world.bench.on_frame

    def on_frame(frame: BenchFrame, now_s: float) -> None:
        hear(BenchFrame(frame.cob_id, edited(Frame(frame.cob_id, frame.data), edit).data), now_s)

    world.bench.on_frame = on_frame  # type: ignore[method-assign]


def drive_turns_30_percent_faster(world: World) -> EachStep:
    misread(world, lambda cob_id, target: round(1.3 * target) if cob_id == 0x201 else target)
    return truthful


def drive_turns_the_wrong_way(world: World) -> EachStep:
    misread(world, lambda cob_id, target: -target if cob_id == 0x201 else target)
    return truthful


def drive_runs_at_three_times_the_speed(world: World) -> EachStep:
    misread(world, lambda cob_id, target: 3 * target)
    return truthful


def drive_ignores_zero(world: World) -> EachStep:
    world.node.axes[0].faults.ignores_setpoints = True
    world.command = Twist2D.ZERO
    return truthful


def drive_reports_a_stuck_velocity(world: World) -> EachStep:
    axis = world.node.axes[0]
    axis.faults.stuck_velocity = axis.velocity()
    world.command = Twist2D.ZERO
    return truthful


def drive_reports_that_it_stands(world: World) -> EachStep:
    world.node.axes[0].faults.stuck_velocity = 0
    return truthful


def drive_has_a_frozen_encoder(world: World) -> EachStep:
    axis = world.node.axes[0]
    axis.faults.frozen_position = axis.position()
    return truthful


# --- another master


def each(world: World, period_s: float, do: Callable[[], None]) -> EachStep:
    due = world.now_s + 0.004  # between two cycles of the driver

    def when_due() -> None:
        nonlocal due
        if world.now_s >= due - STEP_S / 2:
            due += period_s
            do()

    return when_due


def master_sends_setpoints(world: World) -> EachStep:
    target = round(0.3 * BITS_PER_MPS)  # allowed as such
    return each(world, 0.01, lambda: world.inject(0x201, struct.pack("<Hi", 0x0F, target).hex()))


def master_sends_setpoints_and_syncs(world: World) -> EachStep:
    data = struct.pack("<Hi", 0x0F, round(0.3 * BITS_PER_MPS)).hex()

    def both() -> None:
        world.inject(0x201, data)
        world.inject(0x080, "")

    return each(world, 0.01, both)


def master_sends_syncs(world: World) -> EachStep:
    return each(world, 0.01, lambda: world.inject(0x080, ""))


def master_resets_a_node(world: World) -> EachStep:
    world.inject(0x000, "82 01")
    return truthful


def master_writes_the_target_by_sdo(world: World) -> EachStep:
    world.inject(0x602, "23 ff 60 00 00 00 00 00")
    return truthful


def master_ends_the_heartbeat_monitoring_of_a_node(world: World) -> EachStep:
    """From then on this drive turns on with its last setpoint when the computer fails (1016h:1 = 0)."""
    world.inject(0x601, "23 16 10 01 00 00 00 00")
    return truthful


def master_uses_the_quick_stop_pdo_to_enable(world: World) -> EachStep:
    world.inject(0x501, "0f 00")
    return truthful


def second_driver_beats(world: World) -> EachStep:
    return each(world, 0.1, lambda: world.inject(0x77F, "05"))


def another_device_has_the_watchdogs_node_id(world: World) -> EachStep:
    """Its heartbeat would keep drives alive that monitor one entry (1016h), when this computer fails."""
    return each(world, 0.1, lambda: world.inject(0x77E, "05"))


def one_drive_is_disabled_and_the_driver_does_not_mind(world: World) -> EachStep:
    lies(world, lambda cob_id, target: target, parrot=True)
    world.node.axes[0].fail(0x2310)
    return truthful


CASES: list[tuple[Callable[[World], EachStep], TripCause, float]] = [
    (driver_repeats_its_last_setpoint, TripCause.TARGET_OUTSIDE, 0.45),
    (driver_doubles_its_targets, TripCause.TARGET_OUTSIDE, 0.012),
    (driver_turns_one_wheel_around, TripCause.TARGET_OUTSIDE, 0.012),
    (driver_gives_one_wheel_nothing, TripCause.TARGET_OUTSIDE, 0.022),
    (driver_follows_half_of_a_stop, TripCause.TARGET_OUTSIDE, 0.75),
    (somebody_publishes_straight_to_cmd_vel, TripCause.TARGET_OUTSIDE, 0.45),
    (drive_turns_30_percent_faster, TripCause.MOTION_OUTSIDE, 0.15),
    (drive_turns_the_wrong_way, TripCause.MOTION_OUTSIDE, 0.35),
    (drive_runs_at_three_times_the_speed, TripCause.MOTION_OUTSIDE, 0.12),
    (drive_ignores_zero, TripCause.MOTION_OUTSIDE, 0.4),
    (drive_reports_a_stuck_velocity, TripCause.MOTION_OUTSIDE, 0.4),
    (drive_reports_that_it_stands, TripCause.FEEDBACK_IMPLAUSIBLE, 0.2),
    (drive_has_a_frozen_encoder, TripCause.FEEDBACK_IMPLAUSIBLE, 0.2),
    (master_sends_setpoints, TripCause.FOREIGN_MASTER, 0.05),
    (master_sends_setpoints_and_syncs, TripCause.SETPOINT_MISSING, 0.25),
    (master_sends_syncs, TripCause.FOREIGN_MASTER, 0.05),
    (master_resets_a_node, TripCause.FOREIGN_MASTER, 0.002),
    (master_writes_the_target_by_sdo, TripCause.FOREIGN_MASTER, 0.002),
    (master_ends_the_heartbeat_monitoring_of_a_node, TripCause.FOREIGN_MASTER, 0.002),
    (master_uses_the_quick_stop_pdo_to_enable, TripCause.FOREIGN_MASTER, 0.002),
    (second_driver_beats, TripCause.FOREIGN_MASTER, 1.1),
    (another_device_has_the_watchdogs_node_id, TripCause.FOREIGN_MASTER, 1.1),
    (one_drive_is_disabled_and_the_driver_does_not_mind, TripCause.DRIVE_DOWN, 0.13),
]
"""Who lies, what the watchdog calls it, and until when it must have tripped [s]."""


def watched(world: World) -> tuple[bool, TripCause]:
    assert world.watchdog is not None
    status = world.watchdog.status
    return status.state is State.TRIPPED, status.verdict.cause


def caught(begin: Callable[[World], EachStep], twist: Twist2D) -> tuple[TripCause, float, float, float]:
    """TripCause, seconds from the lie to the trip, from there to standstill, and the fastest wheel at the trip."""
    world = World()
    world.drive(twist, seconds=1.2)
    assert watched(world) == (False, TripCause.NONE)
    start, each_step = world.now_s, begin(world)

    def tripped() -> bool:
        each_step()
        return watched(world)[0]

    assert world.run(3.0, tripped), "nobody noticed"
    trip, cause, truth = world.now_s, watched(world)[1], world.truth
    fastest = max(abs(truth.v_left_mps), abs(truth.v_right_mps))

    def go_on() -> bool:
        each_step()
        return False

    world.run(2.5, go_on)
    assert world.truth.standing_s > 0.3, "the wheels still turn"
    return cause, trip - start, world.now_s - world.truth.standing_s - trip, fastest


@pytest.mark.parametrize(("begin", "cause", "within_s"), CASES, ids=[case[0].__name__ for case in CASES])
def test_each_lie_is_caught_in_time_and_ends_in_standstill(
    begin: Callable[[World], EachStep], cause: TripCause, within_s: float
) -> None:
    found, trip_s, stand_s, fastest_mps = caught(begin, SPEED)
    assert found is cause
    assert trip_s <= within_s + 1e-9
    brakes_mps2 = COASTING_MPS2 if cause is TripCause.FEEDBACK_IMPLAUSIBLE else EMERGENCY_MPS2
    assert stand_s <= fastest_mps / brakes_mps2 + 0.06


@pytest.mark.parametrize("begin", [driver_repeats_its_last_setpoint, driver_turns_one_wheel_around, drive_ignores_zero])
def test_in_a_curve_too(begin: Callable[[World], EachStep]) -> None:
    cause, trip_s, stand_s, fastest_mps = caught(begin, ARC)
    assert cause in (TripCause.TARGET_OUTSIDE, TripCause.MOTION_OUTSIDE)
    assert trip_s <= 0.5
    assert stand_s <= fastest_mps / EMERGENCY_MPS2 + 0.06


def test_from_standstill_somebody_straight_on_cmd_vel_does_not_get_far() -> None:
    world = World()
    world.enable()
    world.run(1.0)
    assert watched(world) == (False, TripCause.NONE)
    each_step, start, fastest_mps = somebody_publishes_straight_to_cmd_vel(world), world.truth, 0.0
    world.command = SPEED

    def note() -> bool:
        nonlocal fastest_mps
        each_step()
        fastest_mps = max(fastest_mps, abs(world.truth.linear_mps))
        return False

    world.run(2.0, note)
    assert watched(world) == (True, TripCause.TARGET_OUTSIDE)
    assert world.truth.standing_s > 1.5
    assert 0.01 < fastest_mps < 0.06
    assert world.truth.path_m - start.path_m < 0.006
