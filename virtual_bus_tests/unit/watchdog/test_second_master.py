"""Signs of a second master, and that one driver alone on a loaded machine gives none.

period  | RPDO RPDO SYNC | RPDO RPDO SYNC | …        one driver
        | RPDO rpdo RPDO SYNC | …                    another one for the same axis
"""

from __future__ import annotations

import math
from dataclasses import replace
from random import Random
from typing import Any

import pytest

from canbase_watchdog.observer import Observer
from canbase_watchdog.second_master import Foreign, Pace, Sign
from support.watchdog_story import config

CONFIG = config()
A, B = b"\x0f\x00\x2c\x01\x00\x00", b"\x0f\x00\x00\x00\x00\x00"


class Bus:
    """A driver at 100 Hz. `t` in ms."""

    def __init__(self, **changes: Any) -> None:
        self.foreign = Foreign(replace(CONFIG, **changes))
        self.t = 0

    @property
    def sign(self) -> Sign | None:
        return self.foreign.last

    def setpoint(self, data: bytes, cob_id: int = 0x201, at: float | None = None) -> None:
        self.foreign.on_setpoint(cob_id, cob_id & 0x7F, data, self.t / 1000 if at is None else at)

    def sync(self, at: float | None = None) -> None:
        self.foreign.on_sync(self.t / 1000 if at is None else at)

    def cycle(self, data: bytes = A, at: float | None = None) -> None:
        self.setpoint(data, 0x201, at)
        self.setpoint(data, 0x202, at)
        self.sync(at)
        self.t += 10


def test_a_pace_counts_within_its_window() -> None:
    pace = Pace(3, 1.0)
    assert [pace.too_fast(t) for t in (0.0, 0.5, 0.999)] == [False, False, True]
    assert [pace.too_fast(t) for t in (1.501, 1.9)] == [False, True]
    assert not Pace(3, 1.0).too_fast(0.0)


def test_at_the_very_window_it_is_not_too_fast() -> None:
    pace = Pace(3, 1.0)
    assert [pace.too_fast(t) for t in (0.0, 0.5, 1.0)] == [False, False, False]


def test_one_driver_gives_no_sign() -> None:
    bus = Bus()
    for n in range(1000):
        bus.cycle((A, B)[n % 2])
        if n % 10 == 0:
            bus.foreign.on_heartbeat(bus.t / 1000)
    assert bus.sign is None


@pytest.mark.parametrize("seed", range(3))
def test_what_comes_late_comes_in_bursts_and_is_no_sign(seed: int) -> None:
    """The watchdog stands still for up to 0.1 s, now and then, and then gets everything at once."""
    random, bus = Random(seed), Bus()
    held_until = 0
    for n in range(5000):
        if random.random() < 0.02:
            held_until = max(held_until, bus.t + random.randint(0, 100))
        at = max(bus.t, held_until) / 1000
        if n % 10 == 0:
            bus.foreign.on_heartbeat(at)
        bus.cycle((A, B)[n % 2], at)
    assert bus.sign is None


# --- two setpoints in one period


def two_setpoints(bus: Bus, wait_cycles: int) -> None:
    """Somebody else's comes 2 ms before the driver's, once; then so many cycles of the driver alone."""
    bus.setpoint(B, at=(bus.t - 2) / 1000)
    for _ in range(wait_cycles):
        bus.cycle()


@pytest.mark.parametrize(("wait_cycles", "sign"), [(49, True), (51, False)])
def test_three_times_within_a_second_two_setpoints_for_one_axis(wait_cycles: int, sign: bool) -> None:
    bus = Bus()
    bus.cycle()
    for _ in range(2):
        two_setpoints(bus, wait_cycles)
    assert bus.sign is None
    at = bus.t / 1000
    two_setpoints(bus, 1)
    assert bus.sign == (Sign(at, 1, "two different setpoints 201h between two SYNCs") if sign else None)


def test_as_rare_as_disturbed_frames_they_are_no_sign() -> None:
    bus = Bus()
    bus.cycle()
    for _ in range(100):
        two_setpoints(bus, 51)
    assert bus.sign is None


# A SYNC is missing when the last one is 1.5 periods old: 15 ms at 100 Hz
@pytest.mark.parametrize(("after_ms", "sign"), [(14.9, True), (15.0, False), (20.0, False)])
def test_of_two_setpoints_one_period_apart_the_sync_between_them_was_lost(after_ms: float, sign: bool) -> None:
    bus = Bus()
    for n in range(0, 300, 30):
        bus.cycle(A, n / 1000)
        bus.setpoint(A, at=(n + 10) / 1000)
        bus.setpoint(B, at=(n + after_ms) / 1000)
    assert (bus.sign is not None) is sign


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_frames_that_get_lost_are_no_sign(share: float, seed: int) -> None:
    """A ramp: each setpoint is another one. RPDOs and SYNCs get lost, each by itself, for 20 s."""
    random, bus = Random(seed), Bus()
    for n in range(2000):
        for cob_id in (0x201, 0x202):
            if random.random() >= share:
                bus.setpoint(n.to_bytes(6, "little"), cob_id)
        if random.random() >= share:
            bus.sync()
        bus.t += 10
    assert bus.sign is None


@pytest.mark.parametrize("phase_ms", [0.0, 1.0, 5.0, 9.0, 9.9])
def test_a_second_master_is_found_at_any_phase_also_while_frames_get_lost(phase_ms: float) -> None:
    """Its setpoints come each 10 ms, so long after the driver's SYNC; every tenth frame is lost."""
    random, bus = Random(1), Bus()
    while bus.sign is None:
        if random.random() >= 0.1:
            bus.setpoint(A)
        if random.random() >= 0.1:
            bus.sync()
        if random.random() >= 0.1:
            bus.setpoint(B, at=(bus.t + phase_ms) / 1000)
        bus.t += 10
        assert bus.t < 200


def test_the_same_setpoint_twice_is_no_sign() -> None:
    bus = Bus()
    for _ in range(30):
        bus.setpoint(A)
        bus.cycle(A)
    assert bus.sign is None


def test_setpoints_of_two_axes_differ() -> None:
    bus = Bus()
    for _ in range(30):
        bus.setpoint(A, 0x201)
        bus.setpoint(B, 0x301)
        bus.setpoint(B, 0x202)
        bus.sync()
        bus.t += 10
    assert bus.sign is None


def test_back_and_forth_each_change_counts() -> None:
    bus = Bus()
    for data in (A, B, A, B):
        bus.setpoint(data)
    assert bus.sign is not None


# --- SYNCs


def test_three_syncs_without_setpoints_within_a_second() -> None:
    bus = Bus()
    bus.cycle()
    bus.sync(0.0021)
    bus.sync(0.0042)
    assert bus.sign is None
    bus.sync(0.0063)
    assert bus.sign == Sign(0.0063, 0, "SYNCs without setpoints", copied=False)


# 0.75 periods after the last one a SYNC keeps the beat: 7.5 ms at 100 Hz
@pytest.mark.parametrize(("after_ms", "sign"), [(1.0, True), (7.4, True), (7.5, False), (10.0, False)])
def test_a_sync_without_setpoints_is_one_too_many_where_it_is_off_the_beat(after_ms: float, sign: bool) -> None:
    bus = Bus()
    for n in range(0, 1500, 300):
        bus.cycle(A, n / 1000)
        bus.sync((n + after_ms) / 1000)
    assert (bus.sign is not None) is sign


# 0.5 s at 100 Hz: 50 SYNCs; 75 and one more are too many
@pytest.mark.parametrize(("period_s", "sign"), [(0.01, False), (0.0068, False), (0.0066, True), (0.005, True)])
def test_syncs_half_as_often_again_as_configured(period_s: float, sign: bool) -> None:
    bus = Bus()
    for n in range(300):
        bus.cycle(A, n * period_s)
    assert (bus.sign is not None) is sign


def test_75_syncs_at_once_are_a_burst_and_one_more_is_a_second_master() -> None:
    bus = Bus()
    for _ in range(75):
        bus.cycle(A, 1.0)
    assert bus.sign is None
    bus.cycle(A, 1.0)
    assert bus.sign is not None


@pytest.mark.parametrize("control_hz", [20.0, 50.0, 200.0])
def test_the_number_of_syncs_goes_with_the_rate(control_hz: float) -> None:
    one, two = Bus(control_hz=control_hz), Bus(control_hz=control_hz)
    for n in range(400):
        one.cycle(A, n / control_hz)
        two.cycle(A, n / control_hz / 2)
    assert one.sign is None
    told = f"more SYNCs than the driver's {control_hz:g} per second"
    assert two.sign == Sign(399 / control_hz / 2, 0, told, copied=False)


# --- heartbeats: 10 periods of 0.1 s; 15 and one more are too many


@pytest.mark.parametrize(
    ("period_s", "sign"), [(0.1, False), (0.095, False), (0.068, False), (0.066, True), (0.05, True)]
)
def test_heartbeats_half_as_often_again_as_configured(period_s: float, sign: bool) -> None:
    bus = Bus()
    for n in range(60):
        bus.foreign.on_heartbeat(n * period_s)
    assert (bus.sign is not None) is sign


def test_the_sentence_about_heartbeats() -> None:
    bus = Bus(drive_heartbeat_s=0.9)
    for n in range(60):
        bus.foreign.on_heartbeat(n * 0.15)
    assert bus.sign == Sign(59 * 0.15, 0, "more heartbeats 77Fh than one each 0.300 s", copied=False)


# --- commands to an enabled drive: once is enough


def enabled() -> Observer:
    it = Observer(config(), 0.0)
    it.on_frame(0x181, bytes.fromhex("37 02 00 00 00 00"), 1.0)
    return it


def after(cob_id: int, data: str, it: Observer | None = None) -> Sign | None:
    it = it or enabled()
    it.on_frame(cob_id, bytes.fromhex(data), 2.0)
    return it.bus_view().foreign


@pytest.mark.parametrize("command", ["01", "02", "80", "81", "82"])
@pytest.mark.parametrize("node", ["00", "01"])
def test_nmt_to_an_enabled_drive(command: str, node: str) -> None:
    detail = f"NMT command {int(command, 16)} for node {int(node)}, while it is enabled"
    assert after(0x000, command + node) == Sign(2.0, 1, detail)


@pytest.mark.parametrize(
    ("cob_id", "data"),
    [
        (0x000, "80 02"),  # node 2 is not enabled: the driver boots it
        (0x000, "80 05"),  # none of ours
        (0x000, "07 01"),  # no command
        (0x502, "02 00"),
        (0x602, "2b 40 60 00 00 00 00 00"),
        (0x601, "40 40 60 00 00 00 00 00"),  # reads
        (0x601, "2b 40 60"),
        (0x601, "60 40 60 00 00 00 00 00"),
    ],
)
def test_what_is_no_command_to_an_enabled_drive(cob_id: int, data: str) -> None:
    assert after(cob_id, data) is None


def test_the_quick_stop_pdo_is_ours_alone() -> None:
    detail = "quick stop PDO with 0f 00 (sent as well when driver or watchdog has ended), while it is enabled"
    assert after(0x501, "0f 00") == Sign(2.0, 1, detail)


@pytest.mark.parametrize(
    ("data", "index"),
    [
        ("2b 40 60 00 0f 00 00 00", "6040"),
        ("23 ff 60 00 00 00 00 00", "60FF"),
        ("2f 60 60 00 09 00 00 00", "6060"),
        ("21 40 60 00 02 00 00 00", "6040"),
        ("2b 40 68 00 0f 00 00 00", "6840"),
        ("23 ff 68 00 00 00 00 00", "68FF"),
    ],
)
def test_an_sdo_that_commands_an_enabled_drive(data: str, index: str) -> None:
    assert after(0x601, data) == Sign(2.0, 1, f"an SDO that writes {index}h, while it is enabled")


@pytest.mark.parametrize(
    ("controlword", "is_sign"),
    [
        (0x00, False),
        (0x02, False),
        (0x04, False),
        (0x06, True),
        (0x07, True),
        (0x0F, True),
        (0x0B, False),
        (0x80, False),
    ],
)
@pytest.mark.parametrize("head", ["2B", "23", "22", "2F"])
def test_an_sdo_that_takes_power_away_is_a_stop_and_no_sign(controlword: int, is_sign: bool, head: str) -> None:
    """The boot of a driver that was started anew brings drives that still turn to a stand by it."""
    sign = after(0x601, f"{head} 40 60 00 {controlword:02X} 00 00 00")
    assert (sign is not None) is is_sign


def test_a_segmented_write_of_the_controlword_is_a_sign() -> None:
    assert after(0x601, "21 40 60 00 02 00 00 00") is not None


@pytest.mark.parametrize("size", ["02", "04"])
def test_a_write_of_the_controlword_in_a_block_is_a_sign(size: str) -> None:
    """Its first frame has the size where others have the value."""
    assert after(0x601, f"c2 40 60 00 {size} 00 00 00") is not None


@pytest.mark.parametrize(("cob_id", "data"), [(0x000, "80 01"), (0x501, "02 00"), (0x601, "2b 40 60 00 0f 00 00 00")])
def test_our_own_commands_that_come_back_are_none(cob_id: int, data: str) -> None:
    it = enabled()
    it.ours_since = -math.inf
    assert after(cob_id, data, it) is None
    it.ours_since = math.inf
    assert after(cob_id, data, it) is not None


def test_a_drive_with_two_axes_is_enabled_when_one_is() -> None:
    it = Observer(config((5, 0), (5, 1), (6, 0)), 0.0)
    it.on_frame(0x385, bytes.fromhex("37 02 00 00 00 00"), 1.0)
    assert after(0x000, "80 06", it) is None
    assert after(0x000, "80 05", it) is not None


def test_commands_that_make_no_sense_are_counted() -> None:
    it = enabled()
    for data in ("", "80", "80 01 00", "03 01"):
        it.on_frame(0x000, bytes.fromhex(data), 2.0)
    assert it.dropped == 4


@pytest.mark.parametrize(
    ("data", "index"),
    [
        ("2b 0c 10 00 00 00 00 00", "100C"),  # node guarding
        ("2f 0d 10 00 00 00 00 00", "100D"),
        ("23 16 10 01 00 00 00 00", "1016"),  # heartbeats that the drive monitors
        ("2f 29 10 01 01 00 00 00", "1029"),
        ("23 03 14 01 01 05 00 80", "1403"),  # the RPDO of the watchdog's quick stop
        ("2f 03 16 00 00 00 00 00", "1603"),
        ("2b 07 60 00 00 00 00 00", "6007"),
        ("23 49 60 01 00 00 00 00", "6049"),  # of mode 2
        ("23 4a 60 01 00 00 00 00", "604A"),
        ("2b 5a 60 00 00 00 00 00", "605A"),
        ("2b 5e 68 00 00 00 00 00", "685E"),  # of the second axis
        ("23 84 60 00 01 00 00 00", "6084"),
        ("23 85 68 00 01 00 00 00", "6885"),
        ("2f 7e 60 00 c0 00 00 00", "607E"),  # which way is positive
        ("23 89 60 00 00 00 00 00", "6089"),
        ("23 91 68 01 01 00 00 00", "6891"),  # how far one bit goes
        ("23 97 60 01 01 00 00 00", "6097"),
        ("23 a8 60 00 00 00 00 00", "60A8"),
        ("23 aa 60 00 00 00 00 00", "60AA"),
        ("23 46 60 01 e8 03 00 00", "6046"),  # of mode 2: the least speed, and the factor of all speeds and ramps
        ("2b 4c 60 01 0a 00 00 00", "604C"),
        ("23 00 12 01 41 06 00 00", "1200"),  # SDO channels: who else may write all that
        ("23 7f 12 02 c1 05 00 00", "127F"),
        ("2b 73 60 00 00 00 00 00", "6073"),  # the greatest current: without it no motor brakes
        ("23 0f 20 00 00 00 00 00", "200F"),  # of the manufacturer
        ("2b 40 20 00 00 00 00 00", "2040"),
        ("c2 16 10 01 04 00 00 00", "1016"),  # block
    ],
)
def test_an_sdo_that_changes_how_an_enabled_drive_stops(data: str, index: str) -> None:
    """Afterwards it would turn on with a dead computer, and nobody would know."""
    assert after(0x601, data) == Sign(2.0, 1, f"an SDO that writes {index}h, while it is enabled")
    assert after(0x602, data) is None  # node 2 has no power: a boot does that
    assert after(0x601, "40" + data[2:]) is None  # reads


def test_an_lss_request_while_a_drive_is_enabled() -> None:
    """An LSS master can give a drive another node id or bit rate; the watchdog then receives none of its frames."""
    sign = "an LSS request 04 01 (CiA 305: node ids, bit rate), while it is enabled"
    assert after(0x7E5, "04 01") == Sign(2.0, 1, sign)
    assert after(0x7E4, "04 01") is None  # an answer


# --- heartbeats of the watchdog's node: 10 own ones each second where they come back, none where they do not


@pytest.mark.parametrize(("period_s", "sign"), [(0.1, True), (0.3, True), (0.4, False), (1.0, False)])
def test_where_own_frames_do_not_come_back_any_77e_that_could_keep_a_drive_alive_is_a_sign(
    period_s: float, sign: bool
) -> None:
    """The drives allow 0.3 s without one."""
    foreign = Foreign(CONFIG, loopback=False)
    for n in range(20):
        foreign.on_watchdog_heartbeat(n * period_s)
    assert (foreign.last is not None) is sign
    if foreign.last:
        assert foreign.last.detail == (
            "heartbeats 77Eh that this watchdog has not sent; a device with its node id, 126, needs another one"
        )


def test_where_own_frames_come_back_they_are_no_sign_and_more_of_them_are() -> None:
    one, two = Foreign(CONFIG), Foreign(CONFIG)
    for n in range(600):
        one.on_watchdog_heartbeat(n * 0.1 + (0.09 if n % 7 == 0 else 0.0))
    for n in range(60):
        two.on_watchdog_heartbeat(n * 0.1)
        two.on_watchdog_heartbeat(n * 0.1 + 0.02)
    assert one.last is None
    assert two.last is not None


# --- frames that are sent again: R R' S S', each copy so long after its frame; own heartbeats too


def copied(
    bus: Bus, copy_s: float = 0.0005, *, own: bool = True, setpoints: bool = True, each: int = 1, cycles: int = 60
) -> None:
    """At a ramp: each setpoint is another one. One cycle in `each` is copied, the first four as well: their SYNC, and
    the setpoint and the own heartbeat, where they are."""
    for n in range(cycles):
        at, data, times = n / 100, n.to_bytes(6, "little"), 2 if n % each == 0 or n < 4 else 1
        for turn in range(times if setpoints else 1):
            bus.setpoint(data, 0x201, at + turn * copy_s)
        for turn in range(times):
            bus.sync(at + 0.004 + turn * copy_s)
        if n % 10 == 0:
            for turn in range(times if own else 1):
                bus.foreign.on_watchdog_heartbeat(at + 0.006 + turn * copy_s)


@pytest.mark.parametrize("each", [1, 5, 20])
@pytest.mark.parametrize(("copy_ms", "is_copy"), [(0.2, True), (1.9, True), (2.1, False)])
def test_frames_that_come_twice_within_2_ms_are_a_sign_and_said_to_be_copies(
    copy_ms: float, is_copy: bool, each: int
) -> None:
    """All of them by a bridge, or one in five by a defective adapter."""
    bus = Bus()
    copied(bus, copy_ms / 1000, each=each)
    assert bus.sign is not None
    assert bus.sign.detail.startswith(("SYNCs without setpoints", "more SYNCs"))
    assert bus.sign.copied is is_copy


def test_the_third_sync_that_comes_twice_is_enough_for_the_sign_and_for_the_likelier_reason() -> None:
    """A bridge is plugged in: no heartbeat of this watchdog has come since."""
    bus = Bus()
    copied(bus, cycles=3)
    assert bus.sign == Sign(0.0245, 0, "SYNCs without setpoints", copied=True)


def test_syncs_that_come_just_behind_ours_and_setpoints_that_come_once_are_another_masters() -> None:
    bus = Bus()
    copied(bus, setpoints=False, cycles=4)
    assert bus.sign is not None
    assert bus.sign.copied is False


def test_another_driver_at_rest_sends_the_same_setpoints_and_no_heartbeat_of_this_watchdog() -> None:
    bus = Bus()
    copied(bus, own=False)
    assert bus.sign is not None
    assert bus.sign.copied is False


def test_where_own_frames_do_not_come_back_those_of_the_driver_decide() -> None:
    bus = Bus()
    bus.foreign = Foreign(CONFIG, loopback=False)
    copied(bus, own=False)
    assert bus.sign is not None
    assert bus.sign.copied is True


def test_a_copy_of_ten_seconds_ago_says_nothing_about_now() -> None:
    bus = Bus()
    copied(bus)
    for n in range(1, 80):
        bus.foreign.on_heartbeat(20.0 + n * 0.05)
    assert bus.sign is not None
    assert (bus.sign.detail[:23], bus.sign.copied) == ("more heartbeats 77Fh th", False)


def test_the_signs_of_an_nmt_command_an_sdo_or_two_setpoints_need_another_master() -> None:
    bus = Bus()
    bus.cycle()
    for _ in range(3):
        two_setpoints(bus, 1)
    assert [sign.copied for sign in (bus.sign, after(0x000, "80 01")) if sign] == [None, None]


def test_the_feedback_of_a_drive_that_comes_twice_with_the_same_data_is_known_as_a_copy() -> None:
    """Two drives with one node id have two positions."""
    it = Observer(config(), 0.0)
    for n in range(5):
        for turn in range(2):
            at = 1.0 + n / 100 + turn * 0.0005
            it.on_frame(0x181, bytes.fromhex("37 02") + n.to_bytes(4, "little"), at)
            it.on_frame(0x182, bytes.fromhex("37 02") + (2 * n + turn).to_bytes(4, "little"), at)
    assert [axis.copied_at for axis in it.bus_view().axes] == [1.0405, -math.inf]
