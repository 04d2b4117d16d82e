"""Commands that the network delays, told by their stamps without a clock that sender and mux share. Times in s."""

from __future__ import annotations

import pytest

from canbase_config.mux import DEFAULT_SOURCES, MuxSource
from canbase_runtime.source_standing import SourceStanding
from canbase_velocity.delay import DRIFT, FORGET_S, SILENCE_S, Delay, Sent
from canbase_velocity.mux import LATE_S, Mux, MuxDecision
from canbase_velocity.twist import ZERO, Twist
from support.mux_world import rested

FORWARD = Twist(0.3, 0.0)
PERIOD_S = 0.05
APART_S = 1.7e9
"""The sender's clock is a wall clock, the mux's began at boot."""


class Link:
    """A joystick that publishes at 20 Hz over a network with a delay; its clock differs from the robot's."""

    def __init__(self, mux: Mux | None = None) -> None:
        self.mux = mux or rested()
        self.now_s = 0.0
        self.sent_s = 0.0
        self.apart_s = APART_S
        self.drift = 0.0

    def send(self, twist: Twist, delay_s: float, seconds: float = PERIOD_S) -> MuxDecision:
        """For a while, each message arriving `delay_s` after it was sent; the last decision."""
        for _ in range(round(seconds / PERIOD_S)):
            self.sent_s += PERIOD_S
            self.now_s = max(self.now_s, self.sent_s + delay_s)
            stamp_s = self.sent_s * (1.0 + self.drift) + self.apart_s
            self.mux.on_command("joystick", twist, self.now_s, sent=Sent(stamp_s, 5e8 + self.now_s, self.now_s))
        return self.mux.decide(self.now_s)


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.29])
def test_a_delay_within_the_timeout_is_followed_and_shortens_how_long_the_command_holds(delay_s: float) -> None:
    link = Link()
    link.send(ZERO, 0.01, 1.0)
    assert link.send(FORWARD, 0.01 + delay_s, 1.0).twist == FORWARD
    assert link.mux.decide(link.now_s + 0.29 - delay_s).twist == FORWARD
    assert link.mux.decide(link.now_s + 0.31 - delay_s).twist == ZERO


def test_letting_go_of_the_stick_over_a_network_that_delays_by_two_seconds_stops_at_once() -> None:
    link = Link()
    link.send(ZERO, 0.01, 1.0)
    assert link.send(FORWARD, 0.01, 1.0).twist == FORWARD
    decision = link.send(FORWARD, 2.0)  # the first late one
    assert (decision.active, decision.twist) == ("joystick", ZERO)
    assert decision.sources[0].standing is SourceStanding.DELAYED
    assert decision.sources[0].reason == "delayed by 1.99 s (limit 0.30 s)"
    assert link.send(FORWARD, 2.0, 10.0).twist == ZERO


def test_after_a_long_delay_a_zero_that_is_on_time_must_come_first() -> None:
    link = Link()
    link.send(ZERO, 0.01, 1.0)
    link.send(FORWARD, 2.0, LATE_S + 0.2)
    assert link.send(ZERO, 2.0).sources[0].armed is False  # what was zero two seconds ago arms nobody
    link.sent_s += 3.0
    assert link.send(FORWARD, 0.01, 1.0).sources[0].reason.startswith("waiting for zero")
    assert link.send(ZERO, 0.01).sources[0].armed
    assert link.send(FORWARD, 0.01).twist == FORWARD


def test_a_short_burst_after_a_gap_is_followed_again_without_a_zero() -> None:
    link = Link()
    link.send(ZERO, 0.01, 1.0)
    link.send(FORWARD, 0.01, 1.0)
    assert link.send(FORWARD, 0.5).twist == ZERO  # held up by the radio for half a second …
    link.sent_s += 0.5
    assert link.send(FORWARD, 0.01).twist == FORWARD  # … and the next one is on time


def test_a_late_source_keeps_a_lower_one_from_driving() -> None:
    link = Link()
    link.send(ZERO, 0.01, 1.0)
    link.send(FORWARD, 1.0)
    link.mux.on_command("navigation", FORWARD, link.now_s)
    decision = link.mux.decide(link.now_s)
    assert (decision.active, decision.twist) == ("joystick", ZERO)


@pytest.mark.parametrize("ppm", [-200.0, 200.0])
def test_clocks_that_drift_apart_are_no_delay(ppm: float) -> None:
    link = Link()
    link.drift = ppm * 1e-6
    link.send(ZERO, 0.01, 10.0)
    for _ in range(60):
        decision = link.send(FORWARD, 0.01, 10.0)
        assert decision.twist == FORWARD
        assert (decision.sources[0].delay_s or 0.0) < 0.02


def test_a_clock_that_is_set_forward_changes_nothing_and_one_that_is_set_back_needs_a_zero() -> None:
    link = Link()
    link.send(ZERO, 0.01, 1.0)
    link.send(FORWARD, 0.01, 1.0)
    link.apart_s += 3600.0
    assert link.send(FORWARD, 0.01).twist == FORWARD
    link.apart_s -= 7200.0
    decision = link.send(FORWARD, 0.01, 1.0)
    assert decision.sources[0].reason.startswith("waiting for zero")
    assert "the clock of its sender was set back" in decision.sources[0].reason
    link.send(ZERO, 0.01)
    assert link.send(FORWARD, 0.01).twist == FORWARD


# followed ── the network delays everything by 2 s from now on ── a minute and more: the stick, at zero, is pushed again
@pytest.mark.parametrize("gap_s", [0.0, 30.0])
def test_a_delay_that_lasts_for_minutes_is_never_taken_for_none(gap_s: float) -> None:
    link = Link()
    link.send(ZERO, 0.01, 1.0)
    link.sent_s += gap_s  # an outage of the radio before it
    for _ in range(30):
        link.send(ZERO, 2.0, 10.0)
        assert link.send(FORWARD, 2.0, 1.0).twist == ZERO
    link.sent_s += 2.0
    link.send(ZERO, 0.01)
    assert link.send(FORWARD, 0.01).twist == FORWARD


# a link that carries a little less than the sender sends: 4 ms more with each second
def test_a_queue_that_grows_slowly_is_noticed_before_it_is_a_second_long() -> None:
    link = Link()
    link.send(ZERO, 0.01, 1.0)
    followed_s = 0.0
    for second in range(400):
        if link.send(FORWARD, 0.01 + 0.004 * second, 1.0).twist == FORWARD:
            followed_s = 0.004 * second
    assert followed_s < 0.5


def test_a_clock_that_was_set_back_during_a_minute_of_silence_recovers_within_a_minute_of_messages() -> None:
    link = Link()
    link.send(ZERO, 0.01, 1.0)
    link.sent_s += SILENCE_S + 10.0
    link.apart_s -= 5.0  # no stamp is below the last one: it looks like a delay of 5 s
    assert link.send(ZERO, 0.01, 1.0).sources[0].standing is SourceStanding.DELAYED
    assert link.send(ZERO, 0.01, FORGET_S).sources[0].standing is SourceStanding.FOLLOWED
    assert link.send(FORWARD, 0.01).twist == FORWARD


def test_the_same_stamp_again_and_again_grows_old() -> None:
    mux = rested()
    for step in range(20):
        mux.on_command("joystick", FORWARD, 0.05 * step, sent=Sent(5.0, 0.0, 0.05 * step))
    assert mux.decide(0.95).sources[0].reason == "delayed by 0.95 s (limit 0.30 s)"


# 1.00 forward ── 1.05 forward, late ── 1.10 the stick is released ── 1.11 the zero arrives ── 1.12 the forward of 1.05
def test_a_command_that_a_newer_one_has_overtaken_is_not_followed_before_the_next_zero() -> None:
    link = Link()
    link.send(ZERO, 0.0, 0.5)
    assert link.send(FORWARD, 0.0, 0.5).twist == FORWARD
    for twist, sent_s, now_s in ((ZERO, 1.10, 1.11), (FORWARD, 1.05, 1.12)):
        link.mux.on_command("joystick", twist, now_s, sent=Sent(sent_s + APART_S, 5e8 + now_s, now_s))
    decision = link.mux.decide(1.12)
    assert decision.twist == ZERO
    assert decision.sources[0].reason.startswith("waiting for zero")
    link.sent_s = 1.10
    assert link.send(FORWARD, 0.02, 0.2).twist == ZERO
    link.send(ZERO, 0.02)
    assert link.send(FORWARD, 0.02).twist == FORWARD


@pytest.mark.parametrize("again_s", [0.0, 0.01, 0.04])
def test_a_command_that_arrives_twice_holds_no_longer_than_once(again_s: float) -> None:
    once, twice = rested(), rested()
    for step in range(20):
        twist, at_s = (FORWARD if step < 10 else ZERO), PERIOD_S * step
        for mux, arrivals in ((once, (at_s,)), (twice, (at_s, at_s + again_s))):
            for now_s in arrivals:
                mux.on_command("joystick", twist, now_s, sent=Sent(APART_S + at_s, 0.0, now_s))
        assert twice.decide(at_s + again_s).twist == once.decide(at_s + again_s).twist == twist
    last_s = PERIOD_S * 20
    for mux, arrivals in ((once, (last_s,)), (twice, (last_s, last_s + again_s))):
        for now_s in arrivals:
            mux.on_command("joystick", FORWARD, now_s, sent=Sent(APART_S + last_s, 0.0, now_s))
    for age_s in (0.29, 0.31):
        assert (
            twice.decide(last_s + age_s).twist
            == once.decide(last_s + age_s).twist
            == (FORWARD if age_s < 0.3 else ZERO)
        )


def test_without_a_stamp_nothing_is_known_of_the_delay() -> None:
    mux = rested()
    mux.on_command("joystick", FORWARD, 0.0)
    assert mux.decide(0.0).sources[0].delay_s is None
    assert mux.decide(0.0).twist == FORWARD


@pytest.mark.parametrize(("age_s", "reason"), [
    (0.0, ""), (0.29, ""), (0.31, "delayed by 0.31 s (limit 0.30 s)"), (-0.29, ""),
    (-5.0, "stamped in the future by 5.00 s (limit 0.30 s)"),
])  # fmt: skip
def test_with_the_same_clock_the_age_of_the_stamp_counts_from_the_first_message_on(age_s: float, reason: str) -> None:
    source = MuxSource(topic="x", priority=1, timeout_s=0.3, same_clock=True)
    mux = rested({"local": source})
    mux.on_command("local", FORWARD, 0.0, sent=Sent(APART_S - age_s, APART_S, 0.0))
    assert mux.decide(0.0).sources[0].reason == reason
    assert mux.decide(0.0).twist == (ZERO if reason else FORWARD)


def test_two_senders_on_one_topic_whose_clocks_differ_are_never_followed() -> None:
    mux = rested()
    for step in range(40):
        stamp_s = APART_S + 0.05 * step - (3.0 if step % 2 else 0.0)
        mux.on_command("joystick", FORWARD, 0.05 * step, sent=Sent(stamp_s, 0.0, 0.05 * step))
    assert mux.decide(1.95).twist == ZERO


def test_delays_are_small_numbers_though_clocks_are_far_apart() -> None:
    delay = Delay(same_clock=False)
    assert delay.take(Sent(APART_S, 0.0, 1.0)) == 0.0
    assert delay.take(Sent(APART_S + 1.0, 0.0, 2.25)) == pytest.approx(0.25, abs=2.0 * DRIFT)
    assert not delay.set_back


def test_each_source_has_a_delay_of_its_own() -> None:
    mux = rested(DEFAULT_SOURCES)
    mux.on_command("joystick", FORWARD, 1.0, sent=Sent(9.0, 0.0, 1.0))
    mux.on_command("navigation", FORWARD, 1.0, sent=Sent(700.0, 0.0, 1.0))
    assert [source.delay_s for source in mux.decide(1.0).sources] == [0.0, 0.0, None]
