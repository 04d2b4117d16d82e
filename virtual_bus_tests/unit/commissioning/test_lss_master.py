"""Drives that answer late, twice, wrongly or not at all, and others on the bus, while LSS is under way."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_commissioning.conversation import Conversation
from canbase_commissioning.lss import master
from canbase_commissioning.lss.adoption import discover, look, take_into_use
from canbase_commissioning.lss.protocol import Identity
from canbase_driver.cia301.frame import Frame
from canbase_sim.cia301.dictionary import key
from canbase_sim.cia305.lss_slave import LssState
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.node import SimulatedNode
from support.rated_world import RatedWorld

FIRST = Identity(0, 0xCB402, 0x10000, 0x1A2B)
SECOND = Identity(0, 0xCB402, 0x10000, 0x1A2C)


def found(world: RatedWorld) -> list[Identity]:
    return world.talk(discover(world.talk(look(world.bitrate)), world.bitrate))


def answers_late(world: RatedWorld, node: SimulatedNode, delay_s: float) -> None:
    node.line._answer_delay_s = delay_s
    node.lss._send = lambda frame: node.line.answer(frame, world.now_s)


@pytest.mark.parametrize("delay_s", [0.01, 0.025, 0.03, 0.05, 0.1])
def test_drives_that_answer_late_are_found_with_their_right_serial_numbers(delay_s: float) -> None:
    world = RatedWorld()
    answers_late(world, world.nodes[1], delay_s)
    assert found(world) == [FIRST, SECOND]


def test_drives_that_are_as_slow_as_each_other_are_found_too() -> None:
    world = RatedWorld()
    for node in world.nodes:
        answers_late(world, node, 0.03)
    assert found(world) == [FIRST, SECOND]


def test_one_late_answer_at_the_last_bit_confirms_no_wrong_serial_number() -> None:
    world = RatedWorld()
    node = world.nodes[1]
    answers_late(world, node, 0.0)
    on_frame = node.lss.on_frame

    def late_once(data: bytes, now_s: float) -> None:
        node.line._answer_delay_s = 0.03 if data[0] == 0x51 and data[5:8] == b"\0\3\3" else 0.0
        on_frame(data, now_s)

    node.lss.on_frame = late_once  # type: ignore[method-assign]
    node._route()
    assert found(world) == [FIRST, SECOND]


def test_drives_that_answer_every_scan_in_configuration_are_found_with_their_right_serial_numbers() -> None:
    """So does the LSS slave of CANopenNode: it has to be out of configuration before the next drive is looked for."""
    world = RatedWorld()
    for node in world.nodes:
        node.lss.answers_every_scan = True
    assert found(world) == [FIRST, SECOND]
    assert [node_id for node_id, _ in world.settings] == [125, 124]
    world.power_cycle()
    assert [node_id for node_id, _ in world.settings] == [1, 1]


def test_a_lost_frame_between_two_drives_does_not_hide_the_second_one() -> None:
    world = RatedWorld()
    lss = world.nodes[1].lss
    on_frame = lss.on_frame
    lost: list[bytes] = []

    def loses_one(data: bytes, now_s: float) -> None:
        if data[0] == 0x51 and data[5] == 0x80 and world.nodes[0].lss.node_id == 125 and not lost:
            lost.append(data)
            return
        on_frame(data, now_s)

    lss.on_frame = loses_one  # type: ignore[method-assign]
    world.nodes[1]._route()
    assert found(world) == [FIRST, SECOND]
    assert len(lost) == 1


def test_the_node_id_for_the_time_being_is_none_of_a_device_that_takes_no_lss() -> None:
    world = RatedWorld(factory_fresh=False, bitrate=500_000)
    census = world.talk(look(500_000))
    world.talk(discover(replace(census, node_ids=(*census.node_ids, 125)), 500_000))
    assert [node_id for node_id, _ in world.settings] == [124, 123]


def test_two_drives_with_the_same_serial_number_are_not_set() -> None:
    world = RatedWorld()
    world.nodes[1].dictionary._fixed[key(0x1018, 4)] = FIRST.serial
    world.nodes[1].dictionary._factory[key(0x1018, 4)] = FIRST.serial
    world.nodes[1].dictionary.values[key(0x1018, 4)] = FIRST.serial
    assert found(world) == [FIRST]
    assert "2 drives answer. Connect one of them at a time" in world.why(master.set_up_all({FIRST: 1}, None))


def test_a_drive_that_does_not_leave_the_scan_ends_it() -> None:
    world = RatedWorld()
    lss = world.nodes[0].lss
    on_frame = lss.on_frame

    def stays(data: bytes, now_s: float) -> None:
        on_frame(data, now_s)
        if data[0] == 0x51:
            lss.state = LssState.WAITING

    lss.on_frame = stays  # type: ignore[method-assign]
    world.nodes[0]._route()
    assert "does not leave the scan" in world.why(discover(world.talk(look(125_000)), 125_000))


def test_a_drive_with_another_identity_than_was_selected_is_not_set() -> None:
    world = RatedWorld()
    found(world)
    lss = world.nodes[0].lss
    configure = lss._configure

    def lies(command: int, data: bytes, now_s: float) -> None:
        if command == 0x5C:
            lss._send(BenchFrame(0x7E4, bytes((0x5C, 9, 0, 0, 0, 0, 0, 0))))
        else:
            configure(command, data, now_s)

    lss._configure = lies  # type: ignore[method-assign]
    why = world.why(master.set_up_all({FIRST: 1}, None))
    assert "1018h:3 is 9h by LSS, 10000h was selected; nothing is set" in why
    assert lss.pending_node_id == 125


def test_a_drive_that_was_unplugged_is_missed() -> None:
    world = RatedWorld()
    found(world)
    world.nodes[1].line.cut = True
    why = world.why(master.set_up_all({FIRST: 1, SECOND: 2}, None))
    assert why == "serial 1A2Ch (0:CB402:10000): no answer to LSS 44h, 12 requests. Is it still connected?"


def test_in_use_each_node_id_is_one_drive_with_the_identity_that_belongs_to_it() -> None:
    world = RatedWorld(factory_fresh=False, bitrate=500_000)
    world.talk(take_into_use({FIRST: 1, SECOND: 2}, 500_000))
    why = world.why(take_into_use({FIRST: 2, SECOND: 1}, 500_000))
    assert why == "node 2 is serial 1A2Ch (0:CB402:10000), expected serial 1A2Bh (0:CB402:10000)"
    assert "node 1 is serial 1A2Bh" in world.why(take_into_use({Identity(0, 0, 0, 0): 1}, 500_000))
    twins = RatedWorld()
    assert "two drives answer as node 1" in twins.why(take_into_use({FIRST: 1}, 125_000))


@pytest.mark.parametrize(
    ("frame", "sign"),
    [
        (Frame(0x080), "SYNC"),
        (Frame(0x77F, b"\5"), "heartbeat of node 127"),
        (Frame(0x77E, b"\5"), "heartbeat of node 126"),
        (Frame(0x201, bytes(6)), "setpoints (RPDOs) to node 1"),
        (Frame(0x7E5, bytes((0x5E, 0, 0, 0, 0, 0, 0, 0))), "LSS requests of another master"),
    ],
)
def test_whoever_else_commands_the_bus_ends_it_at_once(frame: Frame, sign: str) -> None:
    world = RatedWorld()
    conversation = Conversation(discover(world.talk(look(125_000)), 125_000))
    for _ in range(500):
        world.turn(conversation)
    assert not conversation.done
    world.others.append(frame)
    world.turn(conversation)
    world.turn(conversation)
    assert conversation.error is not None
    assert sign in str(conversation.error)
    assert conversation.tick(world.now_s) == []


def test_own_requests_that_come_back_late_are_no_sign_of_another_master() -> None:
    world = RatedWorld()
    conversation = Conversation(look(125_000))
    for _ in range(300):
        world.turn(conversation)
    world.others += [Frame(0x601, bytes.fromhex("4000100000000000"))]
    world.turn(conversation)
    world.turn(conversation)
    assert conversation.error is None
