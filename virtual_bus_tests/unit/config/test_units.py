"""What one bit of 60FFh means, and what the watchdog is told: the arithmetic by hand."""

from __future__ import annotations

import math

import pytest

from canbase_config.derive import order_hold_s, watchdog_config
from canbase_config.drive import Drive
from canbase_config.load import load_robot, sample
from canbase_config.profile import VelocityUnit
from canbase_config.stopping import max_wheel_mps, slowest_ramp_mps2
from canbase_config.units import m_per_count, motor_rev_per_s, mps_per_bit
from canbase_config.watchdog import WatchdogConfig
from support.crews import robot_with

UNITS: list[tuple[VelocityUnit, int, float]] = [
    ("rpm", 4096, 0.016666666666666666),  # 1 / 60 rev/s
    ("0.1rpm", 4096, 0.0016666666666666668),  # 0.1 / 60
    ("0.001rpm", 4096, 1.6666666666666667e-05),  # 0.001 / 60
    ("rev/s", 4096, 1.0),
    ("0.001rev/s", 4096, 0.001),
    ("counts/s", 4096, 0.000244140625),  # 1 / 4096
    ("0.1counts/s", 4096, 0.0000244140625),  # 0.1 / 4096
    ("counts/s", 1, 1.0),  # one count is one revolution
    ("counts/s", 10_000, 0.0001),
    ("rpm", 1, 0.016666666666666666),  # no counts in it
    ("counts/ms/65536", 2000, 1000.0 / 65536.0 / 2000.0),  # 16.16 fixed point, 1.0 is one count in 1 ms
    ("counts/ms/16384", 10_000, 1875.0 / 512.0 / 10_000.0 / 60.0),  # rpm × 512 × resolution / 1875
]


@pytest.mark.parametrize(("unit", "counts", "expected"), UNITS)
def test_one_bit_in_revolutions_of_the_motor_per_second(unit: VelocityUnit, counts: int, expected: float) -> None:
    assert motor_rev_per_s(unit, counts) == pytest.approx(expected, rel=1e-12)


def test_less_than_one_count_per_revolution_is_refused() -> None:
    with pytest.raises(ValueError, match="counts_per_motor_rev is 0, expected at least 1"):
        motor_rev_per_s("counts/s", 0)


def test_an_unknown_unit_is_refused_with_those_that_exist() -> None:
    with pytest.raises(ValueError, match="unknown, expected one of rpm, "):
        motor_rev_per_s("furlong", 4096)  # type: ignore[arg-type]


def drive(direction: int, gear_ratio: float, unit: VelocityUnit) -> Drive:
    return Drive.model_validate(
        {
            "joint": "wheel",
            "node_id": 1,
            "side": "left",
            "direction": direction,
            "gear_ratio": gear_ratio,
            "counts_per_motor_rev": 4096,
            "velocity_unit": unit,
        }
    )


def test_rim_speed_for_one_bit() -> None:
    # 1 rev/s of the motor / 20 = 0.05 rev/s of the wheel, × 2π × 0.1 m = 0.0314159 m/s
    assert mps_per_bit(drive(1, 20.0, "rev/s"), 0.1) == pytest.approx(0.031415926535897934, rel=1e-12)


def test_a_mirrored_drive_counts_backward() -> None:
    assert mps_per_bit(drive(-1, 20.0, "rev/s"), 0.1) == pytest.approx(-0.031415926535897934, rel=1e-12)


def test_full_speed_of_the_bench_in_bits() -> None:
    # 0.8 m/s / (2π × 0.1 m) = 1.27324 rev/s of the wheel, × 20 × 60 = 1527.887 rpm of the motor = 15278.87 × 0.1 rpm
    assert 0.8 / mps_per_bit(drive(1, 20.0, "0.1rpm"), 0.1) == pytest.approx(15278.874536821953, rel=1e-9)


def test_the_watchdog_is_told_what_the_bench_sample_says() -> None:
    config = watchdog_config(load_robot(sample("bench")).robot)

    assert config.bus_arguments == {
        "interface": "udp_multicast",
        "channel": "239.74.163.2",
        "port": 43113,
        "hop_limit": 0,
    }
    assert [(d.joint, d.node_id, d.axis, d.side) for d in config.drives] == [
        ("left_wheel", 1, 0, "left"),
        ("right_wheel", 2, 0, "right"),
    ]
    # 0.1 / 60 rev/s / 20 × 2π × 0.1 m = 52.3599 µm/s; the right one is mounted mirrored
    assert [d.mps_per_bit for d in config.drives] == pytest.approx([5.2359877e-05, -5.2359877e-05], rel=1e-7)
    assert (config.track_m, config.standstill_mps) == (0.5, 0.005)
    assert (config.acceleration_mps2, config.deceleration_mps2) == (0.8, 1.0)
    assert (config.lease_timeout_s, config.drive_heartbeat_s, config.feedback_timeout_s) == (0.25, 0.3, 0.1)
    assert (config.linear_mps, config.angular_radps, config.control_hz) == (0.8, 2.0, 100.0)
    assert (config.angular_acceleration_radps2, config.angular_deceleration_radps2) == (4.0, 5.0)
    assert [d.m_per_count for d in config.drives] == pytest.approx([7.6699e-06, -7.6699e-06], rel=1e-5)
    assert (config.max_wheel_mps, config.order_hold_s) == pytest.approx((0.8, 0.37))
    assert (config.target_tolerance_mps, config.target_tolerance_share, config.drive_lag_s) == (0.03, 0.03, 0.1)
    assert (config.motion_tolerance_mps, config.motion_tolerance_share, config.feedback_samples) == (0.05, 0.1, 5)
    assert (config.overspeed_factor, config.travel_tolerance_m) == (1.2, 0.05)
    assert (config.bus_failed_s, config.loop_late_s) == (0.1, 0.1)
    assert (config.motion_missing_s, config.motion_missing_m, config.jolt_mps2) == (0.25, 0.005, 20.0)
    assert (config.slow_wheel_share, config.slow_wheel_s, config.slowest_ramp_mps2) == pytest.approx((0.3, 0.5, 0.2))
    assert (config.twist_tolerance_mps, config.twist_tolerance_share, config.twist_s) == (0.01, 0.08, 0.5)
    assert [drive.answers_sync for drive in config.drives] == [True, True]
    assert config.lease_socket.endswith("canbase-bench/lease.sock")


def test_the_fastest_wheel_is_one_that_goes_straight_or_turns_in_place() -> None:
    bench = load_robot(sample("bench")).robot
    assert max_wheel_mps(bench) == 0.8  # in place: 2.0 rad/s × 0.5 m / 2 = 0.5 m/s
    wide = bench.model_copy(update={"base": bench.base.model_copy(update={"track_m": 1.0})})
    assert max_wheel_mps(wide) == pytest.approx(1.0, rel=1e-12)


def test_travel_of_the_rim_for_one_count() -> None:
    # 2π × 0.1 m / 20 / 4096 = 7.67 µm; the mirrored one counts backward
    assert m_per_count(drive(1, 20.0, "rev/s"), 0.1) == pytest.approx(7.669903939428206e-06, rel=1e-12)
    assert m_per_count(drive(-1, 20.0, "rpm"), 0.1) == pytest.approx(-7.669903939428206e-06, rel=1e-12)


def test_how_long_an_order_may_be_followed() -> None:
    bench = load_robot(sample("bench")).robot
    # command timeout 0.2 + two cycles 0.02 + latency 0.05 + 1.0 m/s² / 10 m/s³
    assert order_hold_s(bench) == pytest.approx(0.37)
    soft = bench.model_copy(update={"limits": bench.limits.model_copy(update={"jerk_mps3": 0.01})})
    # 1 m/s² is never reached: 2 × √(0.8 m/s / 0.01 m/s³) instead of 0.8 s
    assert order_hold_s(soft) == pytest.approx(0.27 + 2 * math.sqrt(80.0) - 0.8)
    quick = bench.model_copy(update={"limits": bench.limits.model_copy(update={"acceleration_mps2": 2.0})})
    assert order_hold_s(quick) == pytest.approx(0.47)


def test_the_watchdogs_configuration_survives_its_way_over_the_command_line() -> None:
    config = watchdog_config(load_robot(sample("example_can0")).robot)

    assert WatchdogConfig.from_json(config.to_json()) == config
    assert math.copysign(1.0, config.drives[1].mps_per_bit) == -1.0


def test_the_slowest_ramp_is_a_quarter_of_the_limits_or_what_robot_yaml_says() -> None:
    bench = load_robot(sample("bench")).robot
    assert slowest_ramp_mps2(bench) == pytest.approx(0.25 * 0.8)
    soft = bench.limits.model_copy(update={"angular_acceleration_radps2": 1.0})
    assert slowest_ramp_mps2(bench.model_copy(update={"limits": soft})) == pytest.approx(0.25 * 1.0 * 0.25)
    given = bench.watchdog.model_copy(update={"slowest_ramp_mps2": 0.7})
    assert watchdog_config(bench.model_copy(update={"watchdog": given})).slowest_ramp_mps2 == 0.7


def test_a_drive_with_a_clock_of_its_own_does_not_answer_each_sync() -> None:
    assert [drive.answers_sync for drive in watchdog_config(robot_with("roboteq")).drives] == [False, False]
