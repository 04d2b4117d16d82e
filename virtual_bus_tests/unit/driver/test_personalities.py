"""Driver and watchdog with every kind of drive that has a profile: boot, drive, stop, faults, in virtual time."""

from __future__ import annotations

import math

import pytest

from canbase_config.derive import watchdog_config
from canbase_config.profile_file import load_profile, profile_names
from canbase_config.robot import Robot
from canbase_config.stopping import standstill_s
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.personality import PERSONALITIES
from canbase_watchdog.post_stop import plan
from canbase_watchdog.trip_cause import TripCause
from support.chain_world import FORWARD, KINDS, World, world_of
from support.crews import robot_with


def test_every_profile_has_a_drive_on_the_bench_that_plays_it() -> None:
    assert set(KINDS) == set(profile_names())


def test_it_boots_and_drives_as_fast_as_ordered(kind: str) -> None:
    world = world_of(kind)
    world.run_until(DriverState.ENABLED, 5.0)
    world.run(0.1)
    world.command = FORWARD
    world.run(1.5)
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, rel=0.02)
    assert world.snapshot.odometry.twist.linear_mps == pytest.approx(world.truth.linear_mps, rel=0.05)
    assert world.truth.angular_radps == pytest.approx(0.0, abs=0.02)


def test_its_encoders_tell_the_way(kind: str) -> None:
    world = world_of(kind)
    world.drive(Twist2D(0.2, 0.3), 1.0)
    world.command = Twist2D.ZERO
    world.run(1.5)
    pose = world.snapshot
    assert pose.odometry.pose.x_m == pytest.approx(world.truth.x_m, abs=0.01)
    assert pose.odometry.pose.y_m == pytest.approx(world.truth.y_m, abs=0.01)
    assert pose.odometry.pose.yaw_rad == pytest.approx(world.truth.yaw_rad, abs=0.03)


def test_when_the_driver_dies_the_watchdog_stops_it(kind: str) -> None:
    world = world_of(kind)
    world.drive()
    world.kill_driver()
    assert world.run(1.0, lambda: world.truth.standing_s > 0.0)
    before_m = world.truth.path_m
    world.run(2.0)
    assert world.truth.path_m - before_m < 0.003


def test_stop_frames_of_a_process_that_knows_only_its_file_stop_it_when_everybody_else_is_dead(kind: str) -> None:
    world = world_of(kind)
    world.drive()
    world.kill_driver()
    world.watchdog = None
    for frames in plan(watchdog_config(world.robot)):
        for frame in frames:
            world.inject(frame.cob_id, frame.data.hex())
        world.run(0.01)
    assert world.stands_after() < 0.3


CYCLIC_KINDS = [kind for kind in KINDS if 9 in load_profile(kind).modes]


@pytest.mark.parametrize("kind", CYCLIC_KINDS)
def test_in_mode_9_the_ramp_is_the_drivers_own_and_60c2h_its_cycle(kind: str) -> None:
    world = world_of(kind, mode=9)
    world.drive(seconds=1.0)
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, rel=0.02)
    values = world.node.dictionary.values
    assert (values[0x6060_00], values[0x60C2_01], values[0x60C2_02]) == (9, 10, -3)
    world.command = Twist2D.ZERO
    assert world.stands_after(1.5) < 0.6
    assert world.core.state is DriverState.ENABLED


def test_an_inverter_follows_its_target_only_while_all_three_bits_of_its_ramp_are_set() -> None:
    world = world_of("inverter")
    world.drive(seconds=1.0)
    setpoints = world.sent(0x201)
    assert {len(data) for data in setpoints} == {4}
    assert setpoints[-1][:2] == bytes((0x7F, 0x00))
    world.command = Twist2D.ZERO
    assert world.stands_after(1.5) < 0.6


def test_an_inverter_that_loses_all_its_masters_stops_by_its_own_ramp() -> None:
    """Driver and watchdog end at 0.3 m/s: heartbeats are missed after 0.3 s, then 604Ah brakes with 2 m/s²."""
    world = world_of("inverter")
    world.drive()
    world.kill_driver()
    world.watchdog = None
    assert 0.3 < world.stands_after(2.0) < 0.6


COUNTING_KINDS = [kind for kind in KINDS if load_profile(kind).options.sync_counter != "no"]


@pytest.mark.parametrize("kind", COUNTING_KINDS)
def test_with_a_counter_in_sync_it_drives_as_without(kind: str) -> None:
    values = robot_with(kind).model_dump()
    values["bus"]["sync_counter"] = 7
    world = World(Robot.model_validate(values))
    world.drive(seconds=1.0)
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, rel=0.02)
    assert {len(data) for data in world.sent(0x080)} == {1}
    assert world.snapshot.drives[0].error_code == 0


def test_roboteq_stops_by_its_own_watchdog_a_second_after_the_last_command() -> None:
    world = world_of("roboteq")
    world.drive()
    world.kill_driver()
    world.watchdog = None
    world.run(0.9)
    assert world.truth.linear_mps > 0.2
    assert world.run(1.0, lambda: world.truth.standing_s > 0.0)


def test_the_driver_says_what_does_not_stop_by_itself(kind: str) -> None:
    world = world_of(kind)
    world.enable()
    told = [drive.stops_by_itself for drive in world.snapshot.drives]
    assert told == [PERSONALITIES[kind].heeds_masters] * 2


def test_a_power_cycle_while_driving_ends_disarmed_and_a_reset_brings_it_back(kind: str) -> None:
    world = world_of(kind)
    world.drive()
    world.node.power_cycle(world.now_s, 0.5)
    world.run_until(DriverState.LATCHED, 5.0)
    world.command = Twist2D.ZERO
    world.run(12.5)  # nobody saw the wheel stop: the watchdog waits until it must have rolled out
    assert world.core.state is DriverState.LATCHED
    assert not any(world.powered)
    world.reset()
    world.run_until(DriverState.ENABLED, 3.0)


def test_a_fault_stops_it_and_needs_a_reset(kind: str) -> None:
    world = world_of(kind)
    world.drive()
    world.node.fail(0, 0x2310)
    world.run_until(DriverState.LATCHED, 5.0)
    world.command = Twist2D.ZERO
    world.run(3.0)
    assert world.truth.standing_s > 0.5
    world.reset()
    world.run_until(DriverState.ENABLED, 3.0)


@pytest.mark.parametrize(
    ("kind", "code", "text"),
    [
        ("epos4", 0x8A88, "8A88h safe torque off (STO) is active"),
        ("elmo_gold", 0xFF00, "FF00h code of the manufacturer, see its error field"),
        ("elmo_gold", 0x8480, "8480h speed error too large"),
        ("technosoft", 0x5441, "5441h switched off by the enable or STO input"),
        ("nanotec", 0x7305, "7305h sensor 1 of 3204h"),
        ("kinco", 0xFF00, "FF00h device specific"),
        ("roboteq", 0x3210, "3210h over-voltage of the DC link"),
    ],
)
def test_a_fault_is_told_in_the_makers_words_where_the_profile_has_them(kind: str, code: int, text: str) -> None:
    world = world_of(kind)
    world.drive(seconds=0.3)
    world.node.fail(0, code)
    world.run_until(DriverState.LATCHED, 3.0)
    assert world.core.finding.detail == f"left_wheel (node 1): {text}"


@pytest.mark.parametrize(
    ("kind", "voltage_v", "current_a", "temperature_c"),
    [
        ("epos4", 24.0, 0.0, 31.2),
        ("roboteq", 24.0, 0.0, 31.0),
        ("elmo_gold", 24.0, math.nan, 38.0),
        ("kinco", math.nan, math.nan, math.nan),
    ],
)
def test_what_it_measures_besides_is_read_now_and_then(
    kind: str, voltage_v: float, current_a: float, temperature_c: float
) -> None:
    world = world_of(kind)
    world.drive(seconds=3.0)
    drive = world.snapshot.drives[1]
    measured = (drive.voltage_v, drive.current_a, drive.temperature_c)
    assert measured == pytest.approx((voltage_v, current_a, temperature_c), abs=0.02, nan_ok=True)
    assert world.core.state is DriverState.ENABLED


@pytest.mark.parametrize("kind", ["elmo_gold", "epos4", "roboteq"])
def test_answers_to_what_it_measures_are_no_feedback(kind: str) -> None:
    """Its voltage is read and answered four times a second; its motion is not reported any more."""
    world = world_of(kind)
    world.drive()
    world.node.lose_feedback(0)
    lost_at = world.now_s
    world.run_until(DriverState.STOPPING, world.robot.timeouts.feedback_s + 0.05)
    world.run(lost_at + world.robot.timeouts.feedback_s + 0.05 - world.now_s)
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause is TripCause.DRIVE_SILENT
    assert any(frame.cob_id == 0x601 for at_s, frame in world.log if at_s > lost_at - 0.5)


def test_a_drive_with_an_rpdo_timer_tells_that_the_setpoints_stay_away() -> None:
    world = world_of("dryve_d1")
    world.drive(seconds=0.3)
    killed_at = world.now_s
    world.kill_driver()
    world.run(0.5)
    assert "50 82" in [data[:2].hex(" ") for data in world.sent(0x081, since=killed_at)]


def test_a_lost_watchdog_stops_an_epos4_and_a_reset_brings_it_back_with_the_next_one() -> None:
    world = world_of("epos4")
    world.drive()
    watchdog, world.watchdog = world.watchdog, None
    world.run(1.0)
    assert world.truth.standing_s > 0.2
    world.watchdog = watchdog
    world.command = Twist2D.ZERO
    world.run(standstill_s(world.robot))  # its node left OPERATIONAL: nothing tells the driver that it stands
    assert world.recovered()
