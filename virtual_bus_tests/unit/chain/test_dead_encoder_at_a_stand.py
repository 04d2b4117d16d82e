"""An encoder is dead while almost nothing, or nothing at all, is ordered: what the wheel really does, and until when.

    tap ── zero ordered ── let go          the drive's loop keeps its integrator, and pushes on at a "stand";
                                           without its power the wheel rolls out, and the loop begins anew

Driver, watchdog and simulated drives in virtual time; the fault is that of the left wheel. Times in s.
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from canbase_config.robot import Robot
from canbase_driver.cia402 import PowerGoal
from canbase_driver.drives.release_test import ReleaseTest
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim import faults
from canbase_sim.plant.base import PlantParameters
from canbase_sim.world.bench import Bench
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State
from support.chain_world import STEP_S, World, bench_robot, world_of

MISSING, AT_STAND = TripCause.MOTION_MISSING, TripCause.POWER_AT_STAND


@dataclass
class Course:
    """What the left wheel did: when it lost its power, how fast and how far it went, how it ended."""

    off_s: float = float("inf")
    peak_mps: float = 0.0
    way_m: float = 0.0
    end_mps: float = 0.0
    cause: TripCause = TripCause.NONE


def robot_with_watchdog(**keys: object) -> Robot:
    robot = bench_robot()
    return robot.model_copy(update={"watchdog": robot.watchdog.model_copy(update=keys)})


def lose(world: World) -> None:
    faults.apply(world.bench.nodes, 1, "encoder_lost", world.now_s, {})


def course(world: World, seconds: float, until_s: float = 0.0) -> Course:
    """`until_s`: then zero is commanded."""
    assert world.watchdog is not None
    start, before_m, seen = world.now_s, world.bench.base.travel_left_m, Course()
    while world.now_s < start + seconds:
        if world.now_s >= start + until_s - STEP_S / 2:
            world.command = Twist2D.ZERO
        world.run(STEP_S)
        seen.peak_mps = max(seen.peak_mps, abs(world.truth.v_left_mps))
        if not world.powered[0]:
            seen.off_s = min(seen.off_s, world.now_s - start)
    seen.way_m, seen.end_mps = abs(world.bench.base.travel_left_m - before_m), abs(world.truth.v_left_mps)
    seen.cause = world.watchdog.status.verdict.cause
    return seen


def tap(world: World, tap_s: float, speed: float, seconds: float = 4.0) -> Course:
    world.enable()
    lose(world)
    world.run(0.3)
    world.command = Twist2D(speed, 0.0)
    return course(world, seconds, tap_s)


def lost_in_the_stop(world: World, speed: float) -> Course:
    world.drive(seconds=1.0)
    world.command = Twist2D.ZERO
    assert world.run(2.0, lambda: abs(world.truth.v_left_mps) <= speed)
    lose(world)
    return course(world, 4.0)


@pytest.mark.parametrize(
    ("tap_s", "speed", "off_s", "peak_mps"),
    [
        (0.02, 0.3, 0.09, 0.05),
        (0.06, 0.02, 0.18, 0.6),
        (0.06, 0.1, 0.19, 0.65),
        (0.12, 0.05, 0.30, 1.25),
        (0.2, 0.1, 0.32, 1.35),
        (0.2, 0.3, 0.32, 1.35),
    ],
)
def test_after_a_tap_the_power_goes_and_the_wheel_rolls_out(
    tap_s: float, speed: float, off_s: float, peak_mps: float
) -> None:
    """60 ms at 0.1 m/s were enough for 8 m/s with nothing ordered, and nobody stopped it."""
    seen = tap(World(), tap_s, speed)
    assert seen.off_s <= off_s
    assert seen.peak_mps <= peak_mps
    assert seen.end_mps == 0.0
    assert seen.way_m <= 1.3


@pytest.mark.parametrize(
    ("speed", "off_s", "peak_mps"), [(0.02, 0.09, 0.35), (0.05, 0.13, 0.6), (0.1, 0.18, 0.95), (0.15, 0.23, 1.25)]
)
def test_an_encoder_that_is_lost_at_the_end_of_a_stop_is_no_stand(speed: float, off_s: float, peak_mps: float) -> None:
    """Zero is ordered already; the drive's own ramp asks for the last of the speed, and the encoder shows none."""
    seen = lost_in_the_stop(World(), speed)
    assert seen.off_s <= off_s
    assert seen.peak_mps <= peak_mps
    assert seen.end_mps == 0.0


@pytest.mark.parametrize("speed", [0.1, 0.15, 0.2, 0.25])
def test_an_encoder_that_is_lost_as_the_order_ends_is_no_stand_for_as_long_as_the_wheel_rolls(speed: float) -> None:
    """The emergency stop, at 2 m/s²: the order is gone before any rule has its time (docs/decisions/0041)."""
    world = World()
    world.drive(Twist2D(speed, 0.0), 1.5)
    lose(world)
    world.command = Twist2D.ZERO
    said, peak_mps = [], 0.0
    for _ in range(round(4.0 / STEP_S)):
        world.run(STEP_S)
        rolls_mps = abs(world.truth.v_left_mps)
        peak_mps = max(peak_mps, rolls_mps)
        if world.snapshot.standstill and rolls_mps > 0.05:
            said.append(rolls_mps)
    assert said == []
    assert peak_mps <= 1.6
    assert world.truth.v_left_mps == 0.0


def test_taps_add_up_until_the_watchdog_trips() -> None:
    world = World()
    causes = [tap(world, 0.06, 0.1, 1.0).cause]
    while causes[-1] is TripCause.NONE and len(causes) < 10:
        world.command = Twist2D(0.1, 0.0)
        causes.append(course(world, 1.0, 0.06).cause)
    assert causes[-1] is MISSING
    assert len(causes) <= 5


@pytest.mark.parametrize("kind", ["zlac8015d", "kinco"])
def test_a_drive_that_tells_no_torque_lets_go_at_each_stand(kind: str) -> None:
    world = world_of(kind)
    seen = tap(world, 0.06, 0.1)
    assert seen.off_s <= 0.25
    assert seen.peak_mps <= 0.9
    assert seen.end_mps == 0.0


@pytest.mark.parametrize("kind", ["zlac8015d", "kinco", "epos4"])
def test_after_an_order_of_less_than_one_bit_a_healthy_drive_lets_go_once_and_is_not_stopped(kind: str) -> None:
    """For the watchdog, which sees the setpoints alone, nothing is ordered."""
    world = world_of(kind)
    world.enable()
    world.command = Twist2D(0.2, 0.0)
    world.run(1.0)
    world.command = Twist2D(1e-5, 0.0)
    without = 0
    for _ in range(round(3.0 / STEP_S)):
        before = world.powered[0]
        world.run(STEP_S)
        without += before and not world.powered[0]
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause is TripCause.NONE
    assert without <= 1


def tapping(world: World, tap_s: float, each_s: float, seconds: float, *, until: TripCause) -> Course:
    """0.1 m/s for `tap_s`, again and again, until the watchdog trips."""
    assert world.watchdog is not None
    start, seen = world.now_s, Course()
    while world.now_s < start + seconds and seen.cause is TripCause.NONE:
        world.command = Twist2D(0.1 if (world.now_s - start) % each_s < tap_s else 0.0, 0.0)
        world.run(STEP_S)
        seen.peak_mps = max(seen.peak_mps, abs(world.truth.v_left_mps))
        seen.cause, seen.off_s = world.watchdog.status.verdict.cause, world.now_s - start
    assert seen.cause is until
    return seen


@pytest.mark.parametrize(("tap_s", "each_s", "off_s"), [(0.06, 0.3, 2.6), (0.06, 0.6, 5.0), (0.04, 0.2, 6.0)])
def test_taps_of_a_millimetre_and_less_are_found_without_torque_too(tap_s: float, each_s: float, off_s: float) -> None:
    """Each asks for 1.1 mm or 0.4 mm, and the wheel, which has not rolled out meanwhile, gets another push."""
    world = world_of("zlac8015d")
    world.enable()
    lose(world)
    assert tapping(world, tap_s, each_s, 8.0, until=MISSING).off_s <= off_s


@pytest.mark.parametrize("kind", ["zlac8015d", "epos4"])
@pytest.mark.parametrize(("tap_s", "each_s"), [(0.1, 0.6), (0.2, 1.0), (0.06, 0.3)])
def test_an_encoder_that_shows_itself_for_moments_is_found_between_taps(kind: str, tap_s: float, each_s: float) -> None:
    """4 ms of 0.2 s: each time a sign of life, and a contradiction that letting go must not forget."""
    world = world_of(kind)
    world.enable()
    drive = world.robot.drives[0]
    given = {"axis": drive.axis, "off_s": 0.2, "on_s": 0.004}
    faults.apply(world.bench.nodes, drive.node_id, "encoder_intermittent", world.now_s, given)
    seen = tapping(world, tap_s, each_s, 5.0, until=TripCause.FEEDBACK_IMPLAUSIBLE)
    assert seen.off_s <= 2.5
    assert seen.peak_mps <= 2.0


def never_lets_go(monkeypatch: pytest.MonkeyPatch) -> None:
    """A driver with a defect."""
    monkeypatch.setattr(ReleaseTest, "step", lambda self, wheels, rests, now_s: None)


@pytest.mark.parametrize(("kind", "cause"), [("generic", MISSING), ("kinco", AT_STAND)])
def test_after_a_tap_the_watchdog_does_not_rely_on_the_driver(
    kind: str, cause: TripCause, monkeypatch: pytest.MonkeyPatch
) -> None:
    never_lets_go(monkeypatch)
    seen = tap(world_of(kind), 0.06, 0.1)
    assert seen.cause is cause
    assert seen.off_s <= 0.45
    assert seen.peak_mps <= 1.9
    assert seen.end_mps == 0.0


def test_a_weak_push_at_a_stand_trips_as_well_and_says_what_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    never_lets_go(monkeypatch)
    world = World()
    seen = lost_in_the_stop(world, 0.012)
    assert seen.cause is AT_STAND
    assert seen.off_s <= 0.4
    assert seen.peak_mps <= 0.7
    assert world.watchdog is not None
    verdict = world.watchdog.status.verdict
    assert verdict.node_id == 1
    assert verdict.detail.startswith("left_wheel is ordered 0.000 m/s, reports 0.000 m/s and has been held with ")
    assert "% of the rated torque for 0.2" in verdict.detail
    assert "watchdog.stand_answer_s" in verdict.detail


def test_a_drive_that_does_not_obey_disable_operation_loses_its_power_by_disable_voltage(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Before the watchdog has to."""
    goal = ReleaseTest.goal
    monkeypatch.setattr(
        ReleaseTest,
        "goal",
        lambda self, now_s: PowerGoal.ON if goal(self, now_s) is PowerGoal.RELEASE else goal(self, now_s),
    )
    seen = tap(World(), 0.06, 0.1)
    assert seen.cause is TripCause.NONE
    assert seen.off_s <= 0.3
    assert seen.peak_mps <= 1.2


# --- what is no fault


def letting_go(world: World) -> bool:
    return world.core.lets_go


def count_of(world: World, seconds: float) -> int:
    """How often it let go."""
    times, before = 0, letting_go(world)
    end = world.now_s + seconds
    while world.now_s < end:
        world.run(STEP_S)
        times, before = times + (letting_go(world) and not before), letting_go(world)
    return times


def well(world: World) -> None:
    assert world.watchdog is not None
    assert world.watchdog.status.state is State.WATCHING, world.watchdog.status.verdict
    assert world.core.state is DriverState.ENABLED, world.core.finding


SLOPE_N = 30.0 * 9.81
"""Weight of the bench's robot: × the slope it is what pushes it."""


def lets_go_on_a_slope(world: World) -> None:
    world.drive(seconds=1.0)
    world.bench.base.push_n = 0.1 * SLOPE_N
    world.command = Twist2D.ZERO
    assert world.run(3.0, lambda: letting_go(world))


@pytest.mark.parametrize("slope", [0.03, -0.1, 0.2, -0.3])
def test_a_base_on_a_slope_lets_go_once_for_each_stop_and_rolls_a_millimetre(slope: float) -> None:
    world = World()
    world.drive(seconds=1.0)
    world.bench.base.push_n = SLOPE_N * slope
    world.run(1.0)
    world.command = Twist2D.ZERO
    assert world.run(2.0, lambda: world.core.snapshot(world.now_s).standstill)
    at_m = world.truth.x_m
    assert count_of(world, 4.0) == 1
    assert abs(world.truth.x_m - at_m) < 0.008
    assert abs(world.truth.linear_mps) < 0.001
    well(world)


def test_a_wheel_against_a_threshold_is_let_go_of_and_pushed_again_by_the_next_order() -> None:
    world = World()
    world.enable()
    faults.apply(world.bench.nodes, 1, "blocked", world.now_s, {})
    for _ in range(2):
        world.command = Twist2D(0.1, 0.0)
        world.run(0.06)
        world.command = Twist2D.ZERO
        assert count_of(world, 1.0) == 1
        assert world.bench.nodes[1].axes[0].motor.force_n == pytest.approx(0.0, abs=1.0)
    well(world)


def test_before_the_first_order_and_between_orders_nothing_is_let_go_of_again() -> None:
    world = World()
    world.enable()
    assert count_of(world, 3.0) == 0
    world.command = Twist2D(0.3, 0.0)
    assert count_of(world, 1.0) == 0
    world.command = Twist2D.ZERO
    assert count_of(world, 5.0) <= 1
    assert count_of(world, 5.0) == 0
    well(world)


def test_an_order_that_comes_meanwhile_waits_until_all_drives_are_back() -> None:
    world = World()
    lets_go_on_a_slope(world)
    world.command = Twist2D(0.3, 0.0)
    start = world.now_s
    assert world.run(1.0, lambda: not letting_go(world))
    assert world.now_s - start <= 0.1
    assert abs(world.truth.linear_mps) < 0.1
    world.run(1.0)
    assert world.truth.linear_mps == pytest.approx(0.3, abs=0.01)
    well(world)


def test_a_drive_that_does_not_come_back_is_a_latched_stop() -> None:
    world = World()
    lets_go_on_a_slope(world)
    faults.apply(world.bench.nodes, 1, "sto", world.now_s, {})
    world.run_until(DriverState.LATCHED, 2.0)
    assert world.core.finding.cause.value == "drive disabled"


def test_a_robot_that_wants_no_proof_is_never_let_go_of() -> None:
    world = World(robot_with_watchdog(stand_proof="none"))
    world.drive(seconds=1.0)
    world.bench.base.push_n = 0.1 * SLOPE_N
    world.command = Twist2D.ZERO
    assert count_of(world, 5.0) == 0
    well(world)


# --- frozen with nothing ordered at all


def frozen(kind: str, residue_mps: float, bandwidth_radps: float, push_n: float = 0.0) -> Course:
    """At standstill, after an order and its release: the encoder counts nothing from now on, and shows the residue."""
    world = World() if kind == "bench" else world_of(kind)
    body = PlantParameters(bandwidth_radps=bandwidth_radps)
    world.bench = Bench(world.robot, world.now_s, body)
    world.drive(seconds=0.5)
    world.bench.base.push_n = push_n
    world.command = Twist2D.ZERO
    world.run(1.0)
    drive = world.robot.drives[0]
    given = {"axis": drive.axis, "residue_mps": residue_mps}
    faults.apply(world.bench.nodes, drive.node_id, "encoder_ghost", world.now_s, given)
    return course(world, 2.5)


IMPLAUSIBLE = TripCause.FEEDBACK_IMPLAUSIBLE


@pytest.mark.parametrize("kind", ["bench", "zlac8015d"])
@pytest.mark.parametrize(("residue_mps", "off_s"), [(0.0005, 0.3), (0.003, 0.2), (-0.01, 0.2), (0.04, 0.2)])
def test_a_frozen_encoder_that_shows_a_residue_takes_the_power_with_nothing_ordered(
    kind: str, residue_mps: float, off_s: float
) -> None:
    """A stiff loop: 8.8 m/s at 0.5 mm/s before, with and without a torque that the drive reports."""
    seen = frozen(kind, residue_mps, 250.0)
    assert seen.cause is IMPLAUSIBLE
    assert seen.off_s <= off_s
    assert seen.peak_mps <= 0.65
    assert seen.end_mps == 0.0


@pytest.mark.parametrize("residue_mps", [0.00015, -0.00015])
def test_a_residue_below_what_606ch_may_show_is_found_by_the_torque(residue_mps: float) -> None:
    """The driver releases the wheel, and where the torque comes again the watchdog knows: no end, 10 m/s, before."""
    seen = frozen("bench", residue_mps, 250.0)
    assert seen.cause is AT_STAND
    assert seen.peak_mps <= 0.4
    assert seen.end_mps == 0.0


def test_a_coarse_606ch_hides_more_and_the_torque_finds_it() -> None:
    """One bit of 606Ch is 0.52 mm/s there, and four of them are no motion."""
    seen = frozen("generic", 0.0005, 250.0)
    assert seen.cause is AT_STAND
    assert seen.peak_mps <= 0.75


def test_a_watchdog_does_not_rely_on_the_driver_there_either(monkeypatch: pytest.MonkeyPatch) -> None:
    never_lets_go(monkeypatch)
    seen = frozen("bench", 0.00015, 250.0)
    assert seen.cause is AT_STAND
    assert seen.peak_mps <= 1.3


@pytest.mark.parametrize("push_n", [15.0, 40.0, 80.0])
@pytest.mark.parametrize("bandwidth_radps", [60.0, 250.0])
def test_somebody_who_leans_on_a_base_at_standstill_stops_nothing(push_n: float, bandwidth_radps: float) -> None:
    """Pushed for 0.5 s, and again from the other side."""
    world = World()
    world.bench = Bench(world.robot, world.now_s, PlantParameters(bandwidth_radps=bandwidth_radps))
    world.drive(seconds=0.5)
    world.command = Twist2D.ZERO
    world.run(1.0)
    for n in range(6):
        world.bench.base.push_n = (push_n, 0.0, -push_n, 0.0)[n % 4]
        world.run(0.5)
    well(world)
