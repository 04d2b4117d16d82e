"""The mux, replayed from the orders of its sources: who has the base, beside what was recorded."""

from __future__ import annotations

from typing import Any

import pytest

from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_recording.recorded_inputs import Happening, RecordedInputs
from canbase_recording.replay_sources import replay_sources
from canbase_recording.replay_text import source_lines, source_values
from canbase_runtime.source_standing import SourceStanding

ROBOT = load_robot(sample("bench")).robot
JOYSTICK_S = ROBOT.mux.sources["joystick"].timeout_s


def order(at_s: float, source: str, linear_mps: float = 0.3) -> Happening:
    return Happening(at_s, "order", {"source": source, "linear_mps": linear_mps, "angular_radps": 0.0})


def state(at_s: float, active: str, **more: Any) -> Happening:
    return Happening(at_s, "velocity_mux/state", {"active": active, **more})


def inputs(*happenings: Happening) -> RecordedInputs:
    in_order = tuple(sorted(happenings, key=lambda each: each.at_s))
    return RecordedInputs(
        frames=(), commands=(), happenings=in_order, began_s=100.0, wall_offset_s=1e9, at_s=105.0, stopped_by="",
        cause="", detail="", robot_yaml={}, profiles={}, watchdog=watchdog_config(ROBOT), bitrate=500_000, versions={},
    )  # fmt: skip


NAVIGATION = [order(100.0 + k * 0.05, "navigation") for k in range(100)]
JOYSTICK = [order(101.0 + k * 0.02, "joystick", 0.1) for k in range(50)]
"""Navigation drives all the time; the joystick takes over from 101.0 to 101.98 s."""
TOOK, LEFT = 101.0, 101.98 + JOYSTICK_S


def robot_with(name: str, **changes: float) -> Robot:
    sources = dict(ROBOT.mux.sources)
    sources[name] = sources[name].model_copy(update=changes)
    return ROBOT.model_copy(update={"mux": ROBOT.mux.model_copy(update={"sources": sources})})


def test_the_joystick_takes_over_and_leaves_after_its_timeout() -> None:
    found = replay_sources(inputs(*NAVIGATION, *JOYSTICK), ROBOT)
    assert [each.source for each in found.takeovers] == ["navigation", "joystick", "navigation"]
    assert [each.at_s for each in found.takeovers] == pytest.approx([100.0, TOOK, LEFT], abs=0.03)
    assert found.orders == {"navigation": 100, "joystick": 50}


def test_states_that_say_the_same_agree_also_where_they_come_a_little_later() -> None:
    states = [state(TOOK + 0.004, "joystick"), state(101.5, "joystick"), state(LEFT + 0.03, "navigation")]
    found = replay_sources(inputs(*NAVIGATION, *JOYSTICK, *states), ROBOT)
    assert (found.compared, found.left_out, found.differences) == (3, 0, ())


def test_a_mux_that_followed_another_source_differs() -> None:
    found = replay_sources(inputs(*NAVIGATION, *JOYSTICK, state(101.5, "navigation")), ROBOT)
    (difference,) = found.differences
    assert (difference.at_s, difference.recorded, difference.replayed) == (101.5, "navigation", "joystick")
    lines = list(source_lines(inputs(*NAVIGATION), found))
    assert lines[-1] == "  DIFFERS at 1.500 s: recorded navigation, replayed joystick"


def test_a_shorter_timeout_gives_the_base_back_earlier() -> None:
    given = inputs(*NAVIGATION, *JOYSTICK)
    found = replay_sources(given, robot_with("joystick", timeout_s=JOYSTICK_S - 0.1))
    assert found.takeovers[-1].at_s == pytest.approx(LEFT - 0.1, abs=0.03)


@pytest.mark.parametrize(
    "held",
    [
        {"locks": ["pause"]},
        {"standing": {"joystick": int(SourceStanding.LOCKED)}},
        {"standing": {"joystick": int(SourceStanding.SHUTDOWN)}},
    ],
)
def test_what_is_not_recorded_is_left_out(held: dict[str, Any]) -> None:
    found = replay_sources(inputs(*NAVIGATION, *JOYSTICK, state(101.5, "", **held)), ROBOT)
    assert (found.compared, found.left_out, found.differences) == (0, 1, ())


def test_before_the_longest_timeout_is_over_an_older_order_may_still_hold() -> None:
    found = replay_sources(inputs(*JOYSTICK, state(100.1, "navigation")), ROBOT)
    assert (found.compared, found.left_out) == (0, 1)


def test_a_source_that_the_other_robot_does_not_have_is_passed_over() -> None:
    found = replay_sources(inputs(order(101.0, "stranger"), state(103.0, "")), ROBOT)
    assert [each.source for each in found.takeovers] == [""]
    assert found.differences == ()


def test_a_recording_without_orders_has_no_source() -> None:
    found = replay_sources(inputs(), ROBOT)
    assert [each.source for each in found.takeovers] == [""]
    assert source_values(inputs(), found)["takeovers"] == [{"at_s": 0.0, "source": ""}]
    assert next(source_lines(inputs(), found)).startswith("velocity mux: orders of none; 0 states compared")


def test_orders_that_are_no_numbers_keep_nothing_alive() -> None:
    found = replay_sources(inputs(*(order(100.0 + k * 0.02, "joystick", float("nan")) for k in range(50))), ROBOT)
    assert [each.source for each in found.takeovers] == [""]
