"""Neutral start: who ordered motion while the base could not move is followed after a zero command. Times in s."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.mux import DEFAULT_SOURCES, MuxLock, MuxSource
from canbase_runtime.driver_state import DriverState, driver_state
from canbase_runtime.source_standing import SourceStanding
from canbase_velocity.base_ready import STATUS_TIMEOUT_S, BaseReady, status_timeout_s
from canbase_velocity.delay import Sent
from canbase_velocity.mux import Mux, MuxDecision
from canbase_velocity.neutral import BLIND_S, Arming
from canbase_velocity.twist import ZERO, Twist
from canbase_velocity.unexpected_publishers import Foreign

FORWARD = Twist(0.3, 0.0)
STEP_S = 0.02
STATUS_S = 0.1


class Story:
    """A mux at 50 Hz, a driver that publishes its state at 10 Hz, and sources that publish what a test sets."""

    def __init__(self) -> None:
        self.mux = Mux(DEFAULT_SOURCES)
        self.now_s = 100.0
        self.driver: DriverState | None = DriverState.ENABLED
        self.estop_free = True
        self.cycles = 0
        self.sends: dict[str, Twist] = {}
        self.ordered: list[Twist] = []
        self._status_due = self.now_s

    def run(self, seconds: float) -> MuxDecision:
        """Let time pass; the last decision."""
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self.cycles += 2
            if self.driver is not None and self.now_s >= self._status_due:
                self._status_due = self.now_s + STATUS_S
                self.mux.on_driver(self.driver, self.cycles, self.now_s)
            for name, twist in self.sends.items():
                self.mux.on_command(name, twist, self.now_s)
            decision = self.decide()
        return decision

    def decide(self) -> MuxDecision:
        self.mux.on_estop(self.estop_free)
        decision = self.mux.decide(self.now_s)
        self.ordered.append(decision.twist)
        return decision

    def followed(self, name: str, seconds: float = 0.5) -> bool:
        """It orders motion for a while; whether the base gets it."""
        self.sends = {name: FORWARD}
        return self.run(seconds).twist == FORWARD

    def release(self, name: str = "joystick") -> None:
        self.sends = {name: ZERO}
        self.run(0.1)


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
    story.mux.on_command("joystick", Twist(float("nan"), 0.0), story.now_s)
    assert not story.decide().sources[0].armed
    story.release()
    story.driver = DriverState.LATCHED
    story.run(0.2)
    story.mux.on_command("joystick", Twist(float("nan"), 0.0), story.now_s)
    assert story.decide().sources[0].armed


def test_a_zero_that_waited_while_this_process_stood_still_does_not_arm() -> None:
    mux = Mux(DEFAULT_SOURCES)
    mux.on_command("joystick", ZERO, received=100.0, now_s=103.0)
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
    assert [status_timeout_s(hz) for hz in (50.0, 10.0, 5.0, 1.0)] == [0.5, 0.5, 0.5, 2.5]


@pytest.mark.parametrize(("absent_s", "silence_s", "armed"), [
    (None, 1e9, False), (2.0, 1.999, False), (2.0, 2.0, True), (60.0, 59.9, False), (60.0, 60.0, True),
])  # fmt: skip
def test_absence_arms_at_exactly_its_key(absent_s: float | None, silence_s: float, armed: bool) -> None:
    arming = Arming(absent_s)
    arming.missed(10.0)
    arming.look("not ready", 10.0 + silence_s, silent=True)
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
        sent = Sent(1000.0 + sent_s, story.now_s, story.now_s)
        story.mux.on_command("joystick", twist, story.now_s, sent=sent)

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


# ---- pauses: the base has power, and a source is held back all the same ----
HOLD = "the pause"
STICK_LOCK = MuxLock(topic="pause", priority=101, required=False)
REQUIRED_LOCK = MuxLock(topic="pause", priority=101, required=True, timeout_s=0.5)
STRANGER = Foreign("cmd_vel_joy", "/stranger", "geometry_msgs/msg/TwistStamped", "is not named", "joystick", True)


def lock_closes(story: Story) -> None:
    story.mux.on_lock(HOLD, True, story.now_s)


def lock_is_silent(story: Story) -> None:
    """The Story says nothing for it."""


def stranger_comes(story: Story) -> None:
    story.mux.on_foreign([STRANGER])


def scans_are_missing(story: Story) -> None:
    story.mux.on_scans("no usable scan for 1.0 s: scan_stale")


def all_is_well(story: Story) -> None:
    story.mux.on_lock(HOLD, False, story.now_s)
    story.mux.on_foreign([])
    story.mux.on_scans("")


PAUSES = [
    (STICK_LOCK, lock_closes, "locked: the pause holds"),
    (REQUIRED_LOCK, lock_is_silent, "locked: the pause has published nothing"),
    (STICK_LOCK, stranger_comes, "locked: /stranger"),
    (STICK_LOCK, scans_are_missing, "no usable scan"),
]


def paused(lock: MuxLock, sources: dict[str, MuxSource] = DEFAULT_SOURCES) -> Story:
    story = Story()
    story.mux = Mux(sources, {HOLD: lock}, foreign_lock=True)
    story.mux.on_lock(HOLD, False, story.now_s)
    return story


@pytest.mark.parametrize("seconds", [0.02, 0.6, 5.0])
@pytest.mark.parametrize(("lock", "event", "reason"), PAUSES)
def test_a_stick_held_over_a_pause_is_not_followed_after_it(
    lock: MuxLock, event: Callable[[Story], None], reason: str, seconds: float
) -> None:
    if lock.required:
        seconds += lock.timeout_s
    story = paused(lock)
    story.release()
    assert story.followed("joystick", 0.2)
    event(story)
    story.run(seconds)
    all_is_well(story)
    story.ordered.clear()
    for _ in range(100):
        story.run(0.2)
        all_is_well(story)
    assert set(story.ordered) == {ZERO}
    assert story.decide().sources[0].reason.startswith(f"waiting for zero ({reason}")
    story.release()
    all_is_well(story)
    assert story.followed("joystick", 0.2)


def test_a_lock_that_opens_again_within_one_cycle_counts() -> None:
    story = paused(STICK_LOCK)
    story.release()
    assert story.followed("joystick", 0.2)
    story.mux.on_lock(HOLD, True, story.now_s)
    story.mux.on_lock(HOLD, False, story.now_s)
    assert not story.followed("joystick", 5.0)


def test_a_stick_that_is_pushed_in_a_radio_gap_across_a_lock_is_not_followed_by_its_old_zero() -> None:
    story = paused(STICK_LOCK)
    story.release()
    story.sends = {}
    story.run(0.4)
    lock_closes(story)
    story.run(0.5)
    all_is_well(story)
    assert not story.followed("joystick", 5.0)


def test_a_lock_below_a_stick_does_not_concern_it() -> None:
    story = paused(MuxLock(topic="pause", priority=99, required=False))
    story.release()
    assert story.followed("joystick", 0.2)
    lock_closes(story)
    story.run(1.0)
    all_is_well(story)
    assert story.run(0.02).twist == FORWARD


@pytest.mark.parametrize(("lock", "event", "reason"), [PAUSES[0], PAUSES[3]])
def test_navigation_goes_on_after_a_pause_unless_its_key_says_otherwise(
    lock: MuxLock, event: Callable[[Story], None], reason: str
) -> None:
    strict = {"navigation": DEFAULT_SOURCES["navigation"].model_copy(update={"neutral_after_s": None})}
    for sources, goes_on in ((DEFAULT_SOURCES, True), (strict, False)):
        story = paused(lock, sources)
        story.release("navigation")
        assert story.followed("navigation", 0.2)
        event(story)
        story.run(3.0)
        all_is_well(story)
        assert (story.run(1.0).twist == FORWARD) is goes_on


STICK = DEFAULT_SOURCES["joystick"].topic
PLANNER = DEFAULT_SOURCES["navigation"].topic


def test_the_zero_of_one_joystick_node_does_not_arm_the_stick_of_another(story: Story) -> None:
    story.release()
    assert story.followed("joystick", 0.2)
    story.mux.on_publishers(STICK, ["/joy_teleop", "/phone"])  # somebody has started a second one
    assert story.run(0.02).twist == ZERO
    for _ in range(10):  # they take turns
        story.release()
        assert not story.followed("joystick", 0.1)
    told = f"2 publishers on {STICK} (/joy_teleop, /phone): give each a topic and a key of its own"
    assert story.decide().sources[0].reason == told
    story.mux.on_publishers(STICK, ["/phone"])  # the first one has ended
    assert not story.followed("joystick", 1.0)
    assert story.decide().sources[0].reason == f"waiting for zero ({told})"
    story.release()
    assert story.followed("joystick", 0.2)


# armed ── its node ends ── a minute ── another one begins with a pushed stick: not followed
@pytest.mark.parametrize("gone_s", [0.0, 0.5, 60.0])
def test_the_zero_of_a_joystick_node_that_has_ended_does_not_arm_the_next_one(story: Story, gone_s: float) -> None:
    story.mux.on_publishers(STICK, ["/joy_teleop"], ["1f"])
    story.release()
    assert story.followed("joystick", 0.2)
    story.release()
    story.sends = {}
    if gone_s:
        story.mux.on_publishers(STICK, [], [])
        story.run(gone_s)
    story.mux.on_publishers(STICK, ["/joy_teleop"], ["2f"])  # the same name
    assert not story.followed("joystick", 1.0)
    assert story.decide().sources[0].reason == f"waiting for zero (a publisher on {STICK} has ended)"
    story.release()
    assert story.followed("joystick", 0.2)


def test_the_first_publisher_that_is_seen_disarms_nobody(story: Story) -> None:
    """The graph is looked at every 0.5 s: the zero may be there before its sender is seen."""
    story.release()
    story.mux.on_publishers(STICK, ["/joy_teleop"], ["1f"])
    assert story.followed("joystick", 0.2)
    story.mux.on_publishers(STICK, ["/joy_teleop"], ["1f"])
    assert story.followed("joystick", 0.2)


def test_a_planner_whose_node_is_started_again_goes_on(story: Story) -> None:
    story.mux.on_publishers(PLANNER, ["/controller_server"], ["1f"])
    story.run(2.5)
    assert story.followed("navigation", 0.2)
    story.mux.on_publishers(PLANNER, ["/controller_server"], ["2f"])
    assert story.followed("navigation", 0.2)


def test_many_nodes_of_a_planner_share_its_topic(story: Story) -> None:
    story.mux.on_publishers(PLANNER, ["/controller_server", "/behavior_server"])
    story.run(2.5)
    assert story.followed("navigation", 0.2)


@pytest.mark.parametrize("locked", [False, True])
def test_a_lock_with_two_publishers_holds_whatever_the_last_one_said(locked: bool) -> None:
    story = paused(MuxLock(topic="pause", priority=200, required=False))
    story.mux.on_publishers("pause", ["/gate", "/panel"])
    story.mux.on_lock(HOLD, locked, story.now_s)
    story.release()
    assert not story.followed("joystick", 1.0)
    story.mux.on_publishers("pause", ["/gate"])
    story.mux.on_lock(HOLD, False, story.now_s)
    story.release()
    assert story.followed("joystick", 0.2)


def test_a_topic_that_is_no_source_and_no_lock_concerns_nobody(story: Story) -> None:
    story.release()
    story.mux.on_publishers("elsewhere", ["/a", "/b"])
    assert story.followed("joystick", 0.2)
