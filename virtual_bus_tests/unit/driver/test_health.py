"""What a drive measures beyond the limits of `health`, and the battery behind its supply. Times in s."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from sensor_msgs.msg import BatteryState

from canbase_config.health import Battery, Health
from canbase_driver.drives.health import CALM_S, HealthWatch, supply_v
from canbase_driver.ros import messages
from support.snapshots import LEFT, RIGHT, with_driver

LIMITS = Health(voltage_low_v=22.0, voltage_high_v=29.0, current_high_a=10.0, temperature_high_c=80.0)
STAMP = Time(sec=7)


def watched(values: dict[str, Any], limits: Health = LIMITS) -> tuple[str, ...]:
    """The keys that a left drive with these values is warned of."""
    drives = (dataclasses.replace(LEFT, **values), RIGHT)
    return tuple(excess.key for excess in HealthWatch(limits).check_drives(drives, 0.0))


@pytest.mark.parametrize(
    ("values", "keys"),
    [
        ({"voltage_v": 21.99}, ("voltage_low_v",)),
        ({"voltage_v": 22.0}, ()),
        ({"voltage_v": 29.0}, ()),
        ({"voltage_v": 29.01}, ("voltage_high_v",)),
        ({"current_a": 10.0}, ()),
        ({"current_a": 10.1}, ("current_high_a",)),
        ({"current_a": -10.1}, ("current_high_a",)),
        ({"temperature_c": 80.0}, ()),
        ({"temperature_c": 80.5}, ("temperature_high_c",)),
        ({"temperature_c": 90.0, "voltage_v": 10.0}, ("voltage_low_v", "temperature_high_c")),
        ({"voltage_v": math.nan, "current_a": math.nan, "temperature_c": math.nan}, ()),
        ({"voltage_v": math.inf}, ("voltage_high_v",)),
    ],
)
def test_a_value_beyond_its_limit_is_a_warning_and_one_that_is_not_measured_is_none(
    values: dict[str, Any], keys: tuple[str, ...]
) -> None:
    assert watched(values) == keys
    assert watched(values, Health()) == ()


def test_the_sentence_names_joint_value_limit_and_key() -> None:
    (low,) = HealthWatch(LIMITS).check_drives((dataclasses.replace(LEFT, voltage_v=21.318),), 0.0)
    assert low.text == "left_wheel_joint: supply 21.32 V is below health.voltage_low_v (22 V)"
    (hot,) = HealthWatch(LIMITS).check_drives((dataclasses.replace(LEFT, temperature_c=81.0),), 0.0)
    assert hot.text == "left_wheel_joint: temperature 81 °C is above health.temperature_high_c (80 °C)"


def test_a_value_at_its_limit_is_one_warning_until_it_has_been_inside_for_a_while() -> None:
    """0 above ── 0.1 inside ── 1 above ── from 1.1 on inside ── 11 the warning ends ── 12 above again."""
    watch = HealthWatch(LIMITS)

    def warned(temperature_c: float, now_s: float) -> bool:
        return bool(watch.check_drives((dataclasses.replace(LEFT, temperature_c=temperature_c),), now_s))

    assert warned(81.0, 0.0)
    assert warned(79.0, 0.1)
    assert warned(81.0, 1.0)
    assert warned(79.0, 1.0 + CALM_S - 0.01)
    assert not warned(79.0, 1.0 + CALM_S)
    assert warned(81.0, 2.0 + CALM_S)


def test_each_drive_and_each_limit_has_its_own_warning() -> None:
    watch = HealthWatch(LIMITS)
    hot = [dataclasses.replace(drive, temperature_c=90.0) for drive in (LEFT, RIGHT)]
    assert [excess.joint for excess in watch.check_drives(hot, 0.0)] == ["left_wheel_joint", "right_wheel_joint"]
    weak = [dataclasses.replace(LEFT, voltage_v=20.0), RIGHT]
    assert len(watch.check_drives(weak, 1.0)) == 3


@pytest.mark.parametrize(
    ("volts", "supply"),
    [((24.0, 25.0, 3.0), 24.0), ((24.0, math.nan), 24.0), ((24.0, 25.0), 25.0), ((math.nan, math.nan), math.nan)],
)
def test_the_supply_is_the_middle_one_of_what_the_drives_measure(volts: tuple[float, ...], supply: float) -> None:
    drives = [dataclasses.replace(LEFT, voltage_v=volt) for volt in volts]
    assert supply_v(drives) == pytest.approx(supply, nan_ok=True)


# --- the messages


def battery(voltage_v: float, **keys: Any) -> BatteryState:
    drives = (dataclasses.replace(LEFT, voltage_v=voltage_v), dataclasses.replace(RIGHT, voltage_v=voltage_v))
    return messages.battery_message(
        with_driver(drives=drives), STAMP, Battery(**({"full_v": 27.0, "empty_v": 22.0} | keys))
    )


@pytest.mark.parametrize(
    ("voltage_v", "share"), [(27.0, 1.0), (24.5, 0.5), (22.0, 0.0), (21.0, 0.0), (29.0, 1.0), (math.nan, math.nan)]
)
def test_the_charge_of_the_battery_is_linear_between_empty_and_full(voltage_v: float, share: float) -> None:
    message = battery(voltage_v)
    assert message.percentage == pytest.approx(share, nan_ok=True)
    assert message.voltage == pytest.approx(voltage_v, nan_ok=True)
    assert message.present == (not math.isnan(voltage_v))
    assert message.header.stamp == STAMP


def test_what_is_not_known_of_the_battery_is_nan_as_its_interface_wants_it() -> None:
    message = battery(25.0)
    unknown = (message.temperature, message.current, message.charge, message.capacity, message.design_capacity)
    assert [math.isnan(value) for value in unknown] == [True] * 5
    assert battery(25.0, design_capacity_ah=12.5).design_capacity == 12.5
    assert message.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_UNKNOWN


def test_the_status_has_the_warnings_of_each_drive() -> None:
    snapshot = with_driver(drives=(dataclasses.replace(LEFT, temperature_c=90.0, voltage_v=20.0), RIGHT))
    warnings = HealthWatch(LIMITS).check_drives(snapshot.drives, 0.0)
    left, right = messages.status_message(snapshot, STAMP, warnings).drives
    assert left.health == "; ".join(warning.text for warning in warnings)
    assert (left.temperature_c, left.voltage_v, right.health) == (90.0, 20.0, "")


@pytest.mark.parametrize(
    ("efforts_nm", "sent"),
    [((math.nan, math.nan), []), ((1.5, math.nan), [1.5, math.nan]), ((1.5, -2.0), [1.5, -2.0])],
)
def test_effort_is_there_for_all_wheels_or_for_none(efforts_nm: tuple[float, float], sent: list[float]) -> None:
    drives = [dataclasses.replace(drive, effort_nm=nm) for drive, nm in zip((LEFT, RIGHT), efforts_nm, strict=True)]
    message = messages.joint_state_message(with_driver(drives=tuple(drives)), STAMP)
    assert list(message.effort) == pytest.approx(sent, nan_ok=True)
