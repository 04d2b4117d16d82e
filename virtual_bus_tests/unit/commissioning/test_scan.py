"""Listening and scanning: from frames and answers to rows, before simulated drives in virtual time."""

from __future__ import annotations

import math

import pytest

from canbase_commissioning.bus_monitor import Listener, ListenSession
from canbase_commissioning.identification import Identification
from canbase_commissioning.scan_rows import NOT_HERE, missing, scan_rows, silent, twins_advice
from canbase_commissioning.session import Echo
from canbase_config.profile_file import load_profile, profile_names
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtState
from canbase_sim.cia301.dictionary import key
from canbase_sim.world.bench import BenchParameters
from support.session_world import SessionWorld
from support.sim_rig import robot


def frame(text: str) -> Frame:
    cob_id, _, data = text.partition(" ")
    return Frame(int(cob_id, 16), bytes.fromhex(data))


def listen(*frames: str, gap_s: float = 0.1) -> Listener:
    heard = Listener(10.0)
    for i, text in enumerate(frames):
        heard.on_frame(frame(text), 10.0 + (i + 1) * gap_s)
    return heard


def test_the_load_is_the_share_of_the_time_that_the_frames_took() -> None:
    heard = listen(*["181 00 00 00 00 00 00 00 00"] * 100, gap_s=0.01)
    assert heard.load(bitrate=500_000, now_s=11.0) == pytest.approx(100 * 135 / 500_000)


def test_heartbeats_tell_state_and_period_and_a_boot_up_is_none_of_them() -> None:
    heard = listen("701 00", "701 7F", "701 7F", "701 05", gap_s=0.1)
    node = heard.nodes[1]
    assert node.nmt_state is NmtState.OPERATIONAL
    assert node.period_s == pytest.approx(0.1)
    assert node.heartbeat_age_s(10.65) == pytest.approx(0.25)
    assert node.state_text == "operational"


def test_a_node_that_only_booted_up_is_pre_operational_and_one_that_only_sends_pdos_operational() -> None:
    heard = listen("701 00", "282 00 00 00 00")
    assert [heard.nodes[n].state_text for n in (1, 2)] == ["pre-operational", "operational"]
    assert math.isnan(heard.nodes[2].period_s)


def test_an_emergency_stays_until_it_is_reset() -> None:
    heard = listen("081 10 23 01 00 00 00 00 00")
    assert heard.nodes[1].emcy is not None
    heard.on_frame(frame("081 00 00 00 00 00 00 00 00"), 12.0)
    assert heard.nodes[1].emcy is None


@pytest.mark.parametrize(
    ("said", "sign"),
    [
        ("77F 05", "heartbeat of node 127, canbase's motor driver"),
        ("77E 05", "heartbeat of node 126, canbase's watchdog"),
        ("080", "SYNC, 2 a second"),
        ("000 01 00", "NMT commands to all nodes"),
        ("201 06 00 00 00 00 00", "setpoints (RPDOs) to node 1"),
        ("602 40 00 10 00 00 00 00 00", "SDO requests to node 2"),
    ],
)
def test_each_sign_of_a_master_is_a_sentence(said: str, sign: str) -> None:
    assert listen(said).masters(10.5) == [sign]


def test_drives_alone_are_no_master_nor_is_the_watchdogs_state_a_drive() -> None:
    heard = listen("181 50 02 00 00 00 00", "701 7F", "581 43 00 10 00 92 01 02 00", "1FE 01 00 00 00 0A 00 00 00")
    assert heard.masters(11.0) == []
    assert list(heard.nodes) == [1]
    assert heard.watchdog is not None


def test_the_sdo_channel_is_free_again_a_while_after_the_last_request_of_another() -> None:
    heard = listen("601 40 00 10 00 00 00 00 00")
    assert [heard.sdo_free(1, t) for t in (10.1, 10.14, 10.16)] == [False, False, True]
    assert heard.sdo_free(2, 10.1)


def test_our_own_frames_come_back_once_and_a_second_time_they_are_somebody_elses() -> None:
    echo = Echo()
    echo.sent(frame("77F 05"), 1.0)
    assert [echo.is_own(frame("77F 05"), t) for t in (1.01, 1.02)] == [True, False]
    echo.sent(frame("77F 05"), 2.0)
    assert not echo.is_own(frame("77F 05"), 2.2)


def test_listening_sends_nothing_and_ends_in_time() -> None:
    world = SessionWorld()
    listening = ListenSession(1.5)
    assert world.run(listening) == pytest.approx(1.5, abs=0.01)
    assert world.said == []


def scanned(world: SessionWorld, seconds: float = 1.0) -> Identification:
    listening = ListenSession(seconds)
    world.run(listening)
    roster = Identification(range(1, 126), listening.heard, 0.1, with_texts=True)
    world.run(roster)
    return roster


def test_two_drives_are_found_among_125_ids_and_nothing_is_written() -> None:
    world = SessionWorld()
    roster = scanned(world)
    assert list(roster.cards) == [1, 2]
    card = roster.cards[1]
    assert (card.profile_402, card.product_code, card.serial, card.name) == (
        True,
        0xCB402,
        1,
        "canbase simulated drive",
    )
    assert {frame.data[0] & 0xE0 for _, frame in world.said} <= {0x40, 0x60, 0x80}


@pytest.mark.parametrize("name", profile_names())
def test_the_profile_of_each_kind_of_drive_is_guessed_where_its_identity_is_known(name: str) -> None:
    kind = load_profile(name)
    known = {key: value for key, value in kind.identity.model_dump().items() if value is not None}
    unit: dict[str, str | None] = (
        {} if kind.units.target_velocity is not None and name != "generic" else {"velocity_unit": "rpm"}
    )
    if kind.units.target_velocity != kind.units.actual_velocity:
        unit = {"velocity_unit": None}
    shared = {"profile": name, "identity": known, **unit}
    there = robot(
        {"joint": "left", "node_id": 1, "side": "left", **shared},
        {"joint": "right", "node_id": 2, "side": "right", **shared},
    )
    world = SessionWorld(there)
    world.wait(1.0)
    expected = name if known else "generic"
    rows = scan_rows({}, scanned(world).cards, there)
    assert [(row.node_id, row.profile) for row in rows] == [(1, expected), (2, expected)]


def test_a_drive_of_robot_yaml_that_is_not_there_has_a_row_too() -> None:
    world = SessionWorld()
    world.bench.nodes[2].line.cut = True
    rows = scan_rows({}, scanned(world).cards, world.robot)
    assert [(row.node_id, row.in_robot) for row in rows] == [(1, "left"), (2, "right")]
    assert rows[1].what == NOT_HERE
    assert missing(rows) == [2]


def test_two_drives_with_one_node_id_are_named_and_their_serial_numbers_are_not_read() -> None:
    world = SessionWorld(parameters=BenchParameters(factory_fresh=True))
    roster = scanned(world)
    assert roster.twins == {1}
    assert roster.cards[1].serial is None
    assert [sent for _, sent in world.said if sent.data[:4] == bytes.fromhex("40181004")] == []
    (row, missing_one) = scan_rows({}, roster.cards, world.robot, roster.twins)
    assert row.what == "two drives or more: generic CiA 402 drive"
    assert missing_one.what == NOT_HERE
    assert twins_advice(roster.twins).startswith("node 1: two drives or more answer. canbase bus adopt")


def test_drives_with_a_node_id_each_are_no_twins() -> None:
    assert scanned(SessionWorld()).twins == frozenset()


def test_a_drive_that_answers_and_sends_nothing_is_named_with_the_reason() -> None:
    world = SessionWorld()
    world.bench.nodes[2].dictionary.values[key(0x1017)] = 500
    world.bench.nodes[2]._producer.due = lambda now_s: False  # type: ignore[method-assign]
    roster = scanned(world)
    texts = silent(roster._heard.nodes, roster.cards)
    assert [text.partition(";")[0] for text in texts] == [f"node {n}: answers SDO and sends nothing" for n in (1, 2)]
    assert "1017h = 0" in texts[0]
    assert "its heartbeat is set to 500 ms and did not come" in texts[1]


def test_a_drive_with_a_heartbeat_is_not_among_the_silent_ones() -> None:
    world = SessionWorld()
    world.bench.nodes[1].dictionary.set_data(0x1017, 0, (100).to_bytes(2, "little"))
    listening = ListenSession(0.5)
    world.run(listening)
    assert [text[:6] for text in silent(listening.heard.nodes, scanned(world).cards)] == ["node 2"]


def test_a_request_waits_until_the_other_master_is_quiet_on_that_channel() -> None:
    world = SessionWorld()
    listening = ListenSession(0.1)
    world.run(listening)
    until = world.now_s + 1.0
    world.others.append(lambda now_s: [frame("601 40 64 60 00 00 00 00 00")] if now_s < until else [])
    roster = Identification((1,), listening.heard, 0.1, with_texts=False)
    world.turn(roster)
    world.run(roster)
    assert 1 in roster.cards
    asked_at = [at for at, sent in world.said if sent.cob_id == 0x601]
    assert asked_at[1] >= until + 0.04
