"""What the watchdog may forgive: a file is refused just beyond the bound of each row, with the bound and its origin."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from canbase_campaign.robots import draw_robot
from canbase_config.errors import ConfigError
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.tolerances import BOUNDS, BY_RANGE, PRINTED, Bound
from canbase_config.watchdog_section import Watchdog
from canbase_watchdog.plausibility import DRIFT_M

NEAR = (0.1, 0.3, 0.5, 0.9, 0.99, 1.0, 1.0 + 0.9 * PRINTED, 1.0 + 1.1 * PRINTED, 1.02, 1.1, 1.5)
ROBOTS = (0, 1, 2, 5, 7, 11)


def ids(row: Bound) -> str:
    return row.key


def with_value(robot: Robot, row: Bound, value: float) -> dict[str, Any]:
    values = robot.model_dump()
    section, name = row.key.split(".")
    values[section][name] = value
    return values


def refusal(values: dict[str, Any]) -> str:
    try:
        Robot.model_validate(values)
    except ValidationError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("number", ROBOTS)
@pytest.mark.parametrize("row", BOUNDS, ids=ids)
def test_a_file_passes_up_to_the_bound_of_each_row_and_no_further(row: Bound, number: int) -> None:
    robot = draw_robot(number).robot
    bound = row.bound(robot)
    seen = set()
    for share in NEAR:
        given = bound / share if row.is_least else bound * share
        message = refusal(with_value(robot, row, given))
        if "should be" in message or "is too little for" in message:
            continue  # the range of the key itself ends before, or its reserve does
        others = [other for other in BOUNDS if message.find(f"{other.key} (") >= 0 and other is not row]
        if others:
            continue  # the bound of another key follows from this one
        seen.add(share > 1.0 + PRINTED)
        if share > 1.0 + PRINTED:
            assert f"{row.key} (" in message
            assert f"at {row.word} {bound:.3g} (" in message
            assert all(f"{key} " in message for key in row.others)
        else:
            assert message == ""
    assert False in seen


def test_on_the_sample_each_bound_is_met_or_the_range_ends_before_it() -> None:
    """On no row the range and the bound both miss what they are for."""
    robot = load_robot(sample("bench")).robot
    for row in BOUNDS:
        beyond = row.bound(robot) * (0.98 if row.is_least else 1.02)
        assert refusal(with_value(robot, row, beyond)), row.key


@pytest.mark.parametrize("row", BOUNDS, ids=ids)
def test_the_number_that_the_message_has_passes(row: Bound) -> None:
    for number in ROBOTS:
        robot = draw_robot(number).robot
        assert row.holds(robot)
        printed = float(f"{row.bound(robot):.3g}")
        section, name = row.key.split(".")
        changed = getattr(robot, section).model_copy(update={name: printed})
        assert row.holds(robot.model_copy(update={section: changed})) or row.key == "watchdog.motion_missing_s"


def test_every_key_of_the_section_has_a_row_or_what_bounds_it_otherwise() -> None:
    with_row = {row.key for row in BOUNDS}
    keys = {f"watchdog.{name}" for name in Watchdog.model_fields}
    assert len(keys) > 20
    assert keys - with_row == set(BY_RANGE)
    assert with_row - keys == {"base.standstill_mps"}
    assert all(len(reason) > 20 for reason in BY_RANGE.values())


@pytest.mark.parametrize(("name", "most"), [
    ("target_tolerance_share", 0.25), ("motion_tolerance_share", 0.25), ("twist_tolerance_share", 0.25),
    ("slow_wheel_share", 0.5), ("overspeed_factor", 1.5), ("travel_tolerance_m", DRIFT_M / 4.0),
    ("feedback_samples", 10),
])  # fmt: skip
def test_a_key_without_a_row_has_the_range_that_its_reason_states(name: str, most: float) -> None:
    values = load_robot(sample("bench")).robot.model_dump()
    step = 1 if isinstance(most, int) else 0.001
    values["watchdog"][name] = most + step
    assert "less than or equal to" in refusal(values)


def test_a_drawn_robot_is_within_all_bounds() -> None:
    for number in range(60):
        robot = draw_robot(number).robot
        assert [row.key for row in BOUNDS if not row.holds(robot)] == []


def test_the_message_names_file_line_key_bound_and_origin(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    text = Path(sample("bench")).read_text(encoding="utf-8")
    path.write_text(text + "\nwatchdog:\n  motion_tolerance_mps: 0.3\n", encoding="utf-8")
    line = path.read_text(encoding="utf-8").splitlines().index("  motion_tolerance_mps: 0.3") + 1
    with pytest.raises(ConfigError) as caught:
        load_robot(path)
    (told,) = str(caught.value).splitlines()
    assert told.startswith(f"{path}:{line}")
    assert told.endswith(
        "watchdog.motion_tolerance_mps (0.3) hides a wheel that turns without a setpoint: at most 0.2 "
        "(limits.linear_mps / 4; limits.linear_mps 0.8)"
    )


def test_limits_may_be_lowered_without_any_other_key() -> None:
    values = load_robot(sample("bench")).robot.model_dump()
    values["limits"] |= {"linear_mps": 0.02, "angular_radps": 0.05}
    assert refusal(values) == ""
    values["watchdog"]["motion_tolerance_mps"] = 0.051
    assert (
        "watchdog.motion_tolerance_mps (0.051) hides a wheel that turns without a setpoint: at most 0.05 "
        in refusal(values)
    )
