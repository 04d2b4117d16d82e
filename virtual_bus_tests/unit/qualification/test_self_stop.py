"""Which drives stop by themselves, as their profiles state it: what is not known is not yes."""

from __future__ import annotations

import pytest

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_qualification.self_stop import OwnStop, StopsItself, own_stops

ROBOT = load_robot(sample("bench")).robot


def robot_with(profile: str) -> Robot:
    drives = tuple(drive.model_copy(update={"profile": profile}) for drive in ROBOT.drives)
    return ROBOT.model_copy(update={"drives": drives})


def first(profile: str) -> OwnStop:
    return own_stops(robot_with(profile))[0]


@pytest.mark.parametrize(
    ("profile", "stops", "why"),
    [
        ("epos4", StopsItself.YES, "6007h"),
        ("elmo_gold", StopsItself.UNPROVEN, "abort_connection_code"),
        ("technosoft", StopsItself.YES, "the watchdog guards it"),
        ("tmcm1636", StopsItself.NO, "no 6007h"),
        ("dryve_d1", StopsItself.NO, "no 6007h"),
        ("roboteq", StopsItself.NO, "manufacturer's tool"),
        ("zlac8015d", StopsItself.UNPROVEN, "set by the boot"),
        ("kinco", StopsItself.UNPROVEN, "heartbeat_entries"),
        ("nanotec", StopsItself.UNPROVEN, "abort_connection"),
        ("generic", StopsItself.UNPROVEN, "abort_connection"),
    ],
)
def test_each_kind_of_drive(profile: str, stops: StopsItself, why: str) -> None:
    assert first(profile).stops is stops
    assert why in first(profile).why


def test_every_motor_has_its_line() -> None:
    assert [own.joint for own in own_stops(ROBOT)] == [drive.joint for drive in ROBOT.drives]
