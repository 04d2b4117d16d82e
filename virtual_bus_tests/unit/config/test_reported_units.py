"""Units that a drive reports, against robot.yaml: what contradicts, what proves nothing, and the value that fits."""

from __future__ import annotations

import pytest

from canbase_config.drive import Drive
from canbase_config.reported_units import Misfit, Objects, misfits, undecided


def drive(unit: str = "rpm", counts: int = 4096) -> Drive:
    return Drive.model_validate(
        {
            "joint": "left_wheel",
            "node_id": 1,
            "side": "left",
            "gear_ratio": 20.0,
            "counts_per_motor_rev": counts,
            "velocity_unit": unit,
        }
    )


def one(objects: Objects, unit: str = "rpm", counts: int = 4096) -> Misfit:
    (found,) = misfits(drive(unit, counts), objects)
    return found


GEAR_10 = {(0x6091, 1): 10, (0x6091, 2): 1}


# 60A9h: 10^prefix, numerator, denominator. robot.yaml has the unit of the second column
@pytest.mark.parametrize(
    ("objects", "unit"),
    [
        ({(0x60A9, 0): 0x00B4_4700}, "rpm"),
        ({(0x60A9, 0): 0xFFB4_4700}, "0.1rpm"),
        ({(0x60A9, 0): 0xFDB4_4700}, "0.001rpm"),
        ({(0x60A9, 0): 0x00B4_0300}, "rev/s"),
        ({(0x60A9, 0): 0xFDB4_0300}, "0.001rev/s"),
        ({(0x60A9, 0): 0x00B5_0300}, "counts/s"),
        ({(0x60A9, 0): 0xFFB5_0300}, "0.1counts/s"),
        ({(0x608C, 0): 0xA4, (0x608B, 0): 0}, "rpm"),
        ({(0x608C, 0): 0xA4, (0x608B, 0): 0xFF}, "0.1rpm"),
        ({(0x608C, 0): 0xA3}, "rev/s"),
        ({(0x60A9, 0): 0, (0x608C, 0): 0xA4}, "rpm"),
    ],
)
def test_each_unit_fits_its_own_name_and_no_other_one(objects: Objects, unit: str) -> None:
    units = ("rpm", "0.1rpm", "0.001rpm", "rev/s", "0.001rev/s", "counts/s", "0.1counts/s")
    assert misfits(drive(unit), objects) == []
    for other in units:
        if other != unit:
            found = one(objects, other)
            assert (found.key, found.has, found.fits) == ("velocity_unit", other, unit)


def test_the_case_seen_says_how_much_faster_the_wheel_would_turn() -> None:
    found = one({(0x60A9, 0): 0x00B4_4700}, "0.1rpm")
    assert found.at == "60A9h:0 = 00B44700h"
    assert found.meaning == "one bit of 60FFh and 606Ch is 1 rev/min"
    assert found.effect == "its wheel would turn 10 times as fast as commanded"


def test_a_unit_that_robot_yaml_cannot_name_fits_no_value() -> None:
    assert one({(0x60A9, 0): 0xFEB4_4700}).fits == ""


@pytest.mark.parametrize(
    "objects",
    [
        {},
        {(0x60A9, 0): 0},
        {(0x60A9, 0): 0x0001_0300},  # m/s: no fixed ratio to a revolution
        {(0x60A9, 0): 0x00B4_5700},  # per second squared
        {(0x60A9, 0): 0x00B4_4701},
        {(0x608C, 0): 0xFF},
        {(0x608F, 1): 1, (0x608F, 2): 1},
        {(0x608F, 1): 2048},
        {(0x608F, 1): 2048, (0x608F, 2): 0},
        {(0x60A8, 0): 0xFD01_0000, (0x6092, 1): 500, (0x6092, 2): 1},  # mm
        {(0x60A8, 0): 0xFFB5_0000, (0x608F, 1): 500, (0x608F, 2): 1},
    ],
)
def test_what_proves_nothing_contradicts_nothing(objects: Objects) -> None:
    assert misfits(drive(), objects) == []
    assert undecided(objects) == []


@pytest.mark.parametrize(
    ("objects", "counts", "sub"),
    [
        ({(0x608F, 1): 2000, (0x608F, 2): 1}, 2000, 1),
        ({(0x608F, 1): 4000, (0x608F, 2): 2, (0x60A8, 0): 0x00B5_0000}, 2000, 1),
        ({(0x60A8, 0): 0xFF41_0000}, 3600, 0),
        ({(0x60A8, 0): 0xFDB4_0000}, 1000, 0),
        ({(0x6092, 1): 10000, (0x6092, 2): 1, (0x608F, 1): 2000, (0x608F, 2): 1}, 10000, 1),
        ({(0x6092, 1): 1, (0x6092, 2): 1, (0x608F, 1): 2000, (0x608F, 2): 1}, 2000, 1),
    ],
)
def test_increments_of_a_revolution(objects: Objects, counts: int, sub: int) -> None:
    assert misfits(drive(counts=counts), objects) == []
    found = one(objects, counts=2 * counts)
    assert (found.key, found.has, found.fits, found.sub) == (
        "counts_per_motor_rev",
        str(2 * counts),
        str(counts),
        sub,
    )
    assert found.effect == "it would have gone 2 times as far as the odometry says"


def test_radians_are_no_whole_increments() -> None:
    assert one({(0x60A8, 0): 0x0010_0000}).fits == ""


def test_with_a_gear_in_the_drive_both_shafts_fit_and_the_wheel_has_to_show_which() -> None:
    objects = {(0x60A9, 0): 0x00B4_0300, **GEAR_10}
    assert misfits(drive("rev/s"), objects) == []
    assert len(misfits(drive("rpm"), objects)) == 1
    assert undecided(objects) == ["6091h = 10/1"]
    assert undecided(objects, {0x6091}) == []
    assert undecided({(0x6096, 1): 1, (0x6096, 2): 100}) == ["6096h = 1/100"]
    assert undecided({(0x6096, 1): 7, (0x6096, 2): 7}) == []


def test_a_measured_value_counts_more_than_what_the_drive_reports() -> None:
    objects = {(0x60A9, 0): 0x00B4_4700, (0x60A8, 0): 0xFF41_0000}
    assert [found.index for found in misfits(drive("0.1rpm"), objects)] == [0x60A9, 0x60A8]
    assert misfits(drive("0.1rpm"), objects, {0x60A9, 0x60A8}) == []
