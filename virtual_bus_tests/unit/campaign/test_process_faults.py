"""Faults of processes, computer and disk in virtual time: each does what its sentence says, and the base stops."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from canbase_campaign.cruise import Cruise
from canbase_campaign.disk import StopDisk, WatchdogDisk
from canbase_campaign.faults import FAULTS
from canbase_campaign.robots import campaign_robot
from canbase_campaign.twins import JOYSTICK
from canbase_campaign.world import World
from canbase_runtime.latch_record import Record
from canbase_watchdog.latch import Entry

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


@pytest.mark.parametrize(("disk", "first", "second"), [
    (StopDisk("driver"), Record(), Record(code=1, number=1)), (WatchdogDisk(), Entry(), Entry(cause=1, number=1)),
])  # fmt: skip
def test_a_record_is_written_when_the_disk_answers_again(disk: Any, first: object, second: object) -> None:
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
