"""Tab in the shell: typer's own completion, asked as bash and zsh ask it."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from support.robot_files import write


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Other nodes and joints than those of the bench sample."""
    changes = {6: "  - joint: port", 7: "    node_id: 11", 11: "  - joint: starboard", 12: "    node_id: 12"}
    return write(tmp_path, changes)


def bash(line: str) -> list[str]:
    """What is proposed for the last word of this line, which a space at the end makes an empty one."""
    words = line.split(" ")
    asked = {"_CANBASE_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    done = CliRunner().invoke(app, env=asked, prog_name="canbase")
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.parametrize("command", ["bus sdo read", "bus sdo write"])
def test_node_ids_of_the_robot_that_the_line_names(command: str, file: Path) -> None:
    assert bash(f"canbase {command} --config {file} ") == ["11", "12"]
    assert bash(f"canbase {command} -c {file} 12") == ["12"]
    assert bash(f"canbase {command} -c {file} 2") == []


def test_without_one_those_of_the_robot_that_is_meant() -> None:
    assert bash("canbase bus sdo read ") == ["1", "2"]
    assert bash("canbase bus jog ") == ["left_wheel", "right_wheel"]


def test_joints_of_the_robot_that_the_line_names(file: Path) -> None:
    assert bash(f"canbase bus jog --config {file} s") == ["starboard"]


def test_zsh_shows_what_belongs_to_them(file: Path) -> None:
    asked = {"_CANBASE_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": f"canbase bus sdo read -c {file} "}
    told = CliRunner().invoke(app, env=asked, prog_name="canbase").stdout
    assert '"11":"port"' in told
    assert '"12":"starboard"' in told


def test_steps_of_a_commissioning_one_after_the_other(file: Path) -> None:
    line = f"canbase setup commission --config {file} --steps "
    assert bash(line) == ["directions", "scale", "proof", "floor"]
    assert bash(f"{line}directions,") == ["directions,scale", "directions,proof", "directions,floor"]
    assert bash(f"{line}directions,p") == ["directions,proof"]


@pytest.mark.parametrize("content", [None, "", "drives: 3", "{"])
def test_a_file_that_is_no_robot_proposes_nothing_and_says_nothing(content: str | None, tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    if content is not None:
        file.write_text(content, encoding="utf-8")
    assert bash(f"canbase bus jog --config {file} ") == []
