"""Raw units against hand-worked numbers of one drive, and the round trip as a property."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.drive import Drive
from canbase_config.profile import VelocityUnit
from canbase_config.robot import Base
from canbase_driver.drive_units import AxisUnits
from support.crews import robot_with

# A wheel of 0.1 m radius behind a gear of 20: one motor revolution is 2π·0.1/20 = 0.0314159 m at the rim.
BASE = Base(wheel_radius_m=0.1, track_m=0.5)


def drive(unit: VelocityUnit = "rpm", direction: int = 1, counts: int = 4096) -> Drive:
    return Drive.model_validate(
        {
            "joint": "left_wheel",
            "node_id": 1,
            "side": "left",
            "direction": direction,
            "gear_ratio": 20.0,
            "counts_per_motor_rev": counts,
            "velocity_unit": unit,
        }
    )


@pytest.mark.parametrize(
    ("unit", "raw"),
    [
        # 0.5 m/s at the rim is 15.9155 motor revolutions per second
        ("rpm", 955),
        ("0.1rpm", 9549),
        ("0.001rpm", 954930),
        ("rev/s", 16),
        ("0.001rev/s", 15915),
        ("counts/s", 65190),
        ("0.1counts/s", 651899),
    ],
)
def test_half_a_metre_per_second_in_every_unit(unit: VelocityUnit, raw: int) -> None:
    units = AxisUnits(drive(unit), BASE)
    assert units.velocity_raw(0.5) == raw
    assert units.velocity_raw(-0.5) == -raw
    assert units.velocity_mps(raw) == pytest.approx(0.5, rel=0.01)


def test_a_mirrored_motor_turns_the_other_way_and_nothing_above_knows() -> None:
    mirrored = AxisUnits(drive(direction=-1), BASE)
    assert mirrored.velocity_raw(0.5) == -955
    assert mirrored.velocity_mps(-955) == pytest.approx(0.5, rel=0.001)
    assert mirrored.position_m(-4096) == pytest.approx(0.0314159, rel=1e-5)


def test_wheels_of_both_sides_differ_by_their_ratio_about_their_mean() -> None:
    base = Base(wheel_radius_m=0.1, track_m=0.5, wheel_ratio=1.02)
    left, right = (AxisUnits(drive().model_copy(update={"side": side}), base) for side in ("left", "right"))
    assert right.position_m(4096) / left.position_m(4096) == pytest.approx(1.02)
    assert (right.position_m(4096) + left.position_m(4096)) / 2.0 == pytest.approx(0.0314159, rel=1e-5)
    assert right.radius_m / left.radius_m == pytest.approx(1.02)


def test_one_turn_of_the_wheel() -> None:
    units = AxisUnits(drive(), BASE)
    assert units.position_m(20 * 4096) == pytest.approx(2.0 * math.pi * 0.1)


def test_a_position_beyond_32_bits_is_not_cut() -> None:
    units = AxisUnits(drive(), BASE)
    assert units.position_m(2**40) == pytest.approx(2**8 * units.position_m(2**32))


@pytest.mark.parametrize(("rim_mps", "raw"), [(1e9, 2**31 - 1), (-1e9, -(2**31)), (0.0, 0), (-0.0, 0)])
def test_the_target_saturates_at_32_bits(rim_mps: float, raw: int) -> None:
    assert AxisUnits(drive("0.001rpm"), BASE).velocity_raw(rim_mps) == raw


@pytest.mark.parametrize("rim_mps", [math.nan, math.inf, -math.inf])
def test_a_target_that_is_no_number_raises(rim_mps: float) -> None:
    with pytest.raises(ValueError, match="expected a finite number"):
        AxisUnits(drive(), BASE).velocity_raw(rim_mps)


@pytest.mark.parametrize(
    ("mps2", "raw"),
    # 1 m/s² is 31.831 motor revolutions per second each second, 1909.86 rpm/s
    [(1.0, 1910), (0.001, 2), (1e-9, 1), (1e12, 2**32 - 1)],
)
@pytest.mark.parametrize("direction", [1, -1])
def test_ramps_are_magnitudes_and_never_0(mps2: float, raw: int, direction: int) -> None:
    assert AxisUnits(drive(direction=direction), BASE).acceleration_raw(mps2) == raw


@pytest.mark.parametrize("mps2", [0.0, -1.0, math.nan, math.inf])
def test_a_ramp_that_is_no_ramp_raises(mps2: float) -> None:
    with pytest.raises(ValueError, match="expected a positive number"):
        AxisUnits(drive(), BASE).acceleration_raw(mps2)


@given(st.integers(-(2**31), 2**31 - 1), st.sampled_from([1, -1]))
def test_every_target_comes_back_from_si_as_it_was(raw: int, direction: int) -> None:
    units = AxisUnits(drive("0.1rpm", direction), BASE)
    assert units.velocity_raw(units.velocity_mps(raw)) == raw


def test_what_a_ramp_of_each_kind_of_drive_means(kind: str) -> None:
    robot = robot_with(kind)
    units = AxisUnits(robot.drives[0], robot.base)
    for mps2 in (0.5, 2.0):
        assert units.acceleration_mps2(units.acceleration_raw(mps2)) == pytest.approx(mps2, rel=0.01)
