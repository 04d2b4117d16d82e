"""What the watchdog makes of the frames on the bus, and that no noise can make it raise, forget or give way."""

from __future__ import annotations

import struct
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_config.watchdog import WatchedLayout
from canbase_watchdog.frames import DriveState
from canbase_watchdog.lease import Refusal
from canbase_watchdog.observer import Observer
from canbase_watchdog.view import NEVER, Axis, BusView, Node
from canbase_watchdog.watchdog import State, Watchdog
from support.watchdog_story import Story, config

WATCHED = [0x080, 0x77F, 0x27E, 0x701, 0x702, 0x581, 0x582, 0x181, 0x182, 0x281, 0x282, 0x201, 0x202]


def observer(*drives: tuple[int, int]) -> Observer:
    return Observer(config(*drives), 0.0)


def look(it: Observer) -> BusView:
    return it.bus_view()


def node(it: Observer, node_id: int) -> Node:
    return next(each for each in it.bus_view().nodes if each.node_id == node_id)


def rx(it: Observer, cob_id: int, data: str, now_s: float = 1.0) -> Axis:
    """A frame, and the first axis after it."""
    it.on_frame(cob_id, bytes.fromhex(data), now_s)
    return look(it).axes[0]


def test_a_look_is_the_same_object_until_a_frame_comes_that_is_watched() -> None:
    it = observer()
    for cob_id in (0x080, 0x77F, 0x701, 0x581, 0x601, 0x181, 0x281, 0x201, 0x000):
        before = it.bus_view()
        it.on_frame(0x123, b"", 1.0)
        assert it.bus_view() is before
        it.on_frame(cob_id, b"", 1.0)  # also where it is too short to be understood
        assert it.bus_view() is not before, hex(cob_id)
    before = it.bus_view()
    it.trust()
    assert it.bus_view() is not before


def test_status_velocity_and_setpoint_of_a_single_axis() -> None:
    it = observer()
    axis = rx(it, 0x181, "37 02 10 00 00 00", 1.0)
    assert (axis.state, axis.status_at, axis.enabled_since) == (DriveState.OPERATION_ENABLED, 1.0, 1.0)
    axis = rx(it, 0x281, "d4 fe ff ff", 2.0)
    assert axis.velocity_mps == pytest.approx(-0.3)
    assert axis.velocity_at == 2.0
    axis = rx(it, 0x201, "0f 00 2c 01 00 00", 3.0)
    assert axis.target_mps == pytest.approx(0.3)
    assert (axis.asks_for_power, axis.command_at) == (True, 3.0)
    assert axis.fed_at == 1.0
    assert node(it, 1).last_frame_at == 2.0
    assert node(it, 2).last_frame_at == NEVER


def test_a_velocity_of_16_bits_comes_with_the_status_where_both_have_room_in_one_frame() -> None:
    """At 1 s with its velocity, at 2 s without it: then only the status is new."""
    layout = WatchedLayout(target_bits=16, velocity_bits=16)
    watched = config()
    it = Observer(replace(watched, drives=tuple(replace(drive, layout=layout) for drive in watched.drives)), 0.0)
    axis = rx(it, 0x181, "37 02 10 00 00 00 d4 fe", 1.0)
    assert (axis.state, axis.status_at, axis.velocity_at, axis.fed_at) == (DriveState.OPERATION_ENABLED, 1.0, 1.0, 1.0)
    assert axis.velocity_mps == pytest.approx(-0.3)
    axis = rx(it, 0x181, "37 02 10 00 00 00", 2.0)
    assert (axis.status_at, axis.velocity_at, axis.fed_at) == (2.0, 1.0, 1.0)
    rx(it, 0x181, "37 02 10 00 00 00 d4 fe 00", 3.0)
    assert (it.dropped, it.bus_view().axes[0].status_at) == (1, 2.0)


def test_the_second_axis_of_a_node_has_pdos_of_its_own() -> None:
    it = observer((5, 1), (5, 0))
    it.on_frame(0x385, bytes.fromhex("37 02 00 00 00 00"), 1.0)
    it.on_frame(0x485, bytes.fromhex("2c 01 00 00"), 1.0)
    it.on_frame(0x305, bytes.fromhex("0f 00 64 00 00 00"), 1.0)
    second, first = look(it).axes
    assert second.enabled
    assert [second.velocity_mps, second.target_mps] == pytest.approx([0.3, 0.1])
    assert first == Axis(config((5, 1), (5, 0)).drives[1])


def test_an_only_axis_1_uses_the_pdos_of_the_first() -> None:
    it = observer((5, 1), (6, 0))
    assert rx(it, 0x185, "37 02 00 00 00 00").enabled


def test_enabled_since_begins_with_each_time_that_it_is_enabled() -> None:
    it = observer()
    rx(it, 0x181, "37 02 00 00 00 00", 1.0)
    assert rx(it, 0x181, "37 02 00 00 00 00", 2.0).enabled_since == 1.0
    rx(it, 0x181, "40 02 00 00 00 00", 3.0)
    assert rx(it, 0x181, "37 02 00 00 00 00", 4.0).enabled_since == 4.0


def test_disabled_since_begins_when_it_is_enabled_no_more() -> None:
    it = observer()
    assert rx(it, 0x181, "40 02 00 00 00 00", 1.0).disabled_since == NEVER
    rx(it, 0x181, "37 02 00 00 00 00", 2.0)
    assert rx(it, 0x181, "17 02 00 00 00 00", 3.0).disabled_since == 3.0
    assert rx(it, 0x181, "40 02 00 00 00 00", 4.0).disabled_since == 3.0


def test_a_sync_makes_the_setpoints_effective_that_came_for_it() -> None:
    it = observer()
    assert rx(it, 0x201, "0f 00 2c 01 00 00", 1.0).setpoint_at == NEVER
    axis = rx(it, 0x080, "", 1.001)
    assert [axis.setpoint_mps, axis.setpoint_at] == pytest.approx([0.3, 1.001])
    rx(it, 0x202, "0f 00 64 00 00 00", 1.01)
    axis = rx(it, 0x080, "", 1.011)
    assert [axis.setpoint_mps, axis.setpoint_at] == pytest.approx([0.3, 1.001])
    assert look(it).axes[1].setpoint_at == 1.011


def cycle(it: Observer, n: int, *, setpoint: bool = True, answers: int = 1, state: str = "37 02") -> Axis:
    """One cycle of both nodes; node 1 with or without its setpoint, and so many answers of it."""
    now_s = 2.0 + n / 100
    if setpoint:
        it.on_frame(0x201, bytes.fromhex("0f 00 2c 01 00 00"), now_s)
    it.on_frame(0x202, bytes.fromhex("0f 00 2c 01 00 00"), now_s)
    it.on_frame(0x080, b"", now_s)
    for node_id, count in ((1, answers), (2, 1)):
        for _ in range(count):
            it.on_frame(0x180 + node_id, bytes.fromhex(f"{state} 00 00 00 00"), now_s)
            it.on_frame(0x280 + node_id, bytes.fromhex("00 00 00 00"), now_s)
    return look(it).axes[0]


def test_an_enabled_axis_wants_a_setpoint_for_each_sync() -> None:
    it = observer()
    cycle(it, 0)
    assert [cycle(it, n, setpoint=False).missed_setpoints for n in (1, 2, 3)] == [1.0, 2.0, 3.0]
    assert look(it).axes[1].missed_setpoints == 0.0
    assert cycle(it, 4).missed_setpoints == 2.5
    assert cycle(it, 5, setpoint=False, state="40 02").missed_setpoints == 3.5
    assert cycle(it, 6, setpoint=False).missed_setpoints == 0.0  # it was not enabled at this SYNC


def test_an_enabled_axis_answers_a_sync_once() -> None:
    it = observer()
    cycle(it, 0, answers=2)
    assert [cycle(it, n, answers=2).double_answers for n in (1, 2, 3)] == [1.0, 2.0, 3.0]
    assert look(it).axes[1].double_answers == 0.0
    assert cycle(it, 4, answers=0).double_answers == 4.0
    assert cycle(it, 5, answers=1).double_answers == 3.0  # none makes up for two
    assert cycle(it, 6, answers=2, state="40 02").double_answers == 2.5
    assert cycle(it, 7, answers=2).double_answers == 0.0


@pytest.mark.parametrize(
    ("answers", "second_drive"),
    [((1, 1, 1, 2), False), ((0, 2), False), ((1, 0, 2, 1), False), ((2, 2, 2, 0), True), ((2, 1), True)],
)
def test_a_drive_whose_timer_drifts_along_the_syncs_is_one_and_two_of_them_are_two(
    answers: tuple[int, ...], second_drive: bool
) -> None:
    it = observer()
    cycles = [cycle(it, n, answers=answers[n % len(answers)]) for n in range(100)]
    allowed = config().feedback_timeout_s * config().control_hz
    assert (max(axis.double_answers for axis in cycles) >= allowed) is second_drive


def test_a_drive_with_a_clock_of_its_own_may_answer_twice() -> None:
    own = replace(config(), drives=tuple(replace(drive, answers_sync=False) for drive in config().drives))
    it = Observer(own, 0.0)
    assert [cycle(it, n, answers=2).double_answers for n in range(9)] == [0.0] * 9


def test_the_evidence_of_an_axis_begins_with_the_setpoint_that_a_sync_made_effective() -> None:
    it = observer()
    cycle(it, 0)
    assert cycle(it, 1).evidence.setpoint_mps == pytest.approx(0.3)
    it.on_frame(0x201, bytes.fromhex("0f 00 64 00 00 00"), 2.02)
    it.on_frame(0x281, bytes(4), 2.02)
    assert look(it).axes[0].evidence.setpoint_mps == pytest.approx(0.3)
    asked_m = look(it).axes[0].evidence.unseen_m
    assert cycle(it, 2, state="17 02").evidence.unseen_m == asked_m  # powered, and not enabled
    assert cycle(it, 2, state="40 02").evidence.setpoint_mps == 0.0  # no power
    before = cycle(it, 3).evidence.unseen_m
    assert cycle(it, 4).evidence.unseen_m == pytest.approx(before + 0.3 * 0.01)


def test_a_reset_trusts_all_sensors_again() -> None:
    it = observer()
    for n in range(60):
        cycle(it, n)
    assert [axis.trusted for axis in look(it).axes] == [False, False]
    it.trust()
    assert [axis.trusted for axis in look(it).axes] == [True, True]


def test_setpoints_and_samples_reach_the_feedback_of_their_axis() -> None:
    it = observer()
    it.on_frame(0x182, bytes.fromhex("37 02 00 00 00 00"), 0.99)
    for n in range(3):
        it.on_frame(0x202, bytes.fromhex("0f 00 64 00 00 00"), 1.0 + n / 100)
        it.on_frame(0x282, bytes.fromhex("d0 07 00 00"), 1.0 + n / 100)  # 2 m/s
    left, right = (axis.feedback for axis in look(it).axes)
    assert (right.high_mps, right.outside_samples, right.overspeed_samples, left.outside_samples) == pytest.approx(
        (0.1, 3, 3, 0)
    )
    for n in range(10):
        it.on_frame(0x182, struct.pack("<Hi", 0x0237, 2000 * n), 1.03 + n / 100)
        it.on_frame(0x282, bytes(4), 1.03 + n / 100)
    drift = look(it).axes[1].feedback
    assert drift.implausible_samples >= 5  # the encoder runs at 20 m/s
    it.on_frame(0x582, bytes.fromhex("43 6c 60 00 d0 07 00 00"), 1.2)  # an SDO answer is no sample of a SYNC
    assert look(it).axes[1].feedback is drift


def test_the_driver_was_heard_when_the_older_of_its_signs_came() -> None:
    it = observer()
    it.on_frame(0x080, b"", 1.0)
    assert it.driver_at == NEVER
    it.on_frame(0x77F, b"\x05", 2.0)
    assert it.driver_at == 1.0


def test_answers_to_sdo_readings_count_as_feedback() -> None:
    it = observer((5, 0), (5, 1))
    assert rx(it, 0x585, "4b 41 60 00 17 02 00 00", 1.0).state is DriveState.QUICK_STOP_ACTIVE
    assert rx(it, 0x585, "43 6c 60 00 2c 01 00 00", 1.5).velocity_mps == pytest.approx(0.3)
    rx(it, 0x585, "43 6c 68 00 64 00 00 00", 2.0)
    assert look(it).axes[1].velocity_mps == pytest.approx(0.1)
    assert node(it, 5).last_frame_at == 2.0


def test_answers_to_sdo_readings_feed_nobody() -> None:
    it = observer()
    rx(it, 0x181, "37 02 00 00 00 00", 1.0)
    assert rx(it, 0x281, "00 00 00 00", 1.1).fed_at == 1.0
    rx(it, 0x581, "4b 41 60 00 37 02 00 00", 2.0)
    assert rx(it, 0x581, "43 64 60 00 00 00 00 00", 2.05).position_at == 2.05
    axis = rx(it, 0x581, "43 6c 60 00 2c 01 00 00", 2.1)
    assert (axis.fed_at, axis.seen_at) == (1.0, 2.0)
    assert rx(it, 0x181, "37 02 00 00 00 00", 3.0).fed_at == 1.1
    assert rx(it, 0x281, "00 00 00 00", 3.1).fed_at == 3.0


@pytest.mark.parametrize(
    ("state", "age_s", "data", "noted"),
    [
        ("37 02", 0.09, "00", True),
        ("37 02", 0.1, "00", False),
        ("37 02", 0.0, "05", False),
        ("37 02", 0.0, "7f", False),
        ("17 02", 0.0, "00", False),
        ("40 02", 0.0, "00", False),
    ],
)
def test_a_boot_up_is_noted_of_a_node_that_has_just_said_that_it_is_enabled(
    state: str, age_s: float, data: str, noted: bool
) -> None:
    it = observer((1, 0), (1, 1), (2, 0))
    it.on_frame(0x381, bytes.fromhex(state + " 00 00 00 00"), 1.0)
    it.on_frame(0x701, bytes.fromhex(data), 1.0 + age_s)
    it.on_frame(0x702, bytes.fromhex(data), 1.0 + age_s)
    assert node(it, 1).boot_up_at == (1.0 + age_s if noted else NEVER)
    assert node(it, 2).boot_up_at == NEVER


def test_a_state_that_was_polled_is_no_reason_to_call_a_boot_up_a_restart() -> None:
    it = observer()
    it.on_frame(0x581, bytes.fromhex("4b 41 60 00 37 02 00 00"), 1.0)
    it.on_frame(0x701, b"\x00", 1.01)
    assert node(it, 1).boot_up_at == NEVER


def test_other_sdo_answers_only_show_that_the_node_lives() -> None:
    it = observer()
    before = look(it).axes
    for data in ("60 40 60 00 00 00 00 00", "80 41 60 00 00 00 02 06", "43 18 10 01 00 00 00 00", "00"):
        it.on_frame(0x581, bytes.fromhex(data), 1.0)
    assert look(it).axes == before
    assert (node(it, 1).last_frame_at, it.dropped) == (1.0, 0)


# SYNC: | | | |              | | |       a gap of 0.1 s begins a new run
@pytest.mark.parametrize(("gap_s", "since"), [(0.01, 1.0), (0.099, 1.0), (0.101, 1.101), (3.0, 4.0)])
def test_runs_of_syncs(gap_s: float, since: float) -> None:
    it = observer()
    it.on_frame(0x080, b"", 1.0)
    it.on_frame(0x080, b"\x07", 1.0 + gap_s)  # with a counter
    assert (look(it).sync_at, look(it).sync_since) == (1.0 + gap_s, since)


@pytest.mark.parametrize(("state", "operational"), [(0x05, True), (0x85, True), (0x7F, False), (0x04, False)])
def test_heartbeats(state: int, operational: bool) -> None:
    it = observer()
    it.on_frame(0x701, bytes([state]), 1.0)
    it.on_frame(0x77F, b"\x05", 2.0)
    view = look(it)
    assert (node(it, 1).heartbeat_at, node(it, 1).last_frame_at, view.driver_at) == (1.0, 1.0, 2.0)
    assert node(it, 1).operational is operational


@pytest.mark.parametrize(
    ("cob_id", "data"),
    [
        (0x080, "00 00"),
        (0x77F, ""),
        (0x77F, "05 05"),
        (0x701, ""),
        (0x181, "37 02"),
        (0x181, "41 02 00 00 00 00"),  # no state has these bits
        (0x281, "00 00 00"),
        (0x201, "0f 00 00 00 00"),
        (0x000, "80"),
        (0x581, "4b 41 60 00 41 02 00 00"),
    ],
)
def test_frames_that_make_no_sense_are_counted_and_change_no_axis(cob_id: int, data: str) -> None:
    it = observer()
    before = look(it)
    rx(it, cob_id, data)
    assert it.dropped == 1
    assert (look(it).axes, look(it).driver_at, look(it).sync_at) == (before.axes, NEVER, NEVER)


@pytest.mark.parametrize(
    ("cob_id", "data"),
    [
        (0x000, "80 01"),
        (0x080, ""),
        (0x080, "01"),
        (0x77F, "05"),
        (0x701, "7f"),
        (0x181, "37 02 00 00 00 00"),
        (0x281, "00 00 00 00"),
        (0x201, "0f 00 00 00 00 00"),
        (0x501, "02 00"),
        (0x501, ""),
        (0x581, "4b 41 60 00 37 02 00 00"),
        (0x581, "43 6c 60 00 00 00 00 00"),
        (0x581, "60 40 60 00 00 00 00 00"),
        (0x601, "40 41 60 00 00 00 00 00"),
        (0x601, "00"),
    ],
)
def test_good_frames_are_not_counted_as_dropped(cob_id: int, data: str) -> None:
    it = observer()
    rx(it, cob_id, data)
    assert it.dropped == 0


def test_a_run_of_syncs_begins_just_when_the_gap_is_over() -> None:
    it = Observer(replace(config(), feedback_timeout_s=0.125), 0.0)
    for now_s in (1.0, 1.125):
        it.on_frame(0x080, b"", now_s)
    assert look(it).sync_since == 1.125


def test_frames_of_others_are_ignored_without_a_count() -> None:
    it = observer()
    before = look(it)
    for cob_id in (0x081, 0x183, 0x501, 0x77E, 0x1FE, 0x7E5):
        it.on_frame(cob_id, bytes(8), 1.0)
    assert (look(it), it.dropped) == (before, 0)


@pytest.mark.parametrize(
    ("data", "by_others"),
    [
        ("40 41 60 00 00 00 00 00", False),
        ("40 64 60 00 00 00 00 00", False),
        ("40 6c 68 00 00 00 00 00", False),
        ("2b 40 60 00 00 00 00 00", False),
        ("40 18 10 01 00 00 00 00", True),  # identity
        ("22 00 14 01 01 02 00 00", True),  # 1400h
        ("60 00 00 00 00 00 00 00", True),  # a segment
        ("80 41 60 00 00 00 04 05", True),  # somebody gives up
        ("40 41 60", True),
    ],
)
def test_who_asks_a_drive_for_more_than_its_motion_configures_it(data: str, by_others: bool) -> None:
    it = observer()
    rx(it, 0x601, data)
    assert [node.configured_at > NEVER for node in look(it).nodes] == [by_others, False]


frames_on_the_bus = st.tuples(st.sampled_from(WATCHED) | st.integers(0, 0x7FF), st.binary(max_size=8))


@settings(max_examples=200, deadline=None)
@given(st.lists(frames_on_the_bus, max_size=60))
def test_noise_never_raises(noise: list[tuple[int, bytes]]) -> None:
    watchdog = Watchdog(config(), 0.0)
    for n, (cob_id, data) in enumerate(noise):
        watchdog.on_frame(cob_id, data, n / 200)
        watchdog.on_lease(data, None, n / 200)
        assert all(len(frame.data) <= 8 for frame in watchdog.tick(n / 200))


@pytest.mark.parametrize("seed", range(5))
def test_no_noise_untrips(seed: int) -> None:
    story = Story()
    story.drive_at(300)
    story.filter = False
    story.run(0.5)
    random, t = Random(seed), story.t
    for _ in range(10_000):
        cob_id = random.choice(WATCHED) if random.random() < 0.9 else random.randrange(0x800)
        data = random.randbytes(random.choice((0, 1, 4, 4, 6, 8)))
        t += 0.0005
        story.watchdog.on_frame(cob_id, data if data[1:] != b"RST" else b"", t)
        story.watchdog.on_lease(random.randbytes(random.choice((0, 43, 44, 45))), None, t)
        story.watchdog.tick(t)
    assert story.watchdog.status.state is State.TRIPPED
    refused = story.watchdog.refused_leases
    assert refused[Refusal.LENGTH] + refused[Refusal.MAGIC] == 10_000


@pytest.mark.parametrize(("hard", "high_mps"), [((), 0.3), ((True,), 0.2), ((True, True), 0.2), ((True, False), 0.3)])
def test_under_brakes_hard_every_wheel_has_to_slow_down_so(hard: tuple[bool, ...], high_mps: float) -> None:
    """0.4 m/s, then zero. Allowed for drive_lag_s (0.1 s) as before, and 0.1 s later with 1 or with 2 m/s²."""
    it = observer()
    for n in range(41):
        now_s, target = 1.0 + 0.01 * n, 400 if n < 20 else 0
        if n == 20:
            for flag in hard:
                it.brake(flag)
        for node_id in (1, 2):
            it.on_frame(0x180 + node_id, bytes.fromhex("37 02 00 00 00 00"), now_s)
            it.on_frame(0x200 + node_id, struct.pack("<Hi", 0x0F, target), now_s)
            it.on_frame(0x080, b"", now_s)
            it.on_frame(0x280 + node_id, struct.pack("<i", 0), now_s)
    assert [axis.feedback.high_mps for axis in look(it).axes] == pytest.approx([high_mps, high_mps], abs=0.021)
