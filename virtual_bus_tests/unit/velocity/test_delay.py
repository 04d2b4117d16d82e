"""Commands that the network delays, by their stamps: with the clock of this computer, and with another one. In s."""

from __future__ import annotations

import math

import pytest

from canbase_config.mux import DEFAULT_SOURCES, MuxSource
from canbase_runtime.source_standing import SourceStanding
from canbase_velocity.delay import FUTURE_S, SET_BACK_S, Delay, Sent
from canbase_velocity.mux import LATE_S, MuxDecision
from canbase_velocity.twist import ZERO, Twist
from support.mux_world import rested

FORWARD = Twist(0.3, 0.0)
PERIOD_S = 0.05
WALL_S = 1.7e9
"""What a wall clock shows while the monotonic one shows 0."""


class Link:
    """A joystick that publishes at 20 Hz over a network with a delay. `apart_s`: its clock minus the robot's."""

    def __init__(self, same_clock: bool, apart_s: float = 0.0) -> None:
        source = DEFAULT_SOURCES["joystick"].model_copy(update={"same_clock": same_clock})
        self.sources = {**DEFAULT_SOURCES, "joystick": source}
        self.mux = rested(self.sources)
        self.now_s = 0.0
        self.sent_s = 0.0
        self.apart_s = apart_s
        self.same_clock = same_clock

    def send(self, twist: Twist, delay_s: float, seconds: float = PERIOD_S, every_s: float = PERIOD_S) -> MuxDecision:
        """For a while, each message arriving `delay_s` after it was sent; the last decision."""
        for _ in range(round(seconds / every_s)):
            self.sent_s += every_s
            self.now_s = max(self.now_s, self.sent_s + delay_s)
            stamp_s = self.sent_s + WALL_S + self.apart_s
            self.mux.accept_command("joystick", twist, self.now_s, sent=Sent(stamp_s, WALL_S + self.now_s, self.now_s))
        return self.mux.decide(self.now_s)

    def restart(self) -> None:
        """The velocity process starts again."""
        self.mux = rested(self.sources)


@pytest.fixture(params=[(True, 0.0), (False, 0.0), (False, -1000.0), (False, 7.5)], ids=str)
def link(request: pytest.FixtureRequest) -> Link:
    """Of the robot's clock, and of others."""
    return Link(*request.param)


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.28])
def test_a_delay_within_the_timeout_is_followed_and_shortens_how_long_the_command_holds(
    link: Link, delay_s: float
) -> None:
    link.send(ZERO, 0.01, 1.0)
    assert link.send(FORWARD, 0.01 + delay_s, 1.0).twist == FORWARD
    assert link.mux.decide(link.now_s + 0.28 - delay_s).twist == FORWARD
    assert link.mux.decide(link.now_s + 0.31 - delay_s).twist == ZERO


def test_letting_go_of_the_stick_over_a_network_that_delays_by_two_seconds_stops_at_once(link: Link) -> None:
    link.send(ZERO, 0.01, 1.0)
    assert link.send(FORWARD, 0.01, 1.0).twist == FORWARD
    decision = link.send(FORWARD, 2.0)  # the first late one
    assert (decision.active, decision.twist) == ("joystick", ZERO)
    assert decision.sources[0].standing is SourceStanding.DELAYED
    told = "2.00 s (limit 0.30 s, same_clock true)" if link.same_clock else "1.99 s (limit 0.30 s, same_clock false)"
    assert decision.sources[0].reason == f"delayed by {told}"
    assert link.send(FORWARD, 2.0, 10.0).twist == ZERO


def test_after_a_long_delay_a_zero_that_is_on_time_must_come_first(link: Link) -> None:
    link.send(ZERO, 0.01, 1.0)
    link.send(FORWARD, 2.0, LATE_S + 0.2)
    assert link.send(ZERO, 2.0).sources[0].armed is False  # what was zero two seconds ago arms nobody
    link.sent_s += 3.0
    assert link.send(FORWARD, 0.01, 1.0).sources[0].reason.startswith("waiting for zero")
    assert link.send(ZERO, 0.01).sources[0].armed
    assert link.send(FORWARD, 0.01).twist == FORWARD


def test_a_short_burst_after_a_gap_is_followed_again_without_a_zero(link: Link) -> None:
    link.send(ZERO, 0.01, 1.0)
    link.send(FORWARD, 0.01, 1.0)
    assert link.send(FORWARD, 0.5).twist == ZERO  # held up by the radio for half a second …
    link.sent_s += 0.5
    assert link.send(FORWARD, 0.01).twist == FORWARD  # … and the next one is on time


def test_a_late_source_keeps_a_lower_one_from_driving(link: Link) -> None:
    link.send(ZERO, 0.01, 1.0)
    link.send(FORWARD, 1.0)
    link.mux.accept_command("navigation", FORWARD, link.now_s)
    decision = link.mux.decide(link.now_s)
    assert (decision.active, decision.twist) == ("joystick", ZERO)


# the stick works ── from now on everything is delayed, for eleven minutes and more ── the delay is over
@pytest.mark.parametrize("gap_s", [0.0, 30.0, 90.0])
@pytest.mark.parametrize("delay_s", [0.35, 1.0, 2.0])
def test_a_delay_that_lasts_is_never_taken_for_none_and_ends_when_the_commands_are_recent_again(
    link: Link, delay_s: float, gap_s: float
) -> None:
    link.send(ZERO, 0.01, 1.0)
    link.sent_s += gap_s  # an outage of the radio before it
    for _ in range(75):
        link.send(ZERO, delay_s, 9.0, every_s=0.5)
        assert link.send(FORWARD, delay_s, 1.0).twist == ZERO
    link.sent_s += delay_s
    link.send(ZERO, 0.01)
    assert link.send(FORWARD, 0.01).twist == FORWARD


# a link that carries a little less than the sender sends; at 0.9 ms more with each second it is 3.2 s behind in an hour
@pytest.mark.parametrize("per_s", [0.1e-3, 0.5e-3, 0.9e-3, 2e-3, 5e-3])
def test_a_queue_that_grows_slowly_is_never_followed_above_the_timeout(link: Link, per_s: float) -> None:
    link.send(ZERO, 0.01, 1.0)
    followed_s = refused_s = 0.0
    for second in range(0, 4000, 2):
        delay_s = 0.01 + per_s * second
        if link.send(FORWARD, delay_s, 2.0, every_s=1.0).twist == FORWARD:
            followed_s = delay_s
        else:
            refused_s = refused_s or delay_s
    assert followed_s <= 0.31 + per_s
    assert refused_s > 0.3


def test_a_delay_that_is_there_from_the_first_command_on_is_not_followed_and_a_restart_changes_nothing() -> None:
    link = Link(same_clock=True)
    for _ in range(3):
        for _ in range(70):
            link.send(ZERO, 1.0, 9.0, every_s=0.5)
            assert link.send(FORWARD, 1.0, 1.0).twist == ZERO
        link.restart()
    assert link.send(FORWARD, 3.26).sources[0].reason == "delayed by 3.26 s (limit 0.30 s, same_clock true)"


# chrony slews the sender's clock by 1 s within 12 s: it was right before, or it is right after that
@pytest.mark.parametrize("wrong_s", [-1.0, 1.0])
@pytest.mark.parametrize("was_right", [False, True])
def test_a_sender_whose_clock_is_slewed_is_followed_while_its_clock_is_right(wrong_s: float, was_right: bool) -> None:
    link = Link(same_clock=True)
    clocks = [wrong_s * step / 12.0 for step in range(13)]
    for step, link.apart_s in enumerate(clocks if was_right else clocks[::-1]):
        link.send(ZERO, 0.01, 0.5)
        decision = link.send(FORWARD, 0.01, 0.5)
        off_s = link.apart_s
        assert (decision.twist == FORWARD) is (-0.29 <= off_s <= FUTURE_S + 0.01), (step, off_s)
    if not was_right:
        assert decision.twist == FORWARD


@pytest.mark.parametrize("ppm", [-50.0, 20.0, 50.0])
def test_another_clock_that_drifts_away_counts_as_late_from_the_timeout_on(ppm: float) -> None:
    link = Link(same_clock=False, apart_s=3.0)
    link.send(ZERO, 0.01, 1.0)
    for step in range(400):
        link.apart_s = 3.0 - ppm * 1e-6 * 30.0 * step
        decision = link.send(FORWARD, 0.01, 30.0, every_s=1.0)
        assert (decision.twist == FORWARD) is (3.0 - link.apart_s <= 0.3)


def test_another_clock_that_is_set_forward_changes_nothing_and_one_that_is_set_back_is_late_until_it_is_set_again() -> (
    None
):
    link = Link(same_clock=False)
    link.send(ZERO, 0.01, 1.0)
    link.apart_s += 3600.0
    assert link.send(FORWARD, 0.01).twist == FORWARD
    link.apart_s -= 7200.0
    for _ in range(100):
        link.send(ZERO, 0.01, 9.0, every_s=1.0)
        assert (
            link.send(FORWARD, 0.01, 1.0).sources[0].reason == "delayed by 7200.00 s (limit 0.30 s, same_clock false)"
        )
    link.apart_s += 7200.0
    link.send(ZERO, 0.01)
    assert link.send(FORWARD, 0.01).twist == FORWARD


@pytest.mark.parametrize("same_clock", [True, False])
def test_a_clock_that_is_set_back_by_less_than_the_timeout_needs_a_zero(same_clock: bool) -> None:
    link = Link(same_clock)
    link.send(ZERO, 0.01, 1.0)
    assert link.send(FORWARD, 0.01).twist == FORWARD
    link.apart_s -= 0.2
    assert link.send(FORWARD, 0.01).sources[0].reason.endswith("or the clock of its sender was set back)")
    assert link.send(FORWARD, 0.01, 1.0).twist == ZERO
    link.send(ZERO, 0.01)
    assert link.send(FORWARD, 0.01).twist == FORWARD


def test_the_same_stamp_again_and_again_grows_old() -> None:
    mux = rested()
    for step in range(20):
        mux.accept_command("joystick", FORWARD, 0.05 * step, sent=Sent(5.0, 5.0 + 0.05 * step, 0.05 * step))
    assert mux.decide(0.95).sources[0].reason == "delayed by 0.95 s (limit 0.30 s, same_clock true)"


# 1.00 forward ── 1.05 forward, late ── 1.10 the stick is released ── 1.11 the zero arrives ── 1.12 the forward of 1.05
def test_a_command_that_a_newer_one_has_overtaken_is_not_followed_before_the_next_zero(link: Link) -> None:
    link.send(ZERO, 0.0, 0.5)
    assert link.send(FORWARD, 0.0, 0.5).twist == FORWARD
    for twist, sent_s, now_s in ((ZERO, 1.10, 1.11), (FORWARD, 1.05, 1.12)):
        link.mux.accept_command(
            "joystick", twist, now_s, sent=Sent(sent_s + WALL_S + link.apart_s, WALL_S + now_s, now_s)
        )
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
                mux.accept_command("joystick", twist, now_s, sent=Sent(WALL_S + at_s, WALL_S + now_s, now_s))
        assert twice.decide(at_s + again_s).twist == once.decide(at_s + again_s).twist == twist
    last_s = PERIOD_S * 20
    for mux, arrivals in ((once, (last_s,)), (twice, (last_s, last_s + again_s))):
        for now_s in arrivals:
            mux.accept_command("joystick", FORWARD, now_s, sent=Sent(WALL_S + last_s, WALL_S + now_s, now_s))
    for age_s in (0.29, 0.31):
        assert (
            twice.decide(last_s + age_s).twist
            == once.decide(last_s + age_s).twist
            == (FORWARD if age_s < 0.3 else ZERO)
        )


def test_without_a_stamp_nothing_is_known_of_the_delay() -> None:
    mux = rested()
    mux.accept_command("joystick", FORWARD, 0.0)
    assert mux.decide(0.0).sources[0].delay_s is None
    assert mux.decide(0.0).twist == FORWARD


@pytest.mark.parametrize(("age_s", "reason"), [
    (0.0, ""), (0.29, ""), (0.31, "delayed by 0.31 s (limit 0.30 s, same_clock true)"), (-0.09, ""),
    (-0.11, "stamped in the future by 0.11 s (same_clock true)"),
    (-5.0, "stamped in the future by 5.00 s (same_clock true)"),
])  # fmt: skip
def test_with_the_same_clock_the_age_of_the_stamp_counts_from_the_first_message_on(age_s: float, reason: str) -> None:
    source = MuxSource(topic="x", priority=1, timeout_s=0.3, same_clock=True)
    mux = rested({"local": source})
    mux.accept_command("local", FORWARD, 0.0, sent=Sent(WALL_S - age_s, WALL_S, 0.0))
    assert mux.decide(0.0).sources[0].reason == reason
    assert mux.decide(0.0).twist == (ZERO if reason else FORWARD)


def test_two_senders_on_one_topic_whose_clocks_differ_are_never_followed() -> None:
    mux = rested()
    for step in range(40):
        stamp_s = WALL_S + 0.05 * step - (0.2 if step % 2 else 0.0)
        mux.accept_command("joystick", FORWARD, 0.05 * step, sent=Sent(stamp_s, WALL_S + 0.05 * step, 0.05 * step))
    assert mux.decide(1.95).twist == ZERO


def test_delays_are_small_numbers_though_clocks_are_far_apart() -> None:
    delay = Delay(same_clock=False)
    assert delay.measure(Sent(WALL_S, 0.0, 1.0)) == 0.0
    assert delay.measure(Sent(WALL_S + 1.0, 0.0, 2.25)) == pytest.approx(0.25)
    assert not delay.set_back


def test_each_source_has_a_delay_of_its_own() -> None:
    other = {name: source.model_copy(update={"same_clock": False}) for name, source in DEFAULT_SOURCES.items()}
    mux = rested(other)
    mux.accept_command("joystick", FORWARD, 1.0, sent=Sent(9.0, 0.0, 1.0))
    mux.accept_command("navigation", FORWARD, 1.0, sent=Sent(700.0, 0.0, 1.0))
    assert [source.delay_s for source in mux.decide(1.0).sources] == [0.0, 0.0, None]


# Exactly at its limits


def test_a_delay_as_long_as_the_limit_counts_and_a_longer_one_does_not() -> None:
    delay = Delay(same_clock=True)
    assert delay.why_late(0.5, 0.5) == ""
    assert delay.why_late(math.nextafter(0.5, 1.0), 0.5) == "delayed by 0.50 s (limit 0.50 s, same_clock true)"


def test_a_stamp_as_far_in_the_future_as_two_clocks_may_differ_counts() -> None:
    delay = Delay(same_clock=True)
    assert delay.why_late(-FUTURE_S, 0.5) == ""
    assert delay.why_late(-math.nextafter(FUTURE_S, 1.0), 0.5).startswith("stamped in the future by 0.10 s")


# stamps of 0.005 s, 0 s ── 0 s, just below 0: no clock was set ── and before the first message none was
def test_stamps_may_go_back_by_5_ms() -> None:
    delay = Delay(same_clock=False)
    assert delay.set_back is False
    for stamp_s, set_back in ((SET_BACK_S, False), (0.0, False), (math.nextafter(-SET_BACK_S, -1.0), True)):
        delay.measure(Sent(stamp_s, 0.0, 0.0))
        assert delay.set_back is set_back
