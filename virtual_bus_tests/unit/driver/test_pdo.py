"""The PDO layout against docs/bus.md, number by number."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.profile import Layout, Profile
from canbase_driver.cia301.pdo import (
    NodeLayout,
    Pdo,
    joined_velocity,
    pack_setpoint,
    unpack_status,
    unpack_torque,
    unpack_velocity,
)

NARROW = Profile(title="narrow", layout=Layout(velocity_bits=16))
"""Its velocity has room behind the position."""


def test_one_axis() -> None:
    assert NodeLayout(1, (0,)).pdos() == (
        Pdo("RPDO", 1, 0x201, 1, (0x6040_00_10, 0x60FF_00_20)),
        Pdo("RPDO", 4, 0x501, 255, (0x6040_00_10,)),
        Pdo("TPDO", 1, 0x181, 1, (0x6041_00_10, 0x6064_00_20)),
        Pdo("TPDO", 2, 0x281, 1, (0x606C_00_20, 0x6077_00_10), 1),
    )


def test_two_axes_on_one_node() -> None:
    assert NodeLayout(5, (0, 1)).pdos() == (
        Pdo("RPDO", 1, 0x205, 1, (0x6040_00_10, 0x60FF_00_20)),
        Pdo("RPDO", 2, 0x305, 1, (0x6840_00_10, 0x68FF_00_20)),
        Pdo("RPDO", 4, 0x505, 255, (0x6040_00_10, 0x6840_00_10)),
        Pdo("TPDO", 1, 0x185, 1, (0x6041_00_10, 0x6064_00_20)),
        Pdo("TPDO", 2, 0x285, 1, (0x606C_00_20, 0x6077_00_10), 1),
        Pdo("TPDO", 3, 0x385, 1, (0x6841_00_10, 0x6864_00_20)),
        Pdo("TPDO", 4, 0x485, 1, (0x686C_00_20, 0x6877_00_10), 1),
    )


def test_two_axes_with_one_tpdo_each() -> None:
    layout = NodeLayout(5, (0, 1), NARROW, joins_velocity=True)
    assert [pdo for pdo in layout.pdos() if pdo.is_received] == [
        Pdo("TPDO", 1, 0x185, 1, (0x6041_00_10, 0x6064_00_20, 0x606C_00_10)),
        Pdo("TPDO", 2, 0x385, 1, (0x6841_00_10, 0x6864_00_20, 0x686C_00_10)),
    ]
    assert layout.torque_objects == ()


def test_the_first_axis_is_the_lowest_in_use() -> None:
    layout = NodeLayout(5, (1,))
    assert (layout.setpoint_cob_id(1), layout.status_cob_id(1), layout.velocity_cob_id(1)) == (0x205, 0x185, 0x285)
    assert layout.pdos()[0].mapping == (0x6840_00_10, 0x68FF_00_20)


def test_identifiers_of_the_second_axis() -> None:
    layout = NodeLayout(5, (0, 1))
    assert (layout.setpoint_cob_id(1), layout.status_cob_id(1), layout.velocity_cob_id(1)) == (0x305, 0x385, 0x485)


@pytest.mark.parametrize("axes", [(), (2,), (1, 0), (0, 0), (0, 1, 2)])
def test_other_axes_raise(axes: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"expected \(0,\), \(1,\) or \(0, 1\)"):
        NodeLayout(5, axes)


def test_an_unused_axis_has_no_identifier() -> None:
    with pytest.raises(ValueError, match="not in tuple"):
        NodeLayout(5, (0,)).setpoint_cob_id(1)


@pytest.mark.parametrize(
    ("pdo", "name", "communication", "mapping_object"),
    [
        (Pdo("RPDO", 1), "RPDO1", 0x1400, 0x1600),
        (Pdo("RPDO", 4), "RPDO4", 0x1403, 0x1603),
        (Pdo("TPDO", 2), "TPDO2", 0x1801, 0x1A01),
    ],
)
def test_where_the_parameters_of_a_pdo_are(pdo: Pdo, name: str, communication: int, mapping_object: int) -> None:
    assert (pdo.name, pdo.communication, pdo.mapping_object) == (name, communication, mapping_object)


def test_bytes_of_a_setpoint() -> None:
    #                                            6040h  60FFh = -2
    assert pack_setpoint(0x0F, -2) == bytes.fromhex("0F 00 FE FF FF FF")


@pytest.mark.parametrize(("controlword", "target_raw"), [(0x10000, 0), (-1, 0), (0, 2**31), (0, -(2**31) - 1)])
def test_a_setpoint_that_does_not_fit_raises(controlword: int, target_raw: int) -> None:
    with pytest.raises(struct.error):
        pack_setpoint(controlword, target_raw)


def test_bytes_of_the_feedback() -> None:
    #                                   6041h 6064h = -1
    assert unpack_status(bytes.fromhex("37 06 FF FF FF FF")) == (0x0637, -1)
    assert unpack_velocity(bytes.fromhex("00 00 00 80")) == -(2**31)
    assert unpack_torque(bytes.fromhex("00 00 00 80")) is None
    #                                   606Ch       6077h = -500: half of the rated torque
    with_torque = bytes.fromhex("00 00 00 80 0C FE")
    assert (unpack_velocity(with_torque), unpack_torque(with_torque)) == (-(2**31), -0.5)


@pytest.mark.parametrize(
    ("layout", "joins"),
    [
        (Layout(), False),
        (Layout(velocity_bits=16), True),
        (Layout(second_axis="sub_index", statusword="packed", velocity_bits=16), False),
    ],
)
def test_a_velocity_is_behind_the_position_where_both_have_room(layout: Layout, joins: bool) -> None:
    data = bytes.fromhex("37 02 fe ff ff ff 0c fe")
    assert joined_velocity(data, layout) == (data[6:] if joins else b"")
    assert joined_velocity(data[:6], layout) == joined_velocity(data + b"0", layout) == b""
    assert (unpack_status(data, layout) == (0x0237, -2)) == joins
    assert layout.tpdos(2) == (2 if joins else 4)


@given(st.binary(max_size=8))
def test_only_the_right_length_is_read(data: bytes) -> None:
    assert (unpack_status(data) is not None) == (len(data) == 6)
    assert (unpack_velocity(data) is not None) == (len(data) in (4, 6))
    assert (unpack_torque(data) is not None) == (len(data) == 6)
