"""Key yields_after_zero_s: an idle joystick leaves the base to lower sources, and time alone starts no motion."""

from __future__ import annotations

import pytest

from canbase_config.mux import DEFAULT_SOURCES
from canbase_runtime.source_standing import SourceStanding
from canbase_velocity.mux import Mux
from canbase_velocity.twist import ZERO, Twist
from support.mux_world import rested

AFTER_S = 3.0
JOYSTICK = DEFAULT_SOURCES["joystick"].model_copy(update={"yields_after_zero_s": AFTER_S})
FORWARD, BACK = Twist(0.3, 0.0), Twist(-0.2, 0.0)


@pytest.fixture
def mux() -> Mux:
    return rested(DEFAULT_SOURCES | {"joystick": JOYSTICK})


def run(mux: Mux, start_s: float, end_s: float, **commands: Twist) -> list[tuple[float, str | None, Twist]]:
    """The same commands at 20 Hz; what was decided after each."""
    decided = []
    for step in range(round((end_s - start_s) * 20)):
        now_s = start_s + step / 20
        for name, twist in commands.items():
            mux.accept_command(name, twist, now_s)
        decision = mux.decide(now_s)
        decided.append((round(now_s, 2), decision.active, decision.twist))
    return decided


def test_an_idle_joystick_yields_after_its_time_and_navigation_that_starts_then_drives(mux: Mux) -> None:
    idle = run(mux, 0.0, 5.0, joystick=ZERO, navigation=ZERO)
    assert [active for _, active, _ in idle] == ["joystick"] * 60 + ["navigation"] * 40
    assert mux.decide(5.0).sources[0].reason == "zero for 3 s: it yields"
    assert mux.decide(5.0).sources[0].standing is SourceStanding.LOWER_PRIORITY
    driven = run(mux, 5.0, 6.0, joystick=ZERO, navigation=FORWARD)
    assert {(active, twist) for _, active, twist in driven} == {("navigation", FORWARD)}


def test_without_the_key_zeros_keep_the_base() -> None:
    decided = run(rested(), 0.0, 70.0, joystick=ZERO, navigation=FORWARD)
    assert {active for _, active, _ in decided} == {"joystick"}


def test_while_nothing_else_commands_nobody_has_the_base(mux: Mux) -> None:
    run(mux, 0.0, 4.0, joystick=ZERO)
    assert (mux.decide(4.0).active, mux.decide(4.0).twist) == (None, ZERO)


def test_the_first_motion_of_the_joystick_takes_the_base_back_at_once(mux: Mux) -> None:
    run(mux, 0.0, 4.0, joystick=ZERO)
    run(mux, 4.0, 5.0, joystick=ZERO, navigation=FORWARD)
    mux.accept_command("joystick", BACK, 5.0)
    assert (mux.decide(5.0).active, mux.decide(5.0).twist) == ("joystick", BACK)
    mux.accept_command("joystick", ZERO, 5.05)
    assert (mux.decide(5.05).active, mux.decide(5.05).twist) == ("joystick", ZERO), "released: it keeps the base"


def test_a_program_that_orders_motion_when_the_joystick_yields_is_not_followed_before_its_zero(mux: Mux) -> None:
    run(mux, 0.0, 0.5, navigation=FORWARD)
    run(mux, 0.5, 1.0, joystick=BACK, navigation=FORWARD)
    stopped = run(mux, 1.0, 8.0, joystick=ZERO, navigation=FORWARD)
    assert {twist for _, _, twist in stopped} == {ZERO}
    assert "waiting for zero or 1.0 s of silence (joystick yielded the base)" in mux.decide(8.0).sources[1].reason
    run(mux, 8.0, 8.1, joystick=ZERO, navigation=ZERO)
    assert run(mux, 8.1, 8.2, joystick=ZERO, navigation=FORWARD)[-1][1:] == ("navigation", FORWARD)


def test_a_radio_gap_of_the_program_at_that_moment_changes_nothing(mux: Mux) -> None:
    run(mux, 0.0, 2.7, joystick=ZERO, navigation=FORWARD)
    run(mux, 2.7, 3.4, joystick=ZERO)  # 0.7 s, its timeout is 0.5 s
    assert {twist for _, _, twist in run(mux, 3.4, 5.0, joystick=ZERO, navigation=FORWARD)} == {ZERO}


def test_zeros_after_a_gap_hold_the_base_for_the_whole_time_again(mux: Mux) -> None:
    """An operator who presses the enabling button with the stick in the middle, to stop the base."""
    run(mux, 0.0, 4.0, joystick=ZERO)
    run(mux, 4.0, 5.0, navigation=FORWARD)
    held = run(mux, 5.0, 7.95, joystick=ZERO, navigation=FORWARD)
    assert {(active, twist) for _, active, twist in held} == {("joystick", ZERO)}


def test_a_source_that_is_not_followed_does_not_yield(mux: Mux) -> None:
    """Two publishers, so that no zero arms: which of them a person holds is unknown."""
    run(mux, 0.0, 0.1, joystick=ZERO)
    mux.on_publishers(JOYSTICK.topic, ["/one/pad", "/two/pad"])
    decided = run(mux, 0.1, 5.0, joystick=ZERO, navigation=FORWARD)
    assert {(active, twist) for _, active, twist in decided} == {("joystick", ZERO)}
