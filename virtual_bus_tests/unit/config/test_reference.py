"""docs/configuration.md has every key that a model takes, as the model has it."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.profile_file import PROFILE_SCHEMA
from canbase_config.reference import configuration_page
from canbase_config.robot import Robot
from canbase_config.schema import Schema

PAGE = Path(__file__).parents[3] / "docs" / "configuration.md"
SCHEMAS = {"robot.yaml": Schema(Robot), "profile": PROFILE_SCHEMA}


def test_the_page_is_what_canbase_config_keys_prints() -> None:
    written = PAGE.read_text(encoding="utf-8")
    assert written == configuration_page(), "write it anew: canbase config keys > docs/configuration.md"
    assert CliRunner().invoke(app, ["config", "keys"]).stdout == written


@pytest.mark.parametrize("file", SCHEMAS)
def test_every_key_has_a_row_and_a_meaning(file: str) -> None:
    page = configuration_page()
    for path, shape in SCHEMAS[file].shapes:
        heading = f"## `{path}`" if path else f"## {file}, top level"
        assert heading in page
        for key, inner in shape["properties"].items():
            assert f"| `{key}` |" in page
            assert SCHEMAS[file].resolved(inner).get("description"), f"{path}.{key} has no description"


@pytest.mark.parametrize(
    "row",
    [
        "| `command_s` | a number ≥ 0.05 and ≤ 0.5 | 0.2 | cmd_vel at the driver [s] |",
        "| `wheel_radius_m` | a number > 0.005 and ≤ 1 | **must be given** | [m] |",
        "| `side` | one of left, right | **must be given** | side of the base |",
        "| `sources` | section | joystick, navigation, action | velocity sources, by name |",
        "| `modes` | a list of 1 to any number of entries | 3, 9 |"
        " values of 6060h that take 60FFh, the preferred one first; or 2 alone: 6042h and 6044h |",
    ],
)
def test_a_row_says_what_may_stand_there_and_what_stands_there_by_default(row: str) -> None:
    assert row in configuration_page().splitlines()


def test_a_section_that_is_like_another_one_is_not_told_twice() -> None:
    assert "## `safety.more_scans[…]`\n\nAs `safety.scan`.\n" in configuration_page()
