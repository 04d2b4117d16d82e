"""Values of robot.yaml that are probably not meant: each has a warning with its numbers, and its limits have none."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_config.load import load_robot, sample

SOURCES = "mux:\n  sources:\n    joystick: {topic: cmd_vel_joy, priority: 100, timeout_s: 0.3}\n"
GOALS = "    goals: {topic: cmd_vel_action, priority: 40, timeout_s: 0.3}\n"


def warnings(folder: Path, old: str, new: str) -> dict[str, str]:
    """By key, of the bench with `new` in place of `old`."""
    text = sample("bench").read_text()
    assert old in text
    file = folder / "robot.yaml"
    file.write_text(text.replace(old, new))
    return {each.key: each.what for each in load_robot(file).warnings}


@pytest.mark.parametrize(
    ("key", "value", "is_told"),
    [
        ("max_speed_mps", "0.81", True),
        ("max_speed_mps", "0.8", False),
        ("max_speed_radps", "9.0", True),
        ("max_speed_radps", "1.0", False),
    ],
)
def test_goals_that_are_faster_than_the_robot(tmp_path: Path, key: str, value: str, is_told: bool) -> None:
    told = warnings(tmp_path, "lease:\n", f"action: {{{key}: {value}}}\nlease:\n")
    assert (f"action.{key}" in told) is is_told


@pytest.mark.parametrize(("sources", "is_told"), [(SOURCES, True), (SOURCES + GOALS, False)])
def test_sources_of_which_none_is_for_goals(tmp_path: Path, sources: str, is_told: bool) -> None:
    whole = sample("bench").read_text(encoding="utf-8")
    told = warnings(tmp_path, whole[whole.index("mux:\n") :], sources)
    assert ("mux.sources" in told) is is_told
    assert not is_told or "every goal is rejected" in told["mux.sources"]
