"""What a PDO contains: by robot.yaml, by SDO transfers of the recording, by what is assumed and said to be."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.load import load_robot, sample
from canbase_recording.pdo_layouts import PdoLayouts, Source

BENCH = load_robot(sample("bench")).robot


def values(layouts: PdoLayouts, cob_id: int, data: bytes) -> dict[tuple[int, int], int]:
    """By object of the first axis and axis."""
    found = layouts.of(cob_id, len(data))
    assert found is not None
    return {(each.base, each.axis): each.value(data) for each in found.mapped}


def test_robot_yaml_goes_first() -> None:
    layouts = PdoLayouts(BENCH)
    assert values(layouts, 0x181, struct.pack("<Hi", 0x237, -7)) == {(0x6041, 0): 0x237, (0x6064, 0): -7}
    layouts.on_object(1, 0x1A00, 1, 0x2000_0008)
    layouts.on_object(1, 0x1A00, 0, 1)
    found = layouts.of(0x181, 6)
    assert found is not None
    assert found.source is Source.ROBOT


def test_a_torque_behind_the_velocity_may_be_missing() -> None:
    layouts = PdoLayouts(BENCH)
    assert values(layouts, 0x281, struct.pack("<ih", 5, -3)) == {(0x606C, 0): 5, (0x6077, 0): -3}
    assert values(layouts, 0x281, struct.pack("<i", 5)) == {(0x606C, 0): 5}


def test_a_mapping_that_is_written_in_the_recording_counts_from_then_on() -> None:
    layouts = PdoLayouts()
    before = layouts.of(0x185, 6)
    assert before is None
    layouts.on_object(5, 0x1A00, 0, 0)
    layouts.on_object(5, 0x1A00, 1, 0x6041_0010)
    layouts.on_object(5, 0x1A00, 2, 0x6864_0020)
    layouts.on_object(5, 0x1A00, 0, 2)
    assert values(layouts, 0x185, struct.pack("<Hi", 0x27, -9)) == {(0x6041, 0): 0x27, (0x6064, 1): -9}
    assert layouts.sources[0x185] is Source.SDO
    assert layouts.of(0x185, 5) is None


def test_a_pdo_that_was_moved_to_another_identifier() -> None:
    layouts = PdoLayouts()
    layouts.on_object(5, 0x1805, 1, 0x4000_01A3)
    layouts.on_object(5, 0x1A05, 1, 0x606C_0020)
    layouts.on_object(5, 0x1A05, 0, 1)
    assert values(layouts, 0x1A3, struct.pack("<i", -2)) == {(0x606C, 0): -2}


def test_a_pdo_that_is_switched_off_is_none() -> None:
    layouts = PdoLayouts()
    layouts.on_object(5, 0x1805, 1, 0x8000_01A3)
    layouts.on_object(5, 0x1A05, 1, 0x606C_0020)
    layouts.on_object(5, 0x1A05, 0, 1)
    assert layouts.of(0x1A3, 4) is None


@pytest.mark.parametrize(("cob_id", "length", "name"), [(0x183, 2, "TPDO1"), (0x483, 6, "TPDO4"), (0x503, 6, "RPDO4")])
def test_the_default_mapping_of_cia_402_is_assumed_where_the_length_fits(cob_id: int, length: int, name: str) -> None:
    found = PdoLayouts().of(cob_id, length)
    assert found is not None
    assert (found.name, found.source, found.source.is_assumed) == (name, Source.CIA_402, True)
    assert PdoLayouts().of(cob_id, length + 1) is None


def test_beside_canbase_s_watchdog_a_drive_is_one_whatever_its_device_type_and_its_other_pdos() -> None:
    """canbase has booted it: what refutes the default mapping of CiA 402 does not refute canbase's."""
    layouts = PdoLayouts()
    layouts.on_object(3, 0x1000, 0, 0)
    assert layouts.of(0x183, 6) is layouts.of(0x183, 2) is None
    layouts.on_canbase()
    layouts.on_object(3, 0x1000, 0, 0)
    assert layouts.of(0x483, 7) is None
    found = layouts.of(0x183, 6)
    assert found is not None
    assert found.source is Source.CANBASE


def test_beside_canbase_s_watchdog_canbase_s_layout_is_assumed() -> None:
    layouts = PdoLayouts()
    assert layouts.of(0x283, 6) is None
    layouts.on_canbase()
    found = layouts.of(0x283, 6)
    assert found is not None
    assert found.source is Source.CANBASE


@given(
    st.lists(
        st.tuples(st.integers(0, 127), st.integers(0x1400, 0x1C00), st.integers(0, 255), st.integers(0, 2**32 - 1))
    )
)
def test_any_objects_may_be_written(writes: list[tuple[int, int, int, int]]) -> None:
    layouts = PdoLayouts()
    for write in writes:
        layouts.on_object(*write)
    for cob_id in range(0x180, 0x580, 7):
        for length in range(9):
            found = layouts.of(cob_id, length)
            if found is not None:
                assert found.fits(length)
                for each in found.mapped:
                    each.value(bytes(length))
