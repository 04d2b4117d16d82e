"""The driver in real time with drives of every kind; those marked real_bus can be pointed at real ones.

`pytest virtual_bus_tests/bus/test_drives.py`: simulated drives of all kinds; `--personality epos4`: of one kind.
`pytest virtual_bus_tests/bus --can-interface socketcan --can-channel can0 --personality epos4 --robot=FILE`: real ones.
"""

from __future__ import annotations

import time

import pytest

from canbase_driver.cia301.pdo import node_layout
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.snapshot import DriverSnapshot
from canbase_runtime.driver_state import DriverState
from support.crews import Crew
from support.drive_rig import Driver, Surroundings

pytestmark = pytest.mark.bus
ENABLED_WITHIN_S = 6.0
"""From the driver's start; some kinds boot twice, late, or answer slowly."""
OVERCURRENT = 0x2310


def wheels_as_ordered(snapshot: DriverSnapshot) -> bool:
    """Every wheel turns, and within a quarter as fast as its target says."""
    return all(
        abs(drive.target_radps) > 0.0
        and abs(drive.velocity_radps - drive.target_radps) < 0.25 * abs(drive.target_radps)
        for drive in snapshot.drives
    )


@pytest.mark.real_bus
def test_every_drive_is_enabled_and_turns_its_wheel_forward_backward_and_against_the_other_side(
    crew: Crew, driver: Driver
) -> None:
    driver.order(Twist2D.ZERO, ENABLED_WITHIN_S, lambda snapshot: snapshot.state is DriverState.ENABLED)
    start = driver.enabled()
    start_m = start.odometry.pose.x_m
    there = driver.order(
        driver.forward, 5.0, lambda s: s.odometry.pose.x_m > start_m + crew.way_m and wheels_as_ordered(s)
    )
    assert there.odometry.twist.linear_mps > 0.7 * crew.speed_mps
    there_m = there.odometry.pose.x_m
    back = driver.order(
        Twist2D(-crew.speed_mps, 0.0), 8.0, lambda s: s.odometry.pose.x_m < there_m and wheels_as_ordered(s)
    )
    assert back.odometry.twist.linear_mps < -0.7 * crew.speed_mps
    turn_radps = 2.0 * crew.speed_mps / crew.robot.base.track_m
    turned = driver.order(
        Twist2D(0.0, turn_radps),
        8.0,
        lambda s: s.odometry.twist.angular_radps > 0.7 * turn_radps and wheels_as_ordered(s),
    )
    sides = {drive.joint: drive.side for drive in crew.robot.drives}
    assert {sides[d.joint] for d in turned.drives if d.velocity_radps > 0.0} == {"right"}
    driver.order(Twist2D.ZERO, 3.0, lambda s: s.standstill and s.state is DriverState.ENABLED)
    driver.loop.request_shutdown()
    driver.loop.join(6.0)
    assert driver.loop.failure is None
    final, stops = driver.loop.next_snapshot(timeout_s=0.1)
    assert final is not None
    assert (final.finding.cause.value, [stop.cause for stop in driver.stops + stops]) == ("shutdown", ["shutdown"])


@pytest.mark.real_bus
def test_the_stop_request_and_the_reset_from_another_thread(driver: Driver) -> None:
    driver.enabled()
    driver.stop()
    driver.latched()
    assert [stop.cause for stop in driver.stops] == ["stop requested"]
    driver.reset()
    driver.enabled()
    driver.stop()
    driver.latched()
    driver.loop.request_shutdown()
    driver.loop.join(6.0)
    last, _ = driver.loop.next_snapshot(timeout_s=0.1)  # handed over though the state is the same
    assert last is not None
    assert (last.state, last.finding.cause.value) == (DriverState.LATCHED, "shutdown")


@pytest.mark.real_bus
def test_cycles_keep_their_grid_and_snapshots_come_at_the_rate_of_the_odometry(driver: Driver) -> None:
    first = driver.enabled()
    before, cycles = driver.snapshots, first.cycle.cycles
    last = driver.order(Twist2D.ZERO, 10.0, lambda snapshot: snapshot.time_s > first.time_s + 1.0)
    duration_s = last.time_s - first.time_s
    # generous: this machine may be busy, but no cycle may come twice or too early
    assert 0.5 * 100.0 * duration_s < last.cycle.cycles - cycles <= 100.0 * duration_s + 2
    assert 0.4 * 50.0 * duration_s < driver.snapshots - before <= 50.0 * duration_s + 2
    assert last.cycle.lateness_max_s >= 0.0


@pytest.mark.one_crew
def test_the_fault_of_one_drive_and_the_battery_of_all_stop_the_base_until_a_reset(
    crew: Crew, driver: Driver, around: Surroundings
) -> None:
    driver.driving()
    last = crew.robot.drives[-1]
    around.suffer(last.node_id, "fault", axis=last.axis, code=OVERCURRENT)
    faulty = driver.latched()
    assert faulty.finding.cause.value == "drive fault"
    assert f"{last.joint} (node {last.node_id}): 2310h over-current" in faulty.finding.detail
    driver.reset()
    driver.driving()
    for node_id in {drive.node_id for drive in crew.robot.drives}:
        around.suffer(node_id, "power_cycle", off_s=0.2)
    driver.latched()
    again = driver.heard_again()
    assert around.truth.standing_s > 0.2
    assert again.state is DriverState.LATCHED
    driver.reset(within_s=12.0)  # nobody saw the wheels stop: they must have rolled out
    driver.driving()

    def at_speed_and_right(snapshot: DriverSnapshot) -> bool:
        """Both are looked at at one moment, and at a constant speed."""
        measured_mps = snapshot.odometry.twist.linear_mps
        right = measured_mps == pytest.approx(around.truth.linear_mps, abs=0.03)
        return right and measured_mps > 0.97 * driver.forward.linear_mps

    driver.order(driver.forward, 5.0, at_speed_and_right)


@pytest.mark.one_crew
def test_frames_of_29_bits_that_look_like_the_drives_own_change_nothing(
    crew: Crew, driver: Driver, around: Surroundings
) -> None:
    for drive in crew.robot.drives:
        around.suffer(drive.node_id, "aliases")
    driven = driver.driving()
    assert driven.bus.dropped > 100
    assert not driver.stops
    assert driven.odometry.pose.x_m == pytest.approx(around.truth.x_m, abs=0.03)


@pytest.mark.one_crew
def test_a_defect_in_the_core_sends_quick_stops_ends_the_thread_and_is_kept(
    crew: Crew, driver: Driver, around: Surroundings, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver.driving()

    def defect(*_: object) -> None:
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr(driver.core, "_judge", defect)
    driver.loop.join(2.0)
    assert not driver.loop.is_alive()
    assert isinstance(driver.loop.failure, ZeroDivisionError)
    time.sleep(1.0)
    for drive in crew.robot.drives:
        node = tuple(each for each in crew.robot.drives if each.node_id == drive.node_id)
        cob_id = node_layout(drive.node_id, node, crew.robot).setpoint_cob_id(drive.axis)
        last = [data for _, heard, data in around.heard if heard == cob_id][-3:]
        assert [data[:2] for data in last] == [b"\x02\0"] * 3
        assert not any(any(data[2:]) for data in last)
    assert around.truth.standing_s > 0.3
    assert driver.try_reset().sentence == "not confirmed: motor_driver has ended"
