"""Faults of processes, computer and disk in virtual time: each does what its sentence says, and the base stops."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from canbase_base import latch_record
from canbase_base.latch_record import Mark, Record
from canbase_campaign.clock import Clock, ComputerClock
from canbase_campaign.cruise import Cruise
from canbase_campaign.disk import StopDisk
from canbase_campaign.faults import FAULTS
from canbase_campaign.robots import campaign_robot
from canbase_campaign.twins import JOYSTICK
from canbase_campaign.world import World
from canbase_driver.snapshot import DriverSnapshot

AROUND: Any = SimpleNamespace()


def moving() -> World:
    """The joystick drives with 0.4 m/s, for ever."""
    world = Cruise(JOYSTICK, 0.4).world
    assert world.drives.bench.base.v_mps > 0.3
    return world


@pytest.mark.parametrize("name", ["driver_thread_stalls", "lease_of_older_version"])
def test_the_base_stands_and_stays(name: str) -> None:
    world = moving()
    FAULTS[name].begin(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 1.5)
    assert abs(world.drives.bench.base.v_mps) < 0.005


def test_a_driver_whose_topics_stall_stops_by_itself() -> None:
    world = moving()
    odometry: list[object] = []
    world.topics.subscribe("odom", world.action, odometry.append)
    FAULTS["driver_thread_stalls"].begin(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 0.1)
    odometry.clear()
    world.clock.run_until(world.clock.now_s + 1.4)
    assert abs(world.drives.bench.base.v_mps) < 0.005
    assert odometry == []
    FAULTS["driver_thread_stalls"].end(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 0.2)
    assert odometry != []


def test_leases_of_an_older_version_order_nothing() -> None:
    world = moving()
    before = sum(world.watchdog.core._leases.refused.values())
    FAULTS["lease_of_older_version"].begin(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 1.0)
    assert sum(world.watchdog.core._leases.refused.values()) > before
    assert world.watchdog.tripped
    FAULTS["lease_of_older_version"].end(world, AROUND, {})
    assert not world.lease_older


def test_a_record_is_written_when_the_disk_answers_again() -> None:
    disk, first, second = StopDisk("driver"), Record(), Record(code=1, number=1)
    assert disk.file.data is not None
    assert disk.write(first) == (first, "")
    data = bytes(disk.file.data)
    disk.file.hangs = True
    assert disk.write(second) == (first, "")
    assert bytes(disk.file.data) == data
    disk.file.hangs = False
    assert disk.write(second) == (second, "")
    assert bytes(disk.file.data) != data


def test_the_fault_of_the_disk_is_that_of_all_records() -> None:
    world = World(campaign_robot(), seed=3)
    files = [process.disk.file for process in (world.driver, world.watchdog, world.velocity)]
    FAULTS["disk_hangs"].begin(world, AROUND, {})
    assert all(file.hangs for file in files)
    FAULTS["disk_hangs"].end(world, AROUND, {})
    assert not any(file.hangs for file in files)


def test_the_clock_of_a_suspended_computer_does_not_run_and_its_timers_wait() -> None:
    world = Clock(100.0)
    computer = ComputerClock(world)
    calls: list[tuple[float, float]] = []
    world.run_until(101.0)
    computer.suspend()
    computer.after(0.5, lambda: calls.append((computer.now_s, world.now_s)))
    world.run_until(161.0)
    assert (computer.now_s, computer.suspended_s, calls) == (101.0, 0.0, [])
    computer.resume()
    assert (computer.now_s, computer.suspended_s) == (101.0, 60.0)
    world.run_until(170.0)
    assert calls == [(101.5, 161.5)]


def test_two_suspends_that_overlap_are_one() -> None:
    world = Clock(100.0)
    computer = ComputerClock(world)
    for at_s, do in ((101.0, computer.suspend), (102.0, computer.suspend), (103.0, computer.resume)):
        world.run_until(at_s)
        do()
    world.run_until(104.0)
    computer.resume()
    assert (computer.now_s, computer.suspended_s) == (102.0, 2.0)


# driving, and the joystick is held ── suspended ── no age shows the pause, and no wheel moves again
@pytest.mark.parametrize(("lasts_s", "without"), [(0.2, ""), (60.0, ""), (0.2, "watchdog"), (0.2, "driver")])
def test_a_base_whose_computer_was_suspended_stands_until_a_reset(lasts_s: float, without: str) -> None:
    """`without`: this process does not look for a suspend, and the other one does."""
    world = moving()
    if without:
        world.processes[without].core.on_suspend = lambda *_: None  # type: ignore[attr-defined]
    FAULTS["suspend"].begin(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + lasts_s)
    FAULTS["suspend"].end(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 2.0)
    assert abs(world.drives.bench.base.v_mps) < 0.005
    assert world.driver.latched
    if without != "watchdog":
        assert world.watchdog.trip_cause == "loop_late"


def test_no_pose_of_before_a_suspend_is_published_after_it() -> None:
    """The base drives on meanwhile; a pose that misses that counts as reset."""
    world = moving()
    poses: list[DriverSnapshot] = []
    world.topics.subscribe("odom", world.action, poses.append)
    FAULTS["suspend"].begin(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 0.2)
    before = len(poses)
    FAULTS["suspend"].end(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 3.0)
    assert len(poses) > before
    assert all(pose.odometry.pose_resets for pose in poses[before:])


def test_a_process_that_is_started_while_the_computer_is_suspended_waits_too() -> None:
    world = moving()
    FAULTS["watchdog_dies"].begin(world, AROUND, {})
    FAULTS["suspend"].begin(world, AROUND, {})
    FAULTS["watchdog_dies"].end(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 1.0)
    assert not world.watchdog.running
    FAULTS["suspend"].end(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 0.5)
    assert world.watchdog.running


@pytest.mark.parametrize(("rate", "since_s", "late"), [
    (0.0833, 0.0, "delayed by"), (-0.0833, 0.0, "stamped in the future"), (0.0005, 1000.0, "delayed by"),
    (0.0005, 10.0, ""),
])  # fmt: skip
def test_a_sender_whose_clock_is_off_is_not_followed_and_is_again_when_it_is_right(
    rate: float, since_s: float, late: str
) -> None:
    world = moving()
    given = {"source": "joystick", "rate": rate, "since_s": since_s}
    FAULTS["sender_clock_slewed"].begin(world, AROUND, given)
    world.clock.run_until(world.clock.now_s + 8.0)
    source = next(
        source for source in world.velocity.mux.decide(world.computer.now_s).sources if source.name == "joystick"
    )
    assert (late in source.reason) if late else source.reason == ""
    assert (abs(world.drives.bench.base.v_mps) < 0.005) is bool(late)
    FAULTS["sender_clock_slewed"].end(world, AROUND, given)
    assert world.velocity.clocks_behind == {}


def test_a_disk_that_returns_old_data_has_the_record_before_the_last_write_and_a_latched_stop_stays() -> None:
    world = moving()
    world.driver.stop()
    world.clock.run_until(world.clock.now_s + 1.0)
    assert world.driver.latched
    FAULTS["disk_returns_old_data"].begin(world, AROUND, {})
    assert world.driver.disk.found().record.mark is Mark.LIVE
    FAULTS["disk_returns_old_data"].end(world, AROUND, {})
    world.clock.run_until(world.clock.now_s + 2.0)
    assert world.driver.latched


def test_a_write_is_lost_once() -> None:
    disk = StopDisk("driver")
    clear = bytes(disk.file.data or b"")
    disk.write(Record(Mark.LIVE))
    disk.file.forget()
    disk.file.forget()
    assert bytes(disk.file.data or b"") == clear
    assert disk.found() == latch_record.Found(Record(), sequence=2)
    disk.write(Record(Mark.LATCHED))
    assert (disk.found().record.mark, disk.found().sequence) == (Mark.LATCHED, 3)
