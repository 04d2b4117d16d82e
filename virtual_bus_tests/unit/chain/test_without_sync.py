"""Drives that refuse synchronous PDOs, with a profile that says nothing about it: boot, drive, stop, all that fails."""

from __future__ import annotations

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.frame import Frame as BenchFrame
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import Watchdog
from support.chain_world import FORWARD, World, world_of
from support.personalities import NO_SYNC, set_personality

CYCLE_S = 0.01


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    """Both drives have no 1005h: they heed no SYNC, and refuse types 1 to 240 (CiA 301)."""
    set_personality(monkeypatch, "generic", NO_SYNC)
    return world_of("generic")


def watchdog(world: World) -> Watchdog:
    assert world.watchdog is not None
    return world.watchdog


def tripped(world: World) -> bool:
    return watchdog(world).status.verdict.cause is not TripCause.NONE


def in_tune(world: World, period_s: float) -> None:
    """The clock of the left drive makes a cycle last so long."""
    for tpdo in world.node._tpdos:
        tpdo._inhibit = tpdo._period = period_s


def test_it_boots_drives_stops_and_each_pdo_without_sync_is_told(world: World) -> None:
    world.drive(seconds=1.0)
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, rel=0.02)
    notes = " ".join(world.snapshot.drives[0].boot_notes)
    for name in ("RPDO1", "TPDO1", "TPDO2"):
        assert f"{name} does not take type 1" in notes
    world.command = Twist2D.ZERO
    assert world.stands_after(1.5) < 0.6
    assert world.core.state is DriverState.ENABLED


def test_at_standstill_it_proves_life_in_every_cycle(world: World) -> None:
    world.enable()
    world.run(0.5)
    before = len(world.sent(0x181))
    world.run(1.0)
    assert len(world.sent(0x181)) - before == pytest.approx(100, abs=2)


@pytest.mark.parametrize("period_s", [0.008, 0.01, 0.012])
def test_a_clock_that_drifts_along_the_syncs_is_no_second_drive(world: World, period_s: float) -> None:
    world.enable()
    in_tune(world, period_s)
    world.command = FORWARD
    assert not world.run(10.0, lambda: tripped(world))


def test_tpdos_that_are_delivered_in_pairs_are_no_second_drive(world: World) -> None:
    """None between two SYNCs, then two: a timer that runs beside the SYNC, or an adapter that collects frames."""
    world.drive()
    tick = world.bench.tick
    held: list[BenchFrame] = []

    def in_pairs(now_s: float) -> list[BenchFrame]:
        said = tick(now_s)
        held.extend(frame for frame in said if frame.cob_id == 0x281)
        pairs = held[: len(held) // 2 * 2]
        del held[: len(pairs)]
        return [frame for frame in said if frame.cob_id != 0x281] + pairs

    world.bench.tick = in_pairs  # type: ignore[method-assign]
    world.run(3.0)
    assert watchdog(world).status.verdict.cause is not TripCause.ANSWERED_TWICE


@pytest.mark.parametrize("late_cycles", [0.0, 0.3])
def test_a_second_drive_with_its_node_id_trips(world: World, late_cycles: float) -> None:
    """It sends in the same moment, or 3 ms later."""
    world.drive()
    tick = world.bench.tick
    held: list[tuple[float, BenchFrame]] = []

    def twice(now_s: float) -> list[BenchFrame]:
        said = tick(now_s)
        held.extend((now_s + late_cycles * CYCLE_S, frame) for frame in said if frame.cob_id in (0x181, 0x281))
        due = [entry for entry in held if entry[0] <= now_s]
        held[:] = [entry for entry in held if entry[0] > now_s]
        return said + [frame for _, frame in due]

    world.bench.tick = twice  # type: ignore[method-assign]
    start = world.now_s
    assert world.run(1.0, lambda: tripped(world))
    assert watchdog(world).status.verdict.cause is TripCause.ANSWERED_TWICE
    assert world.now_s - start <= world.robot.timeouts.feedback_s + 0.05
