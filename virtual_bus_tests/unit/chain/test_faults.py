"""The whole chain in virtual time: what goes wrong at 0.3 m/s, how long until the base stands, what a reset then needs.

order to move ──►│ the fault        standstill │◄── measured by the simulator's ground truth
                 │◄────── bounded here ───────►│
"""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from canbase_config.derive import watchdog_config
from canbase_config.stopping import standstill_s
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.personality import PERSONALITIES
from canbase_watchdog.watchdog import Watchdog
from support.chain_world import FORWARD, KINDS, World, bench_robot, setpoints, world_of

OVERCURRENT = 0x2310
QUICK_STOP = 0x02
ALONE_S = {kind: PERSONALITIES[kind].alone_s(bench_robot().timeouts.drive_heartbeat_s) for kind in KINDS}
STOPS_ALONE = [kind for kind, alone_s in ALONE_S.items() if math.isfinite(alone_s)]
BRAKING_S = 0.3
"""From 0.3 m/s, by the drive's own ramp: 0.15 s by 6085h, 0.3 s by 6084h."""


@pytest.fixture
def world(kind: str) -> World:
    """At 0.3 m/s."""
    world = world_of(kind)
    world.drive()
    return world


def lose_leases(world: World) -> None:
    world.leases = False


def lose_filter(world: World) -> None:
    world.leases, world.command = False, None


def lose_watchdog(world: World) -> None:
    world.watchdog = None


def cut_the_drivers_cable(world: World) -> None:
    world.cable = False


def drive_fault(world: World) -> None:
    world.node.fail(0, OVERCURRENT)


def power_cycle(world: World) -> None:
    world.node.power_cycle(world.now_s, off_s=0.5)


def silence_a_drive(world: World) -> None:
    world.node.line.silent = True


def request_stop(world: World) -> None:
    world.core.request_stop()


Act = Callable[[World], None]
STOPS: tuple[tuple[Act, float, str], ...] = (
    (lose_leases, 0.45, "watchdog tripped"),
    (lose_filter, 0.45, "watchdog tripped"),
    (lose_watchdog, 0.6, "watchdog missing"),  # 0.2 s, and the driver's ramp where the drives do not stop by themselves
    (cut_the_drivers_cable, 0.5, "bus failed"),
    (drive_fault, 0.2, "drive fault"),
    (power_cycle, 0.85, "drive silent"),  # that wheel coasts, the other one brakes
    (silence_a_drive, 0.35, "drive silent"),
    (request_stop, 0.4, "stop requested"),
)


@pytest.mark.parametrize(("act", "within_s", "cause"), STOPS, ids=lambda value: getattr(value, "__name__", ""))
def test_at_03_mps_the_base_stands_within_half_a_second_and_is_latched(
    world: World, act: Act, within_s: float, cause: str
) -> None:
    act(world)
    assert world.stands_after() < within_s
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.LATCHED, cause)
    assert [(stop.cause, stop.latched) for stop in world.core.stops] == [(cause, True)]
    way_m = world.truth.path_m
    world.command = FORWARD
    world.run(1.0)
    assert world.truth.path_m == pytest.approx(way_m, abs=1e-6)


def test_a_driver_that_is_killed_is_stopped_by_the_watchdog(world: World) -> None:
    world.kill_driver()
    assert world.stands_after() < 0.5
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause.name == "DRIVER_SILENT"


@pytest.mark.parametrize("kind", STOPS_ALONE)
def test_driver_and_watchdog_both_killed_the_drives_stop_by_themselves(world: World, kind: str) -> None:
    world.kill_driver()
    world.watchdog = None
    assert world.stands_after() < ALONE_S[kind] + BRAKING_S


@pytest.mark.parametrize("kind", STOPS_ALONE)
def test_a_drive_that_is_cut_off_stops_by_itself_and_the_base_is_latched(world: World, kind: str) -> None:
    world.node.line.cut = True
    assert world.stands_after() < ALONE_S[kind] + BRAKING_S
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.LATCHED, "drive silent")


@pytest.mark.parametrize("kind", sorted(set(KINDS) - set(STOPS_ALONE)))
def test_a_drive_that_is_cut_off_and_has_nothing_to_stop_it_goes_on_alone(world: World, kind: str) -> None:
    """What `stops_by_itself` is about: only STO by a safety relay helps here."""
    world.node.line.cut = True
    world.run(3.0)
    assert (world.truth.v_left_mps, world.truth.v_right_mps) == pytest.approx((0.3, 0.0), abs=0.01)
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.LATCHED, "drive silent")
    assert not world.snapshot.drives[0].stops_by_itself


@pytest.mark.parametrize("kind", ["dryve_d1", "roboteq", "tmcm1636"])
def test_drives_that_are_deaf_to_pdos_for_a_lost_heartbeat_are_stopped_by_sdo(world: World, kind: str) -> None:
    """Without 6007h they leave NMT operational, and turn on; no watchdog is there to do anything about it.

    t   0  no watchdog ── 0.2  ramp ── 0.3  drives pre-operational ── their heartbeat ── quick stop by SDO
    """
    lost_at = world.now_s
    lose_watchdog(world)
    world.run(2.5)
    assert bytes.fromhex("2b 40 60 00 02 00 00 00") in world.sent(0x601, since=lost_at)
    assert world.powered == [False, False]


@pytest.mark.parametrize("pause_s", [0.03, 0.09, 0.15])
def test_a_pause_of_the_driver_is_not_taken_for_silence_of_its_drives(world: World, pause_s: float) -> None:
    """They say nothing without SYNC. The drives follow the last setpoint meanwhile, under the watchdog's eyes."""
    world.pause_driver(pause_s)
    world.run(0.5)
    assert (world.core.state, list(world.core.stops)) == (DriverState.ENABLED, [])
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, abs=0.01)


def test_a_drive_that_fell_silent_in_a_pause_of_the_driver_is_noticed(world: World) -> None:
    silence_a_drive(world)
    world.pause_driver(0.15)
    assert world.stands_after() < 0.35
    assert world.core.state is DriverState.LATCHED
    assert world.core.finding.cause.value in ("drive silent", "watchdog tripped")  # whoever looks first


def test_a_new_driver_takes_over_after_a_kill_and_needs_a_reset(world: World) -> None:
    world.kill_driver()
    world.run(0.6)
    world.start_driver()
    world.command = Twist2D.ZERO
    world.run_until(DriverState.LATCHED, within_s=1.5)
    world.run(1.5)
    assert world.core.state is DriverState.LATCHED
    assert world.recovered()


def test_a_fault_of_one_wheel_stops_both_within_one_cycle_of_knowing(world: World) -> None:
    world.node.fail(0, OVERCURRENT)
    failed_at = world.now_s
    # fault → answer to the next SYNC (10 ms) → next cycle (10 ms)
    world.run(0.022)
    assert [word for word, _ in setpoints(world.ticks[-1])] == [QUICK_STOP, QUICK_STOP]
    assert world.now_s - failed_at < 0.025
    assert world.core.finding.detail == "left_wheel (node 1): 2310h over-current"


def test_a_watchdog_that_restarts_unnoticed_stops_the_base_while_it_is_starting(world: World) -> None:
    world.watchdog = Watchdog(watchdog_config(world.robot), world.now_s)
    world.run(0.05)
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.STOPPING, "watchdog missing")


def run_beside_a_blind_watchdog(world: World, seconds: float) -> None:
    """A watchdog that says that all is well whatever it sees: what the driver does by itself."""
    world.watchdog = None
    for _ in range(round(seconds / 0.05)):
        world.inject(0x77E, "05")
        world.guard()
        world.inject(0x1FE, "01 00 80 00 14 00 00 00")
        world.run(0.05)


def test_a_wheel_that_does_not_stop_is_quick_stopped_and_latched_by_the_driver_alone(world: World) -> None:
    world.node.axes[0].faults.ignores_setpoints = True
    world.command = Twist2D.ZERO
    patience_s = standstill_s(world.robot)  # 2 × (0.8 s + 0.1 s of jerk) + 0.12 s of lag + 0.5 s
    assert patience_s == pytest.approx(2.42)
    run_beside_a_blind_watchdog(world, patience_s - 0.1)
    assert not world.core.stops
    assert world.truth.v_left_mps > 0.1
    run_beside_a_blind_watchdog(world, 0.7)  # since its ramp was at zero
    assert world.core.finding.cause.value == "did not stop"
    assert world.core.finding.detail.startswith("left_wheel turns at 0.3")
    run_beside_a_blind_watchdog(world, 2.0)
    assert world.core.state is DriverState.LATCHED
    assert world.truth.standing_s > 1.0


def test_a_wheel_that_does_not_stop_is_stopped_by_whoever_notices_first(world: World) -> None:
    world.node.axes[0].faults.ignores_setpoints = True
    world.command = Twist2D.ZERO
    assert world.stands_after(6.0) < 4.0
    assert world.core.state is DriverState.LATCHED


def test_a_velocity_of_16_mm_per_s_beside_an_encoder_that_is_still_is_noise_and_a_stand(world: World) -> None:
    world.command = Twist2D.ZERO
    world.run(5.0)
    bit_mps = watchdog_config(world.robot).drives[0].velocity_mps_per_bit
    for n in range(10):  # to and fro: one way it is no noise, and its drive would push against it
        world.node.axes[0].faults.stuck_velocity = round((-1) ** n * 0.016 / bit_mps)
        world.run(0.05)
    assert world.core.state is DriverState.ENABLED
    assert world.snapshot.standstill
    world.node.axes[0].faults.stuck_velocity = None
    world.run(3.5)
    assert world.core.state is DriverState.ENABLED
