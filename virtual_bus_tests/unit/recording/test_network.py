"""A network that canbase does not know: nodes, states, what is missing, aborts, emergencies, and what stopped it."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import pytest

from canbase_commissioning.object_dictionary import Address
from canbase_config.load import load_robot, sample
from canbase_driver.cia402 import DriveState
from canbase_recording.beat import Beat
from canbase_recording.cause import Cause
from canbase_recording.echo import EchoFilter
from canbase_recording.entry import Entry, FrameKind, Note, RecordedFrame
from canbase_recording.event import EventKind, Level
from canbase_recording.explain_text import collapsed, gaps, node_facts, text_lines
from canbase_recording.explanation import Explanation, explain
from canbase_recording.load_series import MOST_BINS, LoadSeries
from canbase_recording.recording_facts import RecordingFacts

FACTS = RecordingFacts("can0.log", "candump", "", "", ())


def sdo(node: int, request: str, answer: str, at_s: float) -> list[RecordedFrame]:
    return [
        RecordedFrame(at_s, 0x600 + node, bytes.fromhex(request)),
        RecordedFrame(at_s + 0.001, 0x580 + node, bytes.fromhex(answer)),
    ]


def somebody_s_robot(*, dies_s: float = 99.0, fault_s: float = 99.0, stop_s: float = 99.0) -> Iterator[Entry]:
    """A PLC with two CiA 402 drives, 3 and 4. It maps TPDO1 of 4 itself; 3 keeps the default mapping.

    Drive 4 sends nothing after `dies_s`; drive 3 is in fault from `fault_s`; the PLC stops all nodes at `stop_s`.
    """
    yield from boot()
    for cycle in range(10, 400):
        at_s = 0.01 * cycle
        for node in (3, 4):
            yield RecordedFrame(at_s + 0.001, 0x500 + node, struct.pack("<Hi", 0x0F, 1000))
        yield RecordedFrame(at_s + 0.002, 0x080, b"")
        if stop_s <= at_s < stop_s + 0.01:
            yield RecordedFrame(at_s + 0.0025, 0x000, b"\x02\x00")
        stopped = at_s >= stop_s
        yield from drive_3(
            at_s, cycle, in_fault=at_s >= fault_s, fails=fault_s <= at_s < fault_s + 0.01, stopped=stopped
        )
        if at_s < dies_s:
            yield from drive_4(at_s, cycle, stopped=stopped)


def boot() -> Iterator[Entry]:
    yield from (RecordedFrame(0.01, 0x703, b"\0"), RecordedFrame(0.02, 0x704, b"\0"))
    yield from sdo(4, "2f001a0000000000", "60001a0000000000", 0.03)
    yield from sdo(4, "23001a0110004160", "60001a0100000000", 0.04)
    yield from sdo(4, "23001a0220006c60", "60001a0200000000", 0.05)
    yield from sdo(4, "2f001a0002000000", "60001a0000000000", 0.06)
    yield from sdo(3, "2b17100064000000", "8017100000000206", 0.07)
    yield RecordedFrame(0.08, 0x000, b"\x01\x00")


def drive_3(at_s: float, cycle: int, *, in_fault: bool, fails: bool, stopped: bool) -> Iterator[Entry]:
    if cycle % 10 == 0:
        yield RecordedFrame(at_s + 0.0024, 0x703, b"\x04" if stopped else b"\x05")
    if fails:
        yield RecordedFrame(at_s + 0.0025, 0x083, struct.pack("<HB5x", 0x3220, 0x04))
    if not stopped:
        yield RecordedFrame(at_s + 0.003, 0x183, struct.pack("<H", 0x0208 if in_fault else 0x0237))


def drive_4(at_s: float, cycle: int, *, stopped: bool) -> Iterator[Entry]:
    if cycle % 10 == 0:
        yield RecordedFrame(at_s + 0.0035, 0x704, b"\x04" if stopped else b"\x05")
    if not stopped:
        yield RecordedFrame(at_s + 0.004, 0x184, struct.pack("<Hi", 0x0237, 990 + cycle % 3))


def facts_of(told: Explanation, node_id: int) -> str:
    return ", ".join(node_facts(told, told.network.nodes[node_id]))


def test_nodes_states_heartbeats_aborts_and_how_pdos_are_known() -> None:
    told = explain(somebody_s_robot())
    assert told.stories == []
    assert sorted(told.network.nodes) == [3, 4]
    assert told.network.nodes[3].axes[0].state is DriveState.OPERATION_ENABLED
    assert told.network.nodes[4].axes[0].velocity in (990, 991, 992)
    assert told.network.nodes[3].aborts == {(Address(0x1017), 0x0602_0000): 1}
    assert "heartbeat each 100 ms, 1 boot-ups" in facts_of(told, 3)
    text = "\n".join(text_lines(FACTS, told))
    assert "No stop was found" in text
    assert "The recording ends while" in text
    assert "PDOs 183h: assumed: default mapping of CiA 402" not in text  # 503h, 504h are assumed too, in one line
    assert "PDOs 183h, 503h, 504h: assumed: default mapping of CiA 402" in text
    assert "PDOs 184h: mapping written or read by SDO in this recording" in text


def test_what_robot_yaml_has_and_the_recording_has_not_and_what_nobody_can_decode() -> None:
    """The robot.yaml of another robot: its nodes 1 and 2 are not here."""
    told = explain(somebody_s_robot(), load_robot(sample("bench")).robot)
    assert gaps(told) == [
        "node 1 (left_wheel) of robot.yaml sends nothing in this recording",
        "node 2 (right_wheel) of robot.yaml sends nothing in this recording",
        "PDOs 183h (2 bytes), 503h (6 bytes), 504h (6 bytes): contents not known; they do not fit robot.yaml",
    ]
    frames = [RecordedFrame(0.01 * i, 0x285, bytes(7)) for i in range(5)]
    assert gaps(explain(frames)) == [
        "PDOs 285h (7 bytes): contents not known; give --config robot.yaml, or record from the boot on"
    ]


def test_a_node_that_falls_silent_is_named_with_its_time() -> None:
    told = explain(somebody_s_robot(dies_s=2.0))
    (story,) = told.stories
    assert story.cause is Cause.NODE_SILENT
    assert story.found.text.startswith("node 4 sends nothing after 1.9")
    assert story.found.at_s == pytest.approx(1.994, abs=0.002)
    assert "MISSING since 1.9" in facts_of(told, 4)


def test_a_drive_s_fault_has_its_emergency_in_words() -> None:
    (story,) = explain(somebody_s_robot(fault_s=2.0)).stories
    assert story.cause is Cause.DRIVE_FAULT
    assert (
        story.found.text == "node 3 reports 3220h under-voltage of the DC link; node 3 goes to fault (statusword 0208h)"
    )
    assert story.standstill.stood_s is None


def test_an_nmt_command_of_the_master_is_the_cause_where_drives_have_power() -> None:
    (story,) = explain(somebody_s_robot(stop_s=2.0)).stories
    assert story.cause is Cause.NMT_COMMAND
    assert story.found.text == "somebody sent NMT stop, all nodes, while a drive had power"


def test_the_boot_of_the_driver_is_no_ladder_of_a_tripped_watchdog() -> None:
    """Its ladder resets node 1; then the driver resets its communication, and starts it. 2FEh, 27Eh are known."""
    nmt = [RecordedFrame(0.1 * at, 0x000, bytes(data)) for at, data in enumerate(((129, 1), (130, 1), (1, 1)), 1)]
    own = [RecordedFrame(0.5, 0x2FE, bytes(8)), RecordedFrame(0.6, 0x27E, bytes(4))]
    told = explain([RecordedFrame(0.0, 0x1FE, b"\x02\x03\x00\x01\x05\x00\x00\x00"), *nmt, *own])
    commands = [(event.who, event.text) for event in told.events if event.kind is EventKind.NMT_COMMAND]
    assert commands == [
        ("watchdog", "its ladder: NMT reset node, node 1"),
        ("NMT master", "NMT reset communication, node 1"),
        ("NMT master", "NMT start, node 1"),
    ]
    assert gaps(told) == []


def test_a_heartbeat_that_pauses_and_comes_back_stops_nothing_and_is_told() -> None:
    frames = [RecordedFrame(0.1 * i, 0x705, b"\x05") for i in range(40) if not 20 <= i < 30]
    told = explain(frames)
    kinds = [event.kind for event in told.events]
    assert kinds == [EventKind.NMT_STATE, EventKind.HEARTBEAT_LOST, EventKind.HEARTBEAT_BACK]
    assert told.events[2].text == "heartbeat is back after 1.10 s"
    assert "longest pause 1.10 s" in facts_of(told, 5)


def test_node_guarding_is_no_heartbeat() -> None:
    frames: list[Entry] = []
    for i in range(20):
        frames.append(RecordedFrame(0.1 * i, 0x705, b"", kind=FrameKind.REMOTE))
        frames.append(RecordedFrame(0.1 * i + 0.001, 0x705, bytes([0x05 | 0x80 * (i % 2)])))
    told = explain(frames)
    assert [event.text for event in told.events] == ["operational"]
    assert "guarded each 100 ms" in facts_of(told, 5)


def test_a_node_that_is_no_longer_polled_owes_no_answer_and_one_that_does_not_answer_is_missing() -> None:
    answers = [RecordedFrame(0.1 * i + 0.001, 0x705, bytes([0x05 | 0x80 * (i % 2)])) for i in range(20)]
    polls = [RecordedFrame(0.1 * i, 0x705, b"", kind=FrameKind.REMOTE) for i in range(25)]
    later = [RecordedFrame(3.0 + 0.1 * i, 0x080, b"") for i in range(9)]
    asked = sorted([*answers, *polls[:20]], key=lambda frame: frame.at_s)
    assert explain([*asked, *later]).stories == []
    assert "MISSING" not in facts_of(explain([*asked, *later]), 5)
    told = explain([*asked, *polls[20:], *later])
    assert "MISSING since 1.901 s" in facts_of(told, 5)
    assert told.events[-1].text == "no answer to node guarding since 1.901 s, its period was 100 ms"


def a_machine_without_drives() -> list[RecordedFrame]:
    """Node 5 has another profile than 402; what its PDOs contain is its own matter. Its heartbeat ends at 3.9 s.

    The last frames are those of an application, with identifiers that CiA 301 gives to no PDO, and of LSS.
    """
    frames = [RecordedFrame(0.1 * i, 0x705, b"\x05") for i in range(40)]
    frames += [RecordedFrame(0.05 + 0.1 * i, 0x385, bytes.fromhex("2100ac000100")) for i in range(60)]
    frames += [RecordedFrame(6.1, cob_id, bytes(8)) for cob_id in (0x10A, 0x7EA, 0x7E5, 0x7E4)]
    return sorted(frames, key=lambda frame: frame.at_s)


REFUTATIONS = [
    sdo(5, "4000100000000000", "430010004802d100", 2.0),  # device type 0248h: profile 584
    [RecordedFrame(2.0, 0x185, bytes(8))],  # CiA 402's TPDO1 has 2 bytes
]


@pytest.mark.parametrize("refutation", REFUTATIONS)
def test_what_is_no_drive_has_no_state_of_a_drive(refutation: list[RecordedFrame]) -> None:
    frames = a_machine_without_drives()
    assert "operational, ready to switch on" in facts_of(explain(frames), 5)
    assert "385h: assumed" in "\n".join(text_lines(FACTS, explain(frames)))
    told = explain(sorted([*frames, *refutation], key=lambda frame: frame.at_s))
    text = "\n".join(text_lines(FACTS, told))
    assert "switch on" not in facts_of(told, 5)
    assert "assumed" not in text
    assert "385h (6 bytes)" in text
    assert "Alarm 1 of 1, at 4.2" in text
    assert "standstill:   unknown: the recording has no position (6064h)" in text


def test_robot_yaml_names_all_drives_other_nodes_are_none() -> None:
    """Six bytes fit canbase's layout of a generic drive, and canbase's watchdog is on this bus."""
    watchdog = RecordedFrame(0.0, 0x1FE, b"\x02\x03\x00\x01\x05\x00\x00\x00")
    frames = [watchdog, RecordedFrame(0.1, 0x185, struct.pack("<Hi", 0x21, 0))]
    told = explain(frames, load_robot(sample("bench")).robot)
    assert 5 not in told.network.nodes
    assert "PDOs 185h (6 bytes): contents not known; they do not fit robot.yaml" in gaps(told)


def test_a_device_type_of_cia_402_refutes_nothing() -> None:
    told = explain([*sdo(5, "4000100000000000", "4300100092010200", 0.0), *a_machine_without_drives()])
    assert "ready to switch on" in facts_of(told, 5)


def test_frames_that_cannot_be_pdos_are_not_called_so() -> None:
    assert gaps(explain(a_machine_without_drives())) == ["frames 10Ah (8 bytes), 7EAh (8 bytes): no service of CiA 301"]


def test_an_assumption_is_marked_though_another_mapping_is_learned_later() -> None:
    """Node 3 has the default mapping; node 4 is configured after its last frame."""
    frames = [RecordedFrame(0.01, 0x183, b"\x37\x02"), *(each for each in boot() if isinstance(each, RecordedFrame))]
    text = "\n".join(text_lines(FACTS, explain(frames)))
    assert "node 3: pre-operational before NMT start, operation enabled" in text
    assert "PDOs 183h: assumed: default mapping of CiA 402" in text


def test_without_a_statusword_no_stop_found_does_not_mean_that_no_drive_stopped() -> None:
    text = "\n".join(text_lines(FACTS, explain([RecordedFrame(0.1 * i, 0x705, b"\x05") for i in range(9)])))
    assert "No statusword (6041h) can be read: what the drives did is not known." in text
    assert "no drive lost" not in text.lower()


def test_no_stop_found_says_nothing_of_a_node_whose_statusword_cannot_be_read() -> None:
    """Node 2 has a TPDO that the default mapping of CiA 402 does not have: what it reports is not known."""
    frames = [
        RecordedFrame(0.01 * turn, cob_id, data)
        for turn in range(100)
        for cob_id, data in ((0x181, b"\x37\x02"), (0x182, b"\x08\x02" if turn > 50 else b"\x37\x02"), (0x382, b"abc"))
    ]
    text = "\n".join(text_lines(FACTS, explain(frames)))
    assert "No drive whose statusword (6041h) can be read lost its power in motion" in text
    assert "What node 2 did is not known." in text
    both = [frame for frame in frames if frame.cob_id == 0x181]
    assert "No drive lost its power in motion" in "\n".join(text_lines(FACTS, explain(both)))


def test_a_state_that_was_reported_before_an_nmt_command_is_not_the_state_now() -> None:
    frames = [RecordedFrame(0.0, 0x705, b"\0"), RecordedFrame(0.1, 0x000, b"\x01\x00")]
    assert facts_of(explain(frames), 5) == "pre-operational before NMT start, 1 boot-ups"
    assert facts_of(explain([*frames, RecordedFrame(0.2, 0x705, b"\x05")]), 5) == "operational, 1 boot-ups"


def test_error_frames_are_counted() -> None:
    told = explain([RecordedFrame(0.1 * i, 0x20, bytes(8), kind=FrameKind.ERROR) for i in range(9)])
    assert told.network.error_frames == 9
    assert [event.text for event in told.events] == ["the first error frame"]


def test_hostile_text_is_one_line_and_cannot_control_the_terminal() -> None:
    notes = [Note(0.0, "motor_driver ENABLED"), Note(0.1, "motor_driver LATCHED: bad\x1b[2J (a\nb); ends with: reset")]
    lines = list(text_lines(RecordingFacts("x\x1b[2J", "ASC", "", "", ("a\nb",)), explain(notes)))
    assert not any("\x1b" in line or "\n" in line for line in lines)


def test_the_same_event_again_and_again_is_one_line_with_its_number() -> None:
    told = explain(somebody_s_robot(dies_s=2.0))
    again = [told.events[0]] * 5
    assert collapsed(again) == [(told.events[0], 5)]


class TestBeat:
    def test_a_burst_of_frames_that_waited_does_not_make_the_period_short(self) -> None:
        beat = Beat()
        for at_s in [0.0] * 20 + [0.1 * i for i in range(1, 30)]:
            beat.on_beat(at_s)
        assert beat.period_s == pytest.approx(0.1)
        assert not beat.is_missing(2.9 + 0.29)
        assert beat.is_missing(2.9 + 0.31)

    def test_what_came_rarely_is_never_missing(self) -> None:
        beat = Beat()
        beat.on_beat(1.0)
        beat.on_beat(2.0)
        assert not beat.is_missing(1e6)


class TestLoad:
    def test_the_bins_grow_with_the_recording_and_not_their_number(self) -> None:
        load = LoadSeries(500_000)
        for second in range(100_000):
            load.on_frame(float(second), 111)
        assert len(load.shares) <= MOST_BINS
        assert sum(share * load.bin_s for _, share in load.shares) * 500_000 == pytest.approx(100_000 * 111)

    def test_a_time_far_away_is_no_reason_to_fill_memory(self) -> None:
        load = LoadSeries(500_000)
        load.on_frame(0.0, 100)
        load.on_frame(1e12, 100)
        assert len(load.shares) <= MOST_BINS


HEARTBEAT = (RecordedFrame(0.9, 0x77F, b"\x05", sent=True), RecordedFrame(0.901, 0x77F, b"\x05"))


class TestEcho:
    def test_one_copy_of_each_sent_frame_is_taken_away(self) -> None:
        sent, received = RecordedFrame(1.0, 0x80, b"", sent=True), RecordedFrame(1.001, 0x80, b"")
        stranger = RecordedFrame(1.002, 0x80, b"")
        echo = EchoFilter()
        assert list(echo.without([*HEARTBEAT, sent, received, stranger])) == [HEARTBEAT[0], sent, stranger]
        assert echo.echoes == 2

    def test_where_the_driver_does_not_hear_its_heartbeat_an_equal_frame_is_another_master_s(self) -> None:
        frames = [HEARTBEAT[0], RecordedFrame(1.0, 0x80, b"", sent=True), RecordedFrame(1.001, 0x80, b"")]
        assert list(EchoFilter().without(frames)) == frames

    def test_copies_before_the_first_heartbeat_are_taken_away_too(self) -> None:
        """A recording that begins with them has no second master."""
        cycles = [
            RecordedFrame(0.8 + 0.01 * turn + 0.001 * (not sent), 0x80, b"", sent=sent)
            for turn in range(9) for sent in (True, False)
        ]  # fmt: skip
        without = list(EchoFilter().without([*cycles, *HEARTBEAT]))
        assert without == [*(frame for frame in cycles if frame.sent), HEARTBEAT[0]]

    def test_a_late_copy_is_somebody_else_s(self) -> None:
        frames = [RecordedFrame(1.0, 0x201, b"\x0f\x00", sent=True), RecordedFrame(1.2, 0x201, b"\x0f\x00")]
        assert list(EchoFilter().without([*HEARTBEAT, *frames])) == [HEARTBEAT[0], *frames]


def test_levels_are_ordered() -> None:
    assert Level.INFO < Level.WARNING < Level.ALARM
