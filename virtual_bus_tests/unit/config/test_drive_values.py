"""`values` of a drive in robot.yaml: how they share the spare TPDOs, and what does not fit."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from canbase_config.bus_load import cyclic_load
from canbase_config.drive_values import DriveValue, misfit, value_pdos
from canbase_config.profile import Layout
from canbase_config.robot import Robot
from canbase_config.watchdog import WatchedLayout
from canbase_driver.cia301.pdo import GENERIC_PROFILE, NodeLayout, node_layout
from canbase_watchdog import frames
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


@pytest.mark.parametrize("tpdos", [2, 3, 4, 8])
def test_a_node_with_two_motors_has_no_identifier_to_spare_however_many_tpdos_its_drive_has(tpdos: int) -> None:
    why = misfit([DriveValue.model_validate(value("a"))], 100.0, motors=2, tpdos=tpdos)
    assert "whose feedback has all four TPDO identifiers of a node (180h, 280h, 380h and 480h + id)" in why
    assert "the watchdog would read them as torque or velocity" in why
    assert why.endswith("Take the values out, and read one by hand with `canbase bus sdo read NODE 2000:0`")
    with pytest.raises(ValidationError, match="values of left_wheel: its node turns two motors"):
        robot(value("a"), kind="zlac8015d")


@pytest.mark.parametrize("joined", [False, True])
def test_the_watchdog_takes_the_feedback_of_two_motors_from_all_four_identifiers(joined: bool) -> None:
    """Joined: status and velocity of each motor come in one TPDO, and the watchdog takes the other two all the same."""
    layout = Layout(velocity_bits=16) if joined else Layout()
    profile = GENERIC_PROFILE.model_copy(update={"layout": layout})
    node = NodeLayout(5, (0, 1), profile, joins_velocity=joined)
    feedback = {cob_id for axis in (0, 1) for cob_id in (node.status_cob_id(axis), node.velocity_cob_id(axis))}
    assert feedback == {tpdo + 5 for tpdo in (*frames.STATUS_TPDO, *frames.VELOCITY_TPDO)}
    assert feedback == {0x185, 0x285, 0x385, 0x485}


def test_a_value_of_two_bytes_behind_feedback_would_be_read_as_torque_or_as_velocity() -> None:
    """Why spare bytes of TPDO1 and TPDO2 stay empty: only the length says what a feedback TPDO carries."""
    narrow, two_bytes = WatchedLayout(velocity_bits=16), bytes((0x39, 0x05))
    assert frames.decode_torque(bytes(4) + two_bytes) == pytest.approx(1.337)
    assert frames.decode_joined_velocity(bytes(6) + two_bytes, narrow) == 1337


def test_two_drives_of_one_motor_each_have_their_values_both() -> None:
    given = robot_with("generic").model_dump()
    for drive, name in zip(given["drives"], ("a", "b"), strict=True):
        drive["values"] = [value(name)]
    both = Robot.model_validate(given)
    pdos = [node_layout(drive.node_id, (drive,), both).value_pdos() for drive in both.drives]
    assert [[(pdo.number, pdo.cob_id) for pdo in of] for of in pdos] == [
        [(3, 0x380 + drive.node_id)] for drive in both.drives
    ]


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
