"""A drive that is there and not ready yet: what its messages make of the sentence about it, and of its cure.

CiA 301 has no time limit for a start: 10 s after it, some drives refuse every SDO request, or answer none.
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.drives.canopen_node import HELD, CanopenNode, Presence
from canbase_driver.drives.signs_of_life import SignsOfLife
from support.chain_world import bench_robot
from support.fake_drive import DEVICE_STATE, FakeDrive, u32

WIRING = "check its power"
BOOT_UP, PRE_OPERATIONAL = NmtState.INITIALISING, NmtState.PRE_OPERATIONAL


@dataclass
class Starting(FakeDrive):
    """It is switched on at 0 s, or at its last NMT reset, and has started `start_s` later."""

    start_s: float = 10.0
    answers: bool = True
    """Meanwhile it refuses all requests by abort 0800 0022h; False: it answers none."""
    from_reset: bool = False
    now_s: float = 0.0
    on_at: float = 0.0

    def on_frame(self, frame: Frame) -> list[Frame]:
        if self.from_reset and frame == Frame(0x000, b"\x82\x01"):
            self.on_at = self.now_s
        if self.now_s >= self.on_at + self.start_s:
            return super().on_frame(frame)
        is_request = self.answers and frame.cob_id == 0x601 and frame.data[0] != 0x80
        return [Frame(0x581, b"\x80" + frame.data[1:4] + u32(DEVICE_STATE))] if is_request else []


class Story:
    """One node with its drive on a bus. A cycle takes 10 ms; at 0 s both are switched on."""

    def __init__(self, drive: FakeDrive) -> None:
        self.robot = bench_robot()
        self.node = CanopenNode(1, self.robot)
        self.drive = drive
        self.now_s = 0.0
        self.said: list[str] = []

    def run(self, until_s: float, beats: bool = False) -> None:
        """`beats`: it sends a heartbeat each 0.1 s."""
        while self.now_s < until_s and self.node.presence is not Presence.STARTING:
            self.now_s = round(self.now_s + 0.01, 3)
            self.drive.now_s = self.now_s  # type: ignore[attr-defined]
            if beats and round(100.0 * self.now_s) % 10 == 0:
                self.hear(0x701, "7F")
            self.node.begin_boot(self.now_s)
            frames = self.node.tick(self.now_s)
            while frames:
                answers = [answer for frame in frames for answer in self.drive.on_frame(frame)]
                for answer in answers:
                    (self.node.on_heartbeat if answer.cob_id == 0x701 else self.node.on_sdo)(answer, self.now_s)
                frames = self.node.tick(self.now_s) if answers else []
            self.said += [self.node.waiting_for(self.now_s), self.node.missing(self.now_s), self.node.boot_error]

    def hear(self, cob_id: int, data: str) -> None:
        take = self.node.on_emcy if cob_id == 0x081 else self.node.on_heartbeat
        take(Frame(cob_id, bytes.fromhex(data)), self.now_s)


# 0 s ── switched on, refuses 1000h and 6041h by 0800 0022h ── 12 s ── has started, and is booted
def test_a_drive_that_refuses_everything_for_12_s_is_said_to_start_and_its_wiring_is_not_doubted() -> None:
    story = Story(Starting(start_s=12.0))
    story.run(11.0)
    told = story.node.missing(story.now_s)
    assert told.startswith("node 1 (left_wheel) is missing since 11 s: node 1: 6041h:0: 0800 0022h")
    assert "it may still be starting, and the boot goes on by itself" in told
    assert "Its first message came 1" in story.node.boot_error
    story.run(40.0)
    assert story.node.presence is Presence.STARTING
    assert [said for said in story.said if WIRING in said or "axis`" in said] == []


# 0 s ── boot-up message, no answer ── 12 s ── has started, and is booted
def test_a_drive_that_answers_nothing_for_12_s_after_its_boot_up_message_is_said_to_start() -> None:
    story = Story(Starting(start_s=12.0, answers=False))
    story.hear(0x701, "00")
    story.run(11.0)
    assert story.node.waiting_for(story.now_s) == (
        "waiting for node 1 (left_wheel): the answer to 1000h:0; it sent its boot-up message 11.0 s ago, so power and "
        "cable are right: it may still be starting, and the boot goes on by itself"
    )
    assert "it sent its boot-up message 11.0 s ago" in story.node.missing(story.now_s)
    story.run(40.0)
    assert story.node.presence is Presence.STARTING
    assert [said for said in story.said if WIRING in said] == []


# 0 s ── boots ── NMT reset ── 12 s of aborts ── it answers ── the next boot waits as long
def test_a_drive_that_refuses_everything_for_12_s_after_its_nmt_reset_is_waited_for() -> None:
    drive = Starting(start_s=12.0, on_at=-12.0, from_reset=True, answers_nmt_reset=False)
    story = Story(drive)
    while story.node.presence is not Presence.STARTING:
        assert story.now_s < 60.0, "it never boots"
        story.run(story.now_s + 0.01)
    said = list(dict.fromkeys(story.said))
    assert any("its boot-up message has not come: it may take longer, and the boot learns how long" in s for s in said)
    assert any("it answered 12.0 s after an NMT reset: set `start.boot_up_s: 16.1`" in s for s in said)
    assert [said for said in story.said if WIRING in said] == []


def test_of_a_drive_that_sends_nothing_all_is_to_be_checked_that_may_be_wrong() -> None:
    story = Story(FakeDrive(powered=False))
    story.run(10.1)
    nothing = "no message has come from it: check its power, its cable, its node id and the bit rate"
    assert story.node.waiting_for(story.now_s).endswith(nothing)
    assert story.node.missing(story.now_s) == f"node 1 (left_wheel) is missing since 10 s: not booted yet; {nothing}"


def test_a_drive_that_beats_and_answers_no_request_is_not_starting_any_more_after_30_s() -> None:
    story = Story(Starting(start_s=1000.0, answers=False))
    story.run(20.0, beats=True)
    told = story.node.waiting_for(story.now_s)
    assert "it sent a heartbeat (pre-operational) 0.0 s ago, so power and cable are right: it may still be" in told
    story.run(31.0, beats=True)
    told = story.node.waiting_for(story.now_s)
    assert "but it answers no request of the boot: let no other program use its SDO channel" in told
    assert told.endswith("then switch the drive off and on again")


# 0 s ── boot fails by 6060h ── 5 s ── cable cut ── 16 s
def test_a_drive_whose_cable_is_cut_after_a_failed_boot_is_known_by_its_last_message() -> None:
    story = Story(FakeDrive(refuse={(0x6060, 0): 0x06090030}))
    story.run(5.0)
    assert "Its first message came" not in story.node.boot_error, "its mode has nothing to do with its start"
    story.drive.powered = False
    story.run(16.0)
    told = story.node.missing(story.now_s)
    assert "6060h:0: 0609 0030h" in told
    assert "; its last message came 1" in told
    assert told.endswith("s ago (abort 0609 0030h value not valid): check its power and its cable")


def test_an_emergency_message_is_a_sign_too_and_an_abort_is_told_in_words() -> None:
    story = Story(Starting(start_s=1000.0, answers=False))
    story.run(3.0)
    story.hear(0x081, "2031000000000000")
    assert "it sent an emergency message 0.0 s ago" in story.node.waiting_for(story.now_s)
    signs = SignsOfLife()
    signs.on_sdo(Frame(0x581, bytes.fromhex("8000100022000008")), 1.0)
    assert "it sent abort 0800 0022h data cannot be transferred" in signs.what_to_check(2.0)


@pytest.mark.parametrize(("of_reset", "starts"), [(True, False), (False, True)])
def test_a_boot_up_message_that_the_driver_has_caused_begins_no_new_start(of_reset: bool, starts: bool) -> None:
    signs = SignsOfLife()
    for second in range(100):
        signs.on_heartbeat(PRE_OPERATIONAL, float(second), of_reset=False)
    signs.on_heartbeat(BOOT_UP, 100.0, of_reset=of_reset)
    assert bool(signs.may_be_starting(101.0)) is starts


# 0 s ── another master keeps it pre-operational, so nothing is booted ── 60 s ── nobody is sent to drive or cable
def test_of_a_node_that_nmt_commands_keep_pre_operational_the_master_is_named() -> None:
    story = Story(Starting())
    hold = Frame(0x000, b"\x80\x01")
    story.node.on_nmt(hold, 0.0)
    story.run(0.01)
    story.now_s = 60.0
    story.hear(0x701, "7F")
    story.node.on_nmt(hold, story.now_s)
    told = story.node.missing(story.now_s + 0.1)
    assert told == f"node 1 (left_wheel) is missing since 60 s: {HELD}"
    assert WIRING not in told
    assert HELD not in story.node.missing(story.now_s + 0.3)
