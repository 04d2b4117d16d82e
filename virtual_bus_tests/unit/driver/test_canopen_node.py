"""One node at run time: gone, booting, starting, ready, told step by step with the frames that lead there."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import pytest

from canbase_config.robot import Robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.drives.axis import Axis
from canbase_driver.drives.canopen_node import CanopenNode, Presence
from support.chain_world import bench_robot
from support.fake_drive import FakeDrive

NEVER = -math.inf

GONE, BOOTING, STARTING, READY = Presence
BOOT_UP, OPERATIONAL, PRE_OPERATIONAL, STOPPED = 0x00, 0x05, 0x7F, 0x04
START = Frame(0x000, b"\x01\x01")


@dataclass
class Story:
    """Node 1 of the sample robot and a drive of a few lines; the clock moves by 10 ms."""

    robot: Robot = field(default_factory=bench_robot)
    drive: FakeDrive = field(default_factory=FakeDrive)
    now_s: float = 10.0
    sent: list[Frame] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.node = CanopenNode(1, self.robot)

    @property
    def axis(self) -> Axis:
        return self.node.axes[0]

    def wait(self, seconds: float) -> None:
        """Time passes, nobody says anything but the drive's SDO server."""
        for _ in range(round(seconds / 0.01)):
            self.now_s += 0.01
            waiting = self.node.tick(self.now_s)
            while waiting:
                self.sent += waiting
                answers = [answer for frame in waiting for answer in self.drive.on_frame(frame)]
                waiting = [frame for answer in answers for frame in self._hear(answer)]

    def heartbeat(self, state: int) -> bool:
        return self.node.on_heartbeat(Frame(0x701, bytes([state])), self.now_s)

    def status(self, beyond: bytes = b"") -> bool:
        """Status and velocity, as they answer one SYNC."""
        data = bytes.fromhex("37 06 10 00 00 00") + beyond
        status = self.node.on_status(self.axis, Frame(0x181, data), self.now_s)
        return self.node.on_velocity(self.axis, Frame(0x281, bytes(4)), self.now_s) and status

    def booted(self) -> Story:
        self.node.begin_boot(self.now_s)
        self.wait(1.0)
        return self

    def started(self) -> Story:
        """Booted, and an answer of the drive to the NMT start has come."""
        self.node.begin_boot(self.now_s)
        while self.node.presence is not STARTING:
            self.wait(0.01)
        return self

    def ready(self) -> Story:
        self.started()
        self.heartbeat(OPERATIONAL)
        self.status()
        self.wait(0.01)
        assert self.node.presence is READY
        return self

    def _hear(self, frame: Frame) -> list[Frame]:
        if frame.cob_id == 0x701:
            self.node.on_heartbeat(frame, self.now_s)
        else:
            self.node.on_sdo(frame, self.now_s)
        return self.node.tick(self.now_s)


def test_at_first_it_is_gone_and_sends_nothing() -> None:
    story = Story()
    story.wait(0.1)
    assert story.node.presence is GONE
    assert story.sent == []
    assert story.node.absent() == "node 1 (left_wheel) not booted yet"
    assert (story.node.waiting_for(10.0), story.node.silent(10.0, NEVER)) == ("", "")


def test_a_boot_that_ends_well_starts_the_node_and_waits_for_its_first_feedback() -> None:
    story = Story().started()
    assert story.sent[-1] == START
    assert story.sent.count(START) == 1
    assert story.node.has_pdos
    assert story.node.report is not None
    assert story.node.report.stops_by_itself
    assert story.node.waiting_for(story.now_s).startswith(
        "node 1 (left_wheel): waiting for its first feedback since 0."
    )
    assert (story.node.absent(), story.node.silent(story.now_s, NEVER)) == ("", "")


def test_when_it_is_configured_it_waits_for_the_boots_of_the_others() -> None:
    story = Story()
    story.node.others_are_configured = lambda: False
    story.booted()
    assert story.node.presence is BOOTING
    assert not story.node.is_being_configured
    assert START not in story.sent
    assert story.node.waiting_for(story.now_s) == "node 1 (left_wheel): configured, waits for the boots of the others"
    story.node.others_are_configured = lambda: True
    story.wait(0.01)
    assert story.node.presence is STARTING
    assert story.sent[-1] == START


def test_a_restart_while_it_waits_for_the_others_is_noticed_at_once() -> None:
    story = Story()
    story.node.others_are_configured = lambda: False
    story.booted()
    story.heartbeat(BOOT_UP)
    assert story.node.presence is GONE
    assert story.node.absent() == "node 1 (left_wheel) restarted (boot-up message)"


@pytest.mark.parametrize(("state", "counts"), [(PRE_OPERATIONAL, False), (BOOT_UP, False), (OPERATIONAL, True)])
def test_feedback_with_the_id_of_a_drive_that_is_not_operational_is_not_its_own(state: int, counts: bool) -> None:
    """It had power when it was lost. A drive with the same node id is at standstill and answers each SYNC."""
    story = Story().ready()
    story.heartbeat(PRE_OPERATIONAL)
    story.heartbeat(state)
    assert story.node.presence is GONE
    story.status()
    assert (story.axis.status_at > NEVER, story.axis.velocity_at > NEVER) == (counts, counts)


def test_a_drive_that_is_not_there_keeps_nobody_waiting() -> None:
    story = Story(drive=FakeDrive(powered=False))
    story.node.begin_boot(story.now_s)
    story.wait(2.0)
    assert story.node.presence is BOOTING
    assert not story.node.is_being_configured


@pytest.mark.parametrize(("beats", "speaks"), [(False, False), (True, False), (False, True)])
def test_without_heartbeat_or_status_it_is_lost_after_a_second(beats: bool, speaks: bool) -> None:
    story = Story().started()
    for _ in range(99):
        story.wait(0.01)
        story.heartbeat(OPERATIONAL if beats else PRE_OPERATIONAL)
        if speaks:
            story.status()
    assert story.node.presence is STARTING  # a pre-operational heartbeat may still be on its way
    story.wait(0.03)
    assert story.node.presence is GONE
    absent = story.node.absent()
    assert absent.startswith("node 1 (left_wheel) could not be started: within 1.0 s of NMT start it sent ")
    assert ("a heartbeat that says pre-operational, not operational" in absent) is not beats
    assert ("no status of left_wheel (its TPDOs: see pdo.synchronous of its drive profile)" in absent) is (
        beats and not speaks
    )
    assert "cable" not in story.node.missing(story.now_s + 60.0)  # it has answered every SDO


def test_a_drive_without_a_heartbeat_is_said_to_have_none() -> None:
    story = Story().started()
    said = "sent no heartbeat (1017h; where it has node guarding alone, set `self_stop.node_guarding: true` and `self"
    for _ in range(499):
        story.wait(0.01)
        story.status()
    assert said in story.node.waiting_for(story.now_s)
    story.wait(0.02)
    story.status()
    assert said in story.node.absent()
    assert said in story.node.boot_error


def test_a_first_heartbeat_some_seconds_after_the_start_is_waited_for() -> None:
    story = Story().started()
    for _ in range(300):
        story.wait(0.01)
        story.status()
    assert story.node.presence is STARTING
    story.heartbeat(OPERATIONAL)
    story.wait(0.01)
    story.status()
    assert (story.node.presence, story.node.boot_error) == (READY, "")


def test_a_status_of_another_length_is_named_with_its_object() -> None:
    story = Story().started()
    for _ in range(103):
        story.wait(0.01)
        story.heartbeat(OPERATIONAL)
        story.status(beyond=b"\0\0")
    assert "it sent TPDO1 (181h) of left_wheel with 8 bytes, its mapping has 6: let 1A00h map 6041h:0" in (
        story.node.boot_error
    )


def test_a_node_that_is_silent_without_power_is_asked_again_after_a_second() -> None:
    story = Story().ready()
    ready_at = story.now_s
    while story.node.presence is READY:
        story.wait(0.01)
        story.node.seek(story.now_s, NEVER)
    assert story.now_s - ready_at == pytest.approx(1.0, abs=0.03)
    assert story.node.absent().endswith("s and is looked for")
    story.sent.clear()
    story.booted()
    assert story.sent[0] == Frame(0x601, bytes.fromhex("40 00 10 00 00 00 00 00"))  # 1000h
    assert story.node.presence is STARTING


def test_a_node_that_was_not_asked_for_a_second_is_not_looked_for() -> None:
    story = Story().ready()
    story.wait(3.0)
    story.node.seek(story.now_s, story.now_s - 0.9)  # the driver itself paused: its SYNCs began 0.9 s ago
    assert story.node.presence is READY
    story.node.seek(story.now_s, story.now_s - 1.1)
    assert story.node.presence is GONE


def test_a_reference_from_between_the_loss_and_the_boot_is_lost_with_the_boot_and_counts() -> None:
    story = Story().ready()
    story.node.lose("was cut off from the bus", story.now_s)
    story.status()
    assert story.axis.losses == 1
    story.started()
    assert story.axis.losses == 2


def test_a_second_boot_up_message_of_one_start_is_waited_for_in_the_next_boot() -> None:
    story = Story().ready()
    for said in ("if it does so after each boot, set start.settle_s", "again; the next boot waits for it"):
        while story.now_s - story.node._boot_up_at < 0.8:
            story.wait(0.01)
        story.heartbeat(BOOT_UP)
        assert said in story.node.absent()
        began = story.now_s
        story.started()
    assert story.now_s - began > 1.3 * 0.8
    assert story.node.report is not None
    assert any("two boot-up messages: set `start.settle_s: 1.3` in" in note for note in story.node.report.notes)


def test_a_boot_up_message_long_after_the_boot_is_a_restart_and_changes_nothing_about_the_next_boot() -> None:
    story = Story().ready()
    story.wait(6.0)
    story.heartbeat(BOOT_UP)
    assert story.node.absent() == "node 1 (left_wheel) restarted (boot-up message)"
    began = story.now_s
    story.started()
    assert story.now_s - began < 0.5


def test_a_drive_that_loses_its_supply_soon_after_its_boot_is_booted_at_once() -> None:
    """Twice, but not as late after its boot each time: that is no second boot-up message of one start."""
    story = Story().ready()
    for lives_s in (2.0, 1.0):
        story.wait(lives_s)
        story.heartbeat(BOOT_UP)
        began = story.now_s
        story.ready()
        assert story.now_s - began < 0.5


def test_why_a_boot_failed_is_known_until_the_node_is_ready() -> None:
    story = Story(drive=FakeDrive(refuse={(0x60FF, 0): 0x08000022}))
    story.node.begin_boot(story.now_s)
    story.wait(2.5)
    assert "60FFh:0: 0800 0022h" in story.node.boot_error
    story.drive.refuse.clear()
    story.wait(1.0)
    story.ready()
    assert story.node.boot_error == ""


def test_with_both_it_is_ready() -> None:
    story = Story().ready()
    assert (story.node.waiting_for(story.now_s), story.node.absent(), story.node.silent(story.now_s, NEVER)) == (
        "",
        "",
        "",
    )
    assert story.node.nmt_state is NmtState.OPERATIONAL


@pytest.mark.parametrize(("age_s", "silent"), [(0.09, False), (0.11, True)])
def test_a_status_that_is_too_old_is_silence(age_s: float, silent: bool) -> None:
    story = Story().ready()
    since = story.axis.status_at
    sentence = f"node 1 (left_wheel): no status (6041h, 6064h) for {age_s:.2f} s (timeouts.feedback_s 0.1 s)"
    assert story.node.silent(since + age_s, NEVER) == (sentence if silent else "")


@pytest.mark.parametrize(
    ("run_s", "age_s", "silent"),
    [
        (0.0, 0.15, False),
        (0.09, 0.24, False),
        (0.11, 0.26, True),
        (0.0, 0.39, False),  # however often we pause: no longer than 0.3 s + 0.1 s
        (0.0, 0.41, True),
    ],
)
def test_a_drive_that_was_not_asked_is_not_silent(run_s: float, age_s: float, silent: bool) -> None:
    """status ──── our pause ──── SYNCs again ── `run_s` ── now: the drive has 0.1 s from there on."""
    story = Story().ready()
    now_s = story.axis.status_at + age_s
    story.node.heartbeat_at = now_s
    sentence = f"node 1 (left_wheel): no status (6041h, 6064h) for {age_s:.2f} s (timeouts.feedback_s 0.1 s)"
    assert story.node.silent(now_s, now_s - run_s) == (sentence if silent else "")


def test_a_heartbeat_that_is_too_old_is_silence_though_the_status_is_fresh() -> None:
    story = Story().ready()
    beat_at = story.node.heartbeat_at
    story.now_s = beat_at + 0.31
    story.status()
    assert (
        story.node.silent(beat_at + 0.31, NEVER)
        == "node 1 (left_wheel): no heartbeat for 0.31 s (timeouts.drive_heartbeat_s 0.3 s)"
    )
    story.heartbeat(OPERATIONAL)
    assert (
        story.node.silent(story.now_s, NEVER) == ""
    )  # it is ready again by itself; what is latched is the state machine's


@pytest.mark.parametrize(
    ("state", "why"),
    [
        (BOOT_UP, "restarted (boot-up message)"),
        (PRE_OPERATIONAL, "left NMT operational (pre-operational)"),
        (STOPPED, "left NMT operational (stopped)"),
    ],
)
def test_ready_ends_with_any_other_nmt_state(state: int, why: str) -> None:
    story = Story().ready()
    assert story.heartbeat(state)
    assert story.node.presence is GONE
    assert story.node.absent().startswith(f"node 1 (left_wheel) {why}")
    assert story.node.report is None
    assert story.axis.status_at == -math.inf


def test_a_place_that_was_heard_before_the_nmt_start_is_no_reference() -> None:
    """Drives send no PDOs before it: a second drive with this node id, which is operational, told that place."""
    story = Story().ready()
    story.heartbeat(PRE_OPERATIONAL)
    story.heartbeat(OPERATIONAL)
    assert story.status()
    assert story.axis.travel.referenced
    story.wait(0.3)
    story.started()
    assert not story.axis.travel.referenced
    story.status()
    assert story.axis.travel.referenced


def test_a_restart_while_it_is_starting_is_noticed_at_once() -> None:
    story = Story().started()
    story.heartbeat(BOOT_UP)
    assert story.node.absent().startswith("node 1 (left_wheel) restarted (boot-up message)")


def test_a_restart_forgets_the_emergency_message_of_the_life_before() -> None:
    story = Story().ready()
    assert story.node.on_emcy(Frame(0x081, bytes.fromhex("10 23 02 00 00 00 00 00")), story.now_s)
    assert story.node.emcy is not None
    story.heartbeat(BOOT_UP)
    assert story.node.emcy is None


def test_a_heartbeat_whose_reserved_bit_is_set_counts() -> None:
    story = Story().ready()
    story.now_s += 0.05
    assert story.node.on_heartbeat(Frame(0x701, b"\x85"), story.now_s)
    assert (story.node.presence, story.node.heartbeat_at) == (READY, story.now_s)


@pytest.mark.parametrize("data", ["", "05 00", "63", "80"])
def test_what_is_no_heartbeat_is_refused_and_changes_nothing(data: str) -> None:
    story = Story().ready()
    beat_at = story.node.heartbeat_at
    story.now_s += 0.05
    assert not story.node.on_heartbeat(Frame(0x701, bytes.fromhex(data)), story.now_s)
    assert (story.node.presence, story.node.heartbeat_at) == (READY, beat_at)


def test_emergency_messages_come_and_go_and_half_a_code_is_none() -> None:
    story = Story()
    assert story.node.on_emcy(Frame(0x081, bytes.fromhex("10 23 02")), 10.0)
    assert not story.node.on_emcy(Frame(0x081, b"\x10"), 10.0)
    assert story.node.emcy is not None
    assert story.node.emcy.code == 0x2310
    assert story.node.on_emcy(Frame(0x081, bytes(8)), 10.0)
    assert story.node.emcy is None


def test_feedback_counts_only_from_the_nmt_start_on_and_its_length_matters_only_then() -> None:
    story = Story()
    velocity = Frame(0x281, bytes.fromhex("10 00 00 00"))
    assert story.status()
    assert story.node.on_velocity(story.axis, velocity, story.now_s)
    assert story.node.on_status(story.axis, Frame(0x181), 10.0)
    assert (story.axis.state, story.axis.velocity_mps) == (None, 0.0)
    story.started()
    assert story.status()
    assert story.node.on_velocity(story.axis, velocity, story.now_s)
    assert story.axis.velocity_mps > 0.0
    assert not story.node.on_status(story.axis, Frame(0x181), story.now_s)
    assert not story.node.on_velocity(story.axis, Frame(0x281), story.now_s)


def test_a_second_begin_does_nothing_while_it_boots_or_is_there() -> None:
    story = Story()
    story.node.begin_boot(story.now_s)
    story.wait(0.01)
    story.node.begin_boot(story.now_s)
    story.wait(0.01)
    assert [str(frame) for frame in story.sent].count("601h [40 00 10 00 00 00 00 00]") == 1
    ready = Story().ready()
    ready.node.begin_boot(ready.now_s)
    assert ready.node.presence is READY


def test_a_boot_that_fails_is_tried_again_after_a_second_and_its_error_is_told_meanwhile() -> None:
    story = Story()
    story.drive.refuse[0x6060, 0] = 0x06090030
    story.booted()
    assert story.node.presence is GONE
    assert "could not be booted: node 1" in story.node.absent()
    failed_at = story.now_s
    story.node.begin_boot(failed_at)
    assert story.node.presence is GONE
    story.now_s += 1.1
    story.drive.powered = False
    story.node.begin_boot(story.now_s)
    story.wait(0.05)
    assert story.node.presence is BOOTING
    assert story.node.waiting_for(story.now_s).startswith(
        "waiting for node 1 (left_wheel): the answer to 1000h:0 (last"
    )


def test_sdo_answers_without_a_boot_are_somebody_elses_and_fine() -> None:
    assert Story().node.on_sdo(Frame(0x581, bytes(8)), 10.0)


LAST = bytes.fromhex("01 18 01")
"""1801h:1, the COB-ID of the velocity: what the boot of this drive writes last."""


class Forgetful(FakeDrive):
    """It never sends its first answer to the last write of the boot."""

    forgets = True

    def on_frame(self, frame: Frame) -> list[Frame]:
        answers = super().on_frame(frame)
        is_last = frame.data[1:4] == LAST and frame.data[0] >> 5 == 1 and not frame.data[7] & 0x80
        if is_last and self.forgets:
            self.forgets = False
            return []
        return answers


def waiting_for_the_others(drive: FakeDrive, seconds: float = 1.0) -> Story:
    """Its boot has ended, and that of another drive goes on."""
    story = Story(drive=drive)
    story.node.others_are_configured = lambda: False
    story.node.begin_boot(story.now_s)
    story.wait(seconds)
    assert story.node.waiting_for(story.now_s).endswith("configured, waits for the boots of the others")
    return story


def writes(story: Story) -> list[bytes]:
    """The addresses of the writes that it sent, in order."""
    return [frame.data[1:4] for frame in story.sent if frame.cob_id == 0x601 and frame.data[0] >> 5 == 1]


def written_anew(story: Story) -> str:
    """Why it is booted anew, once the others are ready and it shows that it has no power."""
    story.node.others_are_configured = lambda: True
    story.wait(0.01)
    story.node.on_status(story.axis, Frame(0x181, bytes.fromhex("40 02 00 00 00 00")), story.now_s)
    story.wait(0.01)
    return story.node.absent()


# the answer to the last write of the boot gets lost ── 0.3 s: written again ── the units are read ── foreign write
def test_the_last_write_of_a_boot_hides_no_foreign_one_though_it_was_requested_twice() -> None:
    story = waiting_for_the_others(Forgetful())
    assert writes(story)[-2:] == [LAST, LAST]
    story.node.on_sdo(Frame(0x581, b"\x60" + LAST + bytes(4)), story.now_s)
    assert written_anew(story).endswith(
        "is configured anew: another client, or a gateway that repeats answers, has written its 1801h:1"
    )


# the last write of the boot is requested and confirmed once ── 5 s: another drive boots ── foreign write of that object
def test_while_a_node_waits_for_the_boots_of_the_others_its_own_last_write_hides_no_foreign_one() -> None:
    story = waiting_for_the_others(FakeDrive())
    assert writes(story)[-1] == LAST
    story.wait(5.0)
    story.node.on_sdo(Frame(0x581, b"\x60" + LAST + bytes(4)), story.now_s)
    assert written_anew(story).endswith(
        "is configured anew: another client, or a gateway that repeats answers, has written its 1801h:1"
    )


# requested twice, and the drive refuses 60A9h ── the same, and it answers nothing more: the boot has failed
@pytest.mark.parametrize("silent", [False, True])
def test_a_refusal_of_the_units_is_an_answer_and_silence_is_none(silent: bool) -> None:
    class Odd(Forgetful):
        def on_frame(self, frame: Frame) -> list[Frame]:
            self.powered = self.powered and not (silent and not self.forgets and frame.data[1:4] == b"\xa9\x60\x00")
            return super().on_frame(frame)

    story = Story(drive=Odd(refuse_read={} if silent else {(0x60A9, 0): 0x08000000}))
    story.node.begin_boot(story.now_s)
    story.wait(3.0)
    if silent:
        assert "no answer to 3 requests" in story.node.absent()
    else:
        assert START in story.sent


# the boot begins ── a foreign write of 100Ch, which this boot never sets ── booted anew once it has no power
@pytest.mark.parametrize(
    ("written", "why"),
    [
        (
            "60 0C 10 00 00 00 00 00",
            "is configured anew: another client, or a gateway that repeats answers, has written its 100Ch:0",
        ),
        ("60 16 10 01 00 00 00 00", ""),  # the boot sets it later
        (
            "60 F9 60 01 00 00 00 00",
            "is configured anew: another client, or a gateway that repeats answers, has written its 60F9h:1",
        ),  # a gain
    ],
)
def test_what_another_client_writes_early_in_a_boot_counts_where_the_boot_does_not_set_it(
    written: str, why: str
) -> None:
    story = Story()
    story.node.begin_boot(story.now_s)
    story.node.on_sdo(Frame(0x581, bytes.fromhex(written)), story.now_s)
    story.node.others_are_configured = lambda: False
    story.wait(1.0)
    assert written_anew(story).endswith(why)
    assert (story.node.presence is GONE) == bool(why)


def test_a_boot_up_before_the_boot_is_no_loss() -> None:
    story = Story()
    story.heartbeat(BOOT_UP)
    assert story.node.absent() == "node 1 (left_wheel) not booted yet"


def test_a_heartbeat_from_before_the_nmt_start_is_no_answer_to_it() -> None:
    story = Story()

    def beat(_drive: FakeDrive, _data: bytes) -> None:
        story.heartbeat(OPERATIONAL)  # a drive that starts by itself

    story.drive.on_write[0x60FF, 0] = beat
    story.started()
    story.status()
    story.wait(0.01)
    assert story.node.presence is STARTING
    story.heartbeat(OPERATIONAL)
    story.wait(0.01)
    assert story.node.presence is READY


# -- an NMT reset that takes longer than the profile has it


@dataclass
class SlowReset(FakeDrive):
    """Each NMT reset communication takes `took_s`; meanwhile it answers nothing."""

    took_s: float = 0.0
    now_s: float = 0.0
    back_at: float = NEVER

    def on_frame(self, frame: Frame) -> list[Frame]:
        if frame == Frame(0x000, b"\x82\x01"):
            self.back_at = self.now_s + self.took_s
        return super().on_frame(frame) if self.now_s >= self.back_at else []


@pytest.mark.parametrize(("took_s", "shows"), [(5.1, True), (8.0, True), (8.0, False)])
def test_a_node_that_needs_long_for_its_reset_is_waited_for_in_the_next_boot(took_s: float, shows: bool) -> None:
    """start.boot_up_s is 5 s. `shows`: by a boot-up message; without one by its first answer."""
    drive = SlowReset(answers_nmt_reset=False, took_s=took_s)
    story, errors = Story(drive=drive), []
    while story.node.presence is not STARTING:
        assert story.now_s < 60.0, "it never boots"
        story.node.begin_boot(story.now_s)
        drive.now_s = round(story.now_s + 0.01, 3)
        story.wait(0.01)
        if shows and drive.back_at - 0.005 < story.now_s < drive.back_at + 0.005:
            story.heartbeat(BOOT_UP)
        errors.append(story.node.boot_error)
    assert any("start.boot_up_s" in error for error in errors)
    assert story.node.report is not None
    assert any("it needs long for an NMT reset: set `start.boot_up_s: " in note for note in story.node.report.notes)


def test_a_boot_that_fails_after_its_reset_was_answered_says_nothing_about_resets() -> None:
    """The drive sends no boot-up message, so the boot goes on after 5 s, and fails for another reason."""
    drive = FakeDrive(answers_nmt_reset=False, refuse={(0x6060, 0): 0x06090030})
    story = Story(drive=drive)
    story.node.begin_boot(story.now_s)
    story.wait(7.5)
    story.node.begin_boot(story.now_s)
    story.wait(1.0)
    assert "6060h:0" in story.node.boot_error
    assert "start.boot_up_s" not in story.node.boot_error


def test_a_node_that_is_configured_and_waits_for_another_is_not_missing() -> None:
    story = Story()
    story.node.others_are_configured = lambda: False
    story.booted()
    story.wait(story.robot.timeouts.boot_s)
    assert story.node.missing(story.now_s) == ""


def test_a_boot_that_takes_longer_than_it_may_goes_on_and_says_how_far_it_is() -> None:
    class Slow(FakeDrive):
        def on_frame(self, frame: Frame) -> list[Frame]:
            return [] if frame.cob_id == 0x601 and self.transfers >= 5 else super().on_frame(frame)

    story = Story(drive=Slow())
    story.wait(0.01)
    story.node.begin_boot(story.now_s)
    story.wait(0.2)
    told = story.node.missing(story.now_s + story.robot.timeouts.boot_s)
    assert "node 1 (left_wheel) is not ready since 10 s: its boot has done 5 SDO transfers" in told
    assert "timeouts.boot_s of robot.yaml" in told
