"""A robot of guarded drives in virtual time: what stops it when its masters die, and when it gets no power.

0.4 m/s ──╮ the computer dies                 60 ms × 4 after the last request: quick stop, 2 m/s²
0         ╰────────────────────────────────── stands within 0.5 s
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import pytest

from canbase_config.watchdog import LIFE_TIME_FACTOR, guard_time_ms
from canbase_driver.boot.settings import StopsBy
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.cia301.life_guarding import Life
from canbase_sim.faults import apply
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State
from support.chain_world import World, world_of

FAST = Twist2D(0.4, 0.0)
PHASES = 7
"""Moments of the failure, 10 ms apart: they cover the time from one request to the next."""


def fail(world: World, kind: str, node_id: int = 1) -> None:
    apply(world.bench.nodes, node_id, kind, world.now_s, {})


def computer_dies(world: World) -> None:
    world.driver = world.watchdog = None


def watchdog_dies(world: World) -> None:
    world.watchdog = None


def driver_dies(world: World) -> None:
    world.driver = None


def cable_cut(world: World) -> None:
    for node in world.bench.nodes.values():
        node.line.cut = True


def nothing_reaches_the_drives(world: World) -> None:
    for node in world.bench.nodes.values():
        node.line.deaf = True


Act = Callable[[World], None]
MASTERS_DIE: tuple[tuple[Act, float], ...] = (
    (computer_dies, 0.5),
    (watchdog_dies, 0.5),
    (driver_dies, 0.55),  # the watchdog stops the drives, 0.3 s after the last heartbeat or SYNC
    (cable_cut, 0.5),
    (nothing_reaches_the_drives, 0.5),
)


@pytest.mark.parametrize("phase", range(PHASES))
@pytest.mark.parametrize(("act", "within_s"), MASTERS_DIE, ids=[act.__name__ for act, _ in MASTERS_DIE])
def test_it_stands_within_half_a_second(act: Act, within_s: float, phase: int) -> None:
    world = world_of("technosoft")
    world.drive(FAST, 1.0 + 0.01 * phase)
    assert world.truth.linear_mps == pytest.approx(0.4, abs=0.01)
    act(world)
    assert world.stands_after(2.0) < within_s
    assert not any(world.powered)


def test_the_boot_sets_the_guard_and_no_heartbeat_and_the_driver_says_so() -> None:
    world = world_of("technosoft")
    world.enable()
    values = world.node.dictionary.values
    assert (values[0x100C_00], values[0x100D_00], values[0x1017_00]) == (guard_time_ms(0.3), LIFE_TIME_FACTOR, 0)
    assert values[0x6007_00] == 1
    drive = world.snapshot.drives[0]
    assert (drive.stops_by_itself, drive.self_stop) == (True, "node guarding by the watchdog (100Ch, 100Dh, 6007h)")
    assert world.node.guarding.life is Life.GUARDED
    reports = [node.report for node in world.core._drives.nodes]
    assert all(report is not None and report.self_stop.by is StopsBy.NODE_GUARDING for report in reports)


def test_requests_are_no_frames_for_driver_and_watchdog_and_nothing_is_dropped() -> None:
    world = world_of("technosoft")
    world.drive(FAST, 2.0)
    assert world.snapshot.bus.dropped == 0
    assert world.watchdog is not None
    assert world.watchdog.dropped_frames == 0


@pytest.mark.parametrize("lacks", ["no_requests", "no watchdog"])
def test_a_drive_that_answers_no_request_gets_no_power_and_the_message_names_key_and_cure(lacks: str) -> None:
    """An adapter or a drive without remote frames; or a watchdog that does not run yet."""
    world = world_of("technosoft")
    if lacks == "no_requests":
        fail(world, "no_requests")
    else:
        world.watchdog = None
    world.run(4.0)
    assert not any(world.powered)
    assert world.core.state is DriverState.BOOTING
    told = " ".join(str(node.boot_error) for node in world.core._drives.nodes)
    assert "node guarding request" in told
    assert "remote frames (RTR)" in told
    assert "self_stop.node_guarding: false" in told
    fail(world, "heal")
    if world.watchdog is None:
        world.start_watchdog()
    world.run_until(DriverState.ENABLED, 5.0)


# at 0.4 m/s ── its firmware hangs, its controller answers on with an old byte ── 0.3 s both miss it
def test_a_stuck_toggle_bit_stops_the_base() -> None:
    world = world_of("technosoft")
    world.drive(FAST, 1.0)
    fail(world, "guard_stuck")
    assert world.stands_after(3.0) < 0.75
    assert world.core.state is DriverState.LATCHED
    assert world.core.finding.cause.value in ("drive silent", "watchdog tripped")


def test_a_toggle_bit_that_is_stuck_from_the_start_gets_no_power() -> None:
    """As with a drive that keeps its heartbeat: one frame that says operational is no answer to a request."""
    world = world_of("technosoft")
    for node_id in world.bench.nodes:
        fail(world, "guard_stuck", node_id)
    reached = world.run(4.0, lambda: any(world.powered))
    assert not reached
    told = " ".join(str(node.boot_error) for node in world.core._drives.nodes)
    assert "node guarding answers whose toggle bit never changes: it goes on to send heartbeats (1017h)" in told


def test_after_its_own_stop_a_reset_brings_it_back() -> None:
    world = world_of("technosoft")
    world.drive(FAST, 1.0)
    watchdog_dies(world)
    world.run(1.5)
    assert not any(world.powered)
    world.start_watchdog()
    world.run(2.0)
    assert world.recovered()


def test_a_drive_that_refuses_a_guard_time_is_not_booted_and_the_message_names_the_key() -> None:
    world = world_of("technosoft")
    guarded = world.node.dictionary

    def refuse(subindex: int, value: int) -> None:
        guarded.values[0x100C_00] = 0

    guarded.on_write(0x100C, refuse)
    world.run(3.0)
    assert not any(world.powered)
    (error,) = [node.boot_error for node in world.core._drives.nodes if node.boot_error]
    assert "100Ch:0" in error


def test_an_absent_100ch_is_explained_by_the_key_of_the_profile() -> None:
    world = World(world_of("technosoft").robot)
    entries = dict(world.node.dictionary.entries)
    entries.pop(0x100C_00)
    world.node.dictionary.entries = entries
    world.node.dictionary._indexes.discard(0x100C)
    world.run(3.0)
    errors = [node.boot_error for node in world.core._drives.nodes if node.boot_error]
    assert "self_stop.node_guarding" in errors[0]


# 0.3 m/s ── somebody else guards the drives too, as seldom as keeps them alive ── each answers once more ── trip
@pytest.mark.parametrize("period_s", [0.05, 0.1, 0.235])
def test_requests_of_another_master_would_keep_the_drives_alive_and_are_a_trip(period_s: float) -> None:
    world = world_of("technosoft")
    world.drive(FAST, 1.2)
    due = world.now_s

    def another() -> bool:
        nonlocal due
        if world.now_s >= due:
            due += period_s
            world.guard()
        assert world.watchdog is not None
        return world.watchdog.status.state is State.TRIPPED

    assert world.run(4.0, another), "nobody noticed"
    assert world.watchdog is not None
    verdict = world.watchdog.status.verdict
    assert verdict.cause is TripCause.FOREIGN_MASTER
    assert "more answers to node guarding than one each 0.060 s" in verdict.detail
    world.command = None
    assert world.stands_after(2.0) < 1.0


def test_answers_that_come_late_in_bursts_or_get_lost_are_no_sign_of_another_master() -> None:
    world = world_of("technosoft")
    world.drive(FAST, 1.2)
    assert world.watchdog is not None
    foreign = world.watchdog._observer._guards[1]
    random, at_s, held_s = Random(4), world.now_s, 0.0
    for _ in range(20000):
        at_s += 0.06
        held_s = max(held_s, at_s + random.choice((0.0,) * 50 + (0.1,)))
        if random.random() > 0.05:
            assert not foreign.too_fast(max(at_s, held_s))
