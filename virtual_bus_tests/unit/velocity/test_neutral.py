"""Neutral start: who ordered motion while the base could not move is followed after a zero command. Times in s."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.mux import DEFAULT_SOURCES
from canbase_config.robot import Rates
from canbase_runtime.driver_state import DriverState, driver_state
from canbase_runtime.source_standing import SourceStanding
from canbase_velocity.base_ready import STATUS_TIMEOUT_S, BaseReady, status_timeout_s
from canbase_velocity.delay import Sent
from canbase_velocity.mux import Mux
from canbase_velocity.neutral import BLIND_S, Arming
from canbase_velocity.twist import ZERO, Twist
from support.neutral_story import FORWARD, STATUS_S, STEP_S, Story


@pytest.fixture
def story() -> Story:
    return Story()


def test_a_stick_that_is_held_while_the_mux_starts_moves_nothing_until_it_was_released(story: Story) -> None:
    assert not story.followed("joystick", 30.0)
    decision = story.decide()
    assert (decision.active, decision.twist) == ("joystick", ZERO)
    assert decision.sources[0].standing is SourceStanding.UNARMED
    assert decision.sources[0].reason == "waiting for zero (velocity_mux started)"
    story.release()
    assert story.followed("joystick")


def driver_latches(story: Story) -> None:
    story.driver = DriverState.LATCHED


def driver_is_silent(story: Story) -> None:
    story.driver = None


def estop_holds(story: Story) -> None:
    story.estop_free = False


@pytest.mark.parametrize("event", [driver_latches, driver_is_silent, estop_holds])
def test_a_stick_held_over_a_stop_is_not_followed_after_it(story: Story, event: Callable[[Story], None]) -> None:
    story.release()
    assert story.followed("joystick")
    event(story)
    story.run(1.0)
    assert story.decide().twist == ZERO
    story.driver, story.estop_free = DriverState.ENABLED, True
    story.ordered.clear()
    assert story.run(20.0).twist == ZERO
    assert set(story.ordered) == {ZERO}
    assert story.decide().sources[0].reason.startswith("waiting for zero (")
    story.release()
    assert story.followed("joystick")


@pytest.mark.parametrize("state", [*(each for each in DriverState if each is not DriverState.ENABLED), driver_state(9)])
def test_no_state_but_enabled_is_ready(story: Story, state: DriverState) -> None:
    story.release()
    story.driver = state
    story.sends = {"joystick": FORWARD}
    story.run(0.3)
    story.driver = DriverState.ENABLED
    assert not story.followed("joystick")
    assert story.decide().sources[0].reason == f"waiting for zero (motor_driver is {state.name})"


def test_a_driver_that_restarted_within_one_period_of_its_status_disarms(story: Story) -> None:
    story.release()
    assert story.followed("joystick")
    story.cycles = 3  # the new process counts from its start, and is enabled already
    assert not story.followed("joystick")
    assert story.decide().sources[0].reason == "waiting for zero (motor_driver was restarted)"


@pytest.mark.parametrize("gap_s", [0.1, 0.45, 1.0, 30.0])
def test_a_radio_gap_over_a_reset_arms_no_joystick(story: Story, gap_s: float) -> None:
    story.release()
    assert story.followed("joystick")
    story.sends = {}  # the radio is gone
    story.driver = DriverState.LATCHED
    story.run(gap_s / 2)
    story.driver = DriverState.ENABLED  # the operator resets
    story.run(gap_s / 2 + STATUS_S)
    assert not story.followed("joystick", 5.0)  # the stick was held all the time
    story.release()
    assert story.followed("joystick")


@pytest.mark.parametrize("gap_s", [0.02, 0.45, 0.5, 1.0, 1.5, 1.9])
def test_navigation_is_not_armed_by_a_gap_that_is_shorter_than_its_key(story: Story, gap_s: float) -> None:
    assert not story.followed("navigation", 0.5)
    story.sends = {}
    story.run(gap_s)
    assert not story.followed("navigation", 1.0)
    story.sends = {}
    story.run(2.02)
    assert story.followed("navigation")


@pytest.mark.parametrize("name", ["navigation", "action"])
def test_a_program_that_was_idle_begins_with_a_velocity(story: Story, name: str) -> None:
    story.run(2.1)
    assert story.followed(name)
    story.driver = DriverState.LATCHED  # and after a stop it needs zero, or to be idle again
    story.run(0.5)
    story.driver = DriverState.ENABLED
    assert not story.followed(name, 5.0)
    assert story.decide().holder is not None
    assert "waiting for zero or 2.0 s of silence (motor_driver is LATCHED)" in story.decide().sentence
    story.sends = {}
    story.run(2.1)
    assert story.followed(name)


def test_absence_that_nobody_watched_arms_nobody(story: Story) -> None:
    assert not story.followed("navigation", 0.5)
    story.now_s += 30.0  # this process stood still; navigation did not
    assert story.mux.decide(story.now_s).twist == ZERO
    assert not story.followed("navigation", 1.0)


def test_a_held_stick_that_is_not_followed_lets_no_lower_source_drive_either(story: Story) -> None:
    story.run(2.1)
    story.sends = {"joystick": FORWARD, "navigation": Twist(-0.2, 0.1)}
    decision = story.run(1.0)
    assert (decision.active, decision.twist) == ("joystick", ZERO)
    assert decision.sources[1].reason == "joystick has priority"
    del story.sends["joystick"]  # released, and switched off: nobody wants to drive by hand any more
    assert story.run(0.5).twist == Twist(-0.2, 0.1)


def test_zeros_while_the_base_is_not_ready_arm(story: Story) -> None:
    story.driver = DriverState.BOOTING
    story.release()
    assert story.decide().sources[0].armed
    assert story.decide().not_ready == "motor_driver is BOOTING"
    story.driver = DriverState.ENABLED
    story.run(0.2)
    assert story.followed("joystick")


def test_nan_neither_arms_nor_disarms(story: Story) -> None:
    assert not story.followed("joystick")
    story.mux.accept_command("joystick", Twist(float("nan"), 0.0), story.now_s)
    assert not story.decide().sources[0].armed
    story.release()
    story.driver = DriverState.LATCHED
    story.run(0.2)
    story.mux.accept_command("joystick", Twist(float("nan"), 0.0), story.now_s)
    assert story.decide().sources[0].armed


def test_a_zero_that_waited_while_this_process_stood_still_does_not_arm() -> None:
    mux = Mux(DEFAULT_SOURCES)
    mux.accept_command("joystick", ZERO, received=100.0, now_s=103.0)
    assert not mux.decide(103.0).sources[0].armed


@pytest.mark.parametrize(
    ("age_s", "problem"),
    [(0.0, ""), (STATUS_TIMEOUT_S, ""), (STATUS_TIMEOUT_S + 1e-9, "no recent message on motor_driver/status")],
)
def test_a_status_counts_until_exactly_its_timeout(age_s: float, problem: str) -> None:
    base = BaseReady()
    assert base.problem(0.0) == "nothing received on motor_driver/status yet"
    base.on_driver(DriverState.ENABLED, 1, 0.0)
    assert base.problem(0.0) == "the emergency stop is pressed or not reset"
    base.on_estop(True)
    assert base.problem(age_s) == problem


def test_the_status_timeout_covers_a_slow_status() -> None:
    periods = [status_timeout_s(Rates(status_hz=hz)) for hz in (50.0, 10.0, 5.0, 1.0)]
    assert periods == pytest.approx([0.5, 0.5, 0.5, 2.5])
    assert status_timeout_s(Rates(status_hz=50.0, odometry_hz=2.0)) == pytest.approx(1.25)


@pytest.mark.parametrize(("absent_s", "silence_s", "armed"), [
    (None, 1e9, False), (2.0, 1.999, False), (2.0, 2.0, True), (60.0, 59.9, False), (60.0, 60.0, True),
])  # fmt: skip
def test_absence_arms_at_exactly_its_key(absent_s: float | None, silence_s: float, armed: bool) -> None:
    arming = Arming(absent_s)
    arming.missed(10.0)
    arming.advance("not ready", 10.0 + silence_s, silent=True)
    assert arming.armed is armed


EVENTS: dict[str, dict[str, object]] = {
    "move": {"sends": {"joystick": FORWARD}},
    "zero": {"sends": {"joystick": ZERO}},
    "quiet": {"sends": {}},
    "latch": {"driver": DriverState.LATCHED},
    "enable": {"driver": DriverState.ENABLED},
    "mute": {"driver": None},
    "press": {"estop_free": False},
    "free": {"estop_free": True},
    "restart": {"cycles": 0},
}
events = st.lists(st.tuples(st.sampled_from(sorted(EVENTS)), st.sampled_from([0.02, 0.1, 0.45, 0.6])), max_size=40)


@given(events=events)
def test_no_motion_reaches_the_base_without_a_zero_since_the_last_motion_while_it_was_not_ready(
    events: list[tuple[str, float]],
) -> None:
    story, zero_seen, last = Story(), False, ZERO
    for what, seconds in events:
        for name, value in EVENTS[what].items():
            setattr(story, name, value)
        for _ in range(round(seconds / STEP_S)):
            decision = story.run(STEP_S)
            last = story.sends.get("joystick", last)
            if last.is_zero:
                zero_seen = zero_seen or "joystick" in story.sends
            elif decision.not_ready:
                zero_seen = False
            assert decision.twist.is_zero or (zero_seen and not decision.not_ready)


def test_before_anything_was_watched_nothing_is_absent() -> None:
    arming = Arming(2.0)
    arming.advance("", 1e9, silent=True)
    assert not arming.armed


# silent until 1.9 s, the last of it while the mux hangs ── silent for 0.5 s more: absent for 2 s, if all was watched
@pytest.mark.parametrize(("pause_s", "armed"), [(0.19, True), (0.21, False), (1.1, False)])
def test_an_absence_that_the_mux_did_not_watch_begins_again(pause_s: float, armed: bool) -> None:
    story = Story({"joystick": DEFAULT_SOURCES["joystick"].model_copy(update={"neutral_after_s": 2.0})})
    story.run(1.9 - pause_s)
    story.now_s += pause_s - STEP_S
    story.run(0.5)
    assert story.decide().sources[0].armed is armed


def test_the_mux_decides_often_enough_to_watch_absence() -> None:
    assert BLIND_S > 1.0 / 20.0  # least rates.command_hz


@pytest.mark.parametrize("event", [driver_latches, driver_is_silent, estop_holds])
@pytest.mark.parametrize("gap_s", [0.02, 0.5, 5.0])
def test_a_stick_that_is_pushed_in_a_radio_gap_across_a_stop_is_not_followed_by_its_old_zero(
    story: Story, event: Callable[[Story], None], gap_s: float
) -> None:
    """The last that was heard of it is a zero, from before the stop. The gap ends `gap_s` after the stop does."""
    story.release()
    assert story.followed("joystick")
    story.release()
    story.sends = {}
    story.run(0.4)
    event(story)
    story.run(1.0)
    story.driver, story.estop_free = DriverState.ENABLED, True
    story.run(gap_s)
    assert not story.followed("joystick", 20.0)
    assert story.decide().sources[0].reason.startswith("waiting for zero (")
    story.release()
    assert story.followed("joystick")


def test_what_waited_in_the_radio_comes_at_once_after_a_stop_and_is_not_followed(story: Story) -> None:
    """Stamped: zero until 0.0; the stick is pushed in the gap; stop and reset; then 70 messages in one moment."""

    def say(twist: Twist, sent_s: float) -> None:
        sent = Sent(1000.0 + sent_s, 1000.0 + story.now_s, story.now_s)
        story.mux.accept_command("joystick", twist, story.now_s, sent=sent)

    for _ in range(50):
        story.run(STEP_S)
        say(ZERO, story.now_s)
    pushed_s = story.now_s
    story.run(0.2)
    driver_latches(story)
    story.run(1.0)
    story.driver = DriverState.ENABLED
    story.run(0.2)
    for number in range(70):
        say(FORWARD, pushed_s + STEP_S * number)
    story.ordered.clear()
    for _ in range(50):
        story.run(STEP_S)
        say(FORWARD, story.now_s)
    assert set(story.ordered) == {ZERO}


def test_a_stick_at_rest_that_goes_on_to_say_so_and_a_program_that_was_just_at_zero_are_followed_at_once(
    story: Story,
) -> None:
    story.release()
    story.release("navigation")
    story.sends = {"joystick": ZERO}
    driver_latches(story)
    story.run(1.0)
    story.driver = DriverState.ENABLED
    story.run(0.2)
    story.sends = {}
    story.run(0.4)
    assert story.followed("joystick", 0.1)
    story.sends = {}
    story.run(0.4)
    assert story.followed("navigation", 0.1)


# 0.0 a program orders 0.3 m/s, and ends ── 0.1 the stop is pressed ── 0.8 released ── 1.0 absent: its command is still
# fresh for a second
@pytest.mark.parametrize("event", [driver_latches, estop_holds])
@pytest.mark.parametrize("timeout_s", [0.3, 1.0, 2.0])
def test_a_source_that_ended_before_a_stop_moves_nothing_after_it(
    event: Callable[[Story], None], timeout_s: float
) -> None:
    source = DEFAULT_SOURCES["navigation"].model_copy(update={"timeout_s": timeout_s, "neutral_after_s": 1.0})
    story = Story({"pad": source})
    story.run(1.1)
    assert story.followed("pad")
    story.sends = {}
    story.run(0.1)
    event(story)
    story.run(0.7)
    story.driver, story.estop_free = DriverState.ENABLED, True
    story.ordered.clear()
    story.run(5.0)
    assert set(story.ordered) == {ZERO}
    assert story.followed("pad")  # it was absent: the program starts again with a velocity
