"""What drives report of their axes: before simulated drives of every kind, in virtual time."""

from __future__ import annotations

import struct
from collections.abc import Mapping

import pytest

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.drive_survey import FoundAxis, profile_of, survey
from canbase_commissioning.identification import NodeCard
from canbase_commissioning.sdo_session import SdoSession
from canbase_config.profile_file import load_profile, profile_names
from canbase_driver.cia301.sdo_client import NO_OBJECT, Read, SdoAborted, SdoClient, SdoTimeout
from support.session_world import SessionWorld
from support.sim_rig import robot


def card(vendor_id: int | None = 0x99, product_code: int | None = 1, device_type: int | None = 402) -> NodeCard:
    return NodeCard(5, device_type, vendor_id, product_code, None, None, None, "", "")


def answered(profile: str, objects: Mapping[tuple[int, int], int | bytes]) -> tuple[FoundAxis, ...]:
    """The survey of a drive that has these objects and no other."""
    steps = survey(5, profile)
    read = next(steps)
    while True:
        assert isinstance(read, Read)
        value = objects.get((read.index, read.sub))
        try:
            if value is None:
                read = steps.throw(SdoAborted(5, read, NO_OBJECT))
            else:
                read = steps.send(value if isinstance(value, bytes) else struct.pack("<I", value))
        except StopIteration as end:
            found: tuple[FoundAxis, ...] = end.value
            return found


def surveyed(world: SessionWorld) -> dict[int, tuple[FoundAxis, ...] | None]:
    profiles = {drive.node_id: drive.profile for drive in world.robot.drives}
    steps = {node_id: survey(node_id, profile) for node_id, profile in profiles.items()}
    session = SdoSession(steps, Listener(world.now_s), lambda node_id: SdoClient(node_id, 0.1, 3))
    world.run(session)
    return {node_id: task.result for node_id, task in session.tasks.items()}


@pytest.mark.parametrize("name", profile_names())
def test_each_kind_of_drive_is_read_and_nothing_is_written(name: str) -> None:
    kind = load_profile(name)
    same = kind.units.target_velocity == kind.units.actual_velocity
    unit = {"velocity_unit": (kind.units.target_velocity or "rpm") if same else None}
    shared = {"profile": name, "counts_per_motor_rev": 4096, **unit}
    world = SessionWorld(
        robot(
            {"joint": "left", "node_id": 1, "side": "left", **shared},
            {"joint": "right", "node_id": 2, "side": "right", **shared},
        )
    )
    world.wait(1.0)
    found = surveyed(world)
    assert [(axis.node_id, axis.axis, axis.profile) for axes in found.values() for axis in axes or ()][:1] == [
        (1, 0, name)
    ]
    assert {axis.counts_per_motor_rev for axes in found.values() for axis in axes or ()} <= {4096, None}
    assert {frame.data[0] & 0xE0 for _, frame in world.said} <= {0x40, 0x60, 0x80}


def test_a_drive_for_two_motors_has_two_axes_each_with_its_own_values() -> None:
    objects = {
        (0x608F, 1): 4096, (0x608F, 2): 1, (0x6091, 1): 100, (0x6091, 2): 3,
        (0x6841, 0): 0x250, (0x688F, 1): 8000, (0x688F, 2): 2,
    }  # fmt: skip
    first, second = answered("generic", objects)
    assert (first.axis, first.counts_per_motor_rev, first.gear_ratio) == (0, 4096, 100 / 3)
    assert (second.axis, second.counts_per_motor_rev, second.gear_ratio) == (1, 4000, None)
    assert second.title == "node 5, second axis (generic CiA 402 drive)"


@pytest.mark.parametrize(
    ("objects", "unit"),
    [({(0x60A9, 0): 0xFFB4_4700}, "0.1rpm"), ({(0x608C, 0): 0xA3}, "rev/s"), ({(0x60A9, 0): 1}, None), ({}, None)],
)
def test_the_unit_of_velocities_is_the_one_that_the_drive_reports(
    objects: dict[tuple[int, int], int], unit: str | None
) -> None:
    (axis,) = answered("generic", objects)
    assert (axis.velocity_unit, axis.lacks_unit) == (unit, True)


def test_a_drive_without_a_second_statusword_has_one_axis() -> None:
    assert [axis.axis for axis in answered("generic", {})] == [0]


@pytest.mark.parametrize(
    ("increments", "revolutions", "counts"),
    [
        (4096, 1, 4096),
        (4096, None, 4096),
        (10_000, 4, 2500),
        (10_001, 4, None),
        (1, 2, None),
        (0, 1, None),
        (4096, 0, None),
        (2**31 - 1, 1, 2**31 - 1),
        (2**31, 1, None),
        (2**32 - 1, 1, None),
    ],
)
def test_counts_of_a_revolution_are_a_whole_number_or_unknown(
    increments: int, revolutions: int | None, counts: int | None
) -> None:
    objects = {(0x608F, 1): increments} | ({} if revolutions is None else {(0x608F, 2): revolutions})
    assert answered("epos4", objects)[0].counts_per_motor_rev == counts


@pytest.mark.parametrize(
    ("motor", "shaft", "gear"),
    [(20, 1, 20.0), (1, 1, 1.0), (10_000, 1, 1e4), (10_001, 1, None), (1, 1000, 1e-3), (1, 1001, None)],
)
def test_a_gear_ratio_that_robot_yaml_does_not_take_is_unknown(motor: int, shaft: int, gear: float | None) -> None:
    assert answered("epos4", {(0x6091, 1): motor, (0x6091, 2): shaft})[0].gear_ratio == gear


@pytest.mark.parametrize("answer", [b"", bytes(300), b"\xff" * 300])
def test_an_answer_that_is_no_number_of_32_bits_is_none(answer: bytes) -> None:
    (axis,) = answered("epos4", {(index, sub): answer for index in (0x608F, 0x6091) for sub in (1, 2)})
    assert (axis.counts_per_motor_rev, axis.gear_ratio) == (None, None)


def test_a_drive_that_stops_answering_ends_the_survey() -> None:
    steps = survey(5, "generic")
    read = next(steps)
    assert isinstance(read, Read)
    with pytest.raises(SdoTimeout):
        steps.throw(SdoTimeout(5, read, "no answer"))


def test_the_profile_is_that_of_the_identity_or_the_generic_one_and_none_for_other_devices() -> None:
    assert profile_of(card(vendor_id=0xFB)) == "epos4"
    assert profile_of(card()) == "generic"
    assert profile_of(card(device_type=401)) == ""
    assert profile_of(card(vendor_id=None, product_code=None, device_type=None)) == ""
