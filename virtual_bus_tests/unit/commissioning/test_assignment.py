"""Which drive gets which node id, and at which bit rate a bus works: pure decisions."""

from __future__ import annotations

import pytest

from canbase_commissioning.lss.assignment import check_node_id, proposals, too_few, too_many
from canbase_commissioning.lss.bit_rate_search import Heard, from_listening, nobody, order
from canbase_commissioning.lss.protocol import Identity
from canbase_config.bit_rate import BIT_RATES
from support.sim_rig import robot

A, B, C = (Identity(1, 2, 3, serial) for serial in (10, 11, 12))


def test_without_a_robot_the_lowest_node_ids_go_by_serial_number() -> None:
    assert proposals([B, A], {}, None) == {A: 1, B: 2}


def test_a_serial_number_in_robot_yaml_decides() -> None:
    left = {"joint": "left", "node_id": 5, "side": "left", "identity": {"serial": 11}}
    right = {"joint": "right", "node_id": 6, "side": "right", "direction": -1}
    assert proposals([A, B], {}, robot(left, right)) == {A: 6, B: 5}


def test_a_drive_that_had_a_node_id_for_itself_keeps_it() -> None:
    assert proposals([A, B, C], {2: A}, None) == {A: 2, B: 1, C: 3}
    assert proposals([A, B], {2: A, 9: B}, robot()) == {A: 2, B: 1}  # 9 is no node id of the robot


def test_canbase_keeps_its_own_node_ids() -> None:
    assert proposals([A], {126: A}, None) == {A: 1}
    with pytest.raises(ValueError, match="outside 1 to 125"):
        check_node_id(())("126")
    with pytest.raises(ValueError, match="another drive has node id 4"):
        check_node_id((4,))("4")
    assert check_node_id((4,))(" 5 ") == 5


def test_fewer_drives_than_the_robot_has_is_a_question() -> None:
    assert too_few([A, B], robot()) == ""
    assert too_few([A], None) == ""
    assert "robot.yaml has 2 nodes, 1 found" in too_few([A], robot())


def test_more_devices_than_the_robot_has_drives_get_no_node_id() -> None:
    assert too_many([A, B], robot()) == ""
    assert too_many([A, B, C], None) == ""
    told = too_many([A, B, C], robot())
    assert told.startswith("robot.yaml has 2 nodes, 3 found: ")
    assert str(C) in told
    assert told.endswith("Disconnect what is no drive of this robot")


def test_every_bit_rate_is_tried_once_the_wanted_one_first() -> None:
    assert order(250_000)[:3] == (250_000, 500_000, 125_000)
    assert sorted(order(250_000)) == sorted(BIT_RATES)


def test_the_bit_rate_with_readable_frames_is_it_and_silence_is_none() -> None:
    heard = [Heard(500_000, 0, 30), Heard(125_000, 12, 0)]
    assert from_listening(heard) == 125_000
    assert from_listening([Heard(500_000, 0, 0)]) is None


def test_errors_everywhere_are_told_from_silence() -> None:
    assert "drives with different bit rates" in nobody([Heard(500_000, 0, 3), Heard(125_000, 0, 5)])
    assert nobody([Heard(500_000, 0, 0), Heard(125_000, 0, 0)]).startswith("no drive answers at any bit rate")
