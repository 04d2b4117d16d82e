"""`values` of a drive in robot.yaml: how they share the spare TPDOs, and what does not fit."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from canbase_config.bus_load import cyclic_load
from canbase_config.drive_values import DriveValue, misfit, value_pdos
from canbase_config.robot import Robot
from support.chain_world import robot_of
from support.crews import robot_with
from support.timed_bus import on_a_wire


def value(name: str, bits: int = 16, period_s: float = 0.1) -> dict[str, Any]:
    return {"name": name, "index": 0x2000, "bits": bits, "period_s": period_s}


def robot(*values: dict[str, Any], kind: str = "generic") -> Robot:
    """Two drives, the left one with these values."""
    given = robot_with(kind).model_dump()
    given["drives"][0]["values"] = list(values)
    return Robot.model_validate(given)


def test_values_of_one_period_share_a_pdo_of_eight_bytes_and_each_period_has_its_own() -> None:
    given = (value("a", 32), value("b", 32, 0.5), value("c", 32), value("d", 8, 0.5))
    pdos = value_pdos([DriveValue.model_validate(each) for each in given], 100.0)
    assert [(pdo.every, [each.name for each in pdo.values], pdo.data_bytes) for pdo in pdos] == [
        (10, ["a", "c"], 8),
        (50, ["b", "d"], 5),
    ]


def test_a_period_of_more_than_240_cycles_is_one_of_240() -> None:
    (pdo,) = value_pdos([DriveValue.model_validate(value("a", period_s=10.0))], 100.0)
    assert pdo.every == 240


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ((value("a"), value("a")), "values of left_wheel: two values are named a"),
        (tuple(value(f"v{i}", 32) for i in range(5)), r"20 bytes need 3 TPDOs of 8 bytes.* 2 of the 4 TPDOs"),
        ((value("a"), value("b", 8, 0.2), value("c", 8, 0.3)), "3 values with 3 different period_s"),
    ],
)
def test_what_does_not_fit_names_the_limit(values: tuple[dict[str, Any], ...], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        robot(*values)


@pytest.mark.parametrize("tpdos", [1, 2])
def test_where_no_tpdo_is_spare_no_other_period_helps(tpdos: int) -> None:
    why = misfit([DriveValue.model_validate(value("a"))], 100.0, motors=1, tpdos=tpdos)
    assert why.startswith(f"its drive has {tpdos} TPDOs")
    assert why.endswith("none of them is spare: take the values out")


def test_a_node_with_two_motors_has_no_spare_tpdos() -> None:
    with pytest.raises(ValidationError, match="its node turns two motors, which use all four TPDOs"):
        robot(value("a"), kind="zlac8015d")


def test_values_count_in_the_load_of_the_bus() -> None:
    """Eight bytes every 10 ms: 135 bits."""
    plain, full = robot(), robot(value("a", 32, 0.01), value("b", 32, 0.01))
    assert cyclic_load(full) - cyclic_load(plain) == pytest.approx(135 * 100 / plain.bus.bitrate)


def test_a_cycle_that_cannot_carry_all_values_at_once_is_refused() -> None:
    """Eight drives take 58 % of 500 kbit/s; 16 PDOs more, each second, fill one cycle."""
    eight = robot_of(*((node_id, 0, "left" if node_id % 2 else "right") for node_id in range(1, 9)))
    given = eight.model_dump()
    for drive in given["drives"]:
        drive["values"] = [value(f"v{i}", 32, 1.0) for i in range(4)]
    crowded = Robot.model_validate(given)
    assert cyclic_load(on_a_wire(crowded, 1_000_000)) < 0.3
    with pytest.raises(ValidationError, match=r"all `values` of the drives are sent \(16 PDOs\) takes up to 1\d\d%"):
        on_a_wire(crowded, 500_000)
