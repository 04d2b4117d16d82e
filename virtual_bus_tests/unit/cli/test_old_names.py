"""Every command of version 0.1 works by its old name too, and says the new one."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_cli.old_names import NEW, renamed

TOP = 20
"""As many names as a person can hold."""


def leaves(command: object, words: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """All commands below this one, each with the words that call it."""
    below = getattr(command, "commands", None)
    if below is None:
        return [words]
    return [leaf for name, child in below.items() for leaf in leaves(child, (*words, name))]


def test_at_most_twenty_names_are_at_the_top() -> None:
    assert len(typer.main.get_command(app).commands) <= TOP  # type: ignore[attr-defined]


def test_every_old_name_has_a_command() -> None:
    there = {words[: len(words)] for words in leaves(typer.main.get_command(app))}
    assert [old for old, new in NEW.items() if not any(words[:2] == new for words in there)] == []


@pytest.mark.parametrize("old", NEW)
def test_an_old_name_works(old: str) -> None:
    """Without a word to what is no terminal: a launch file may take each line on stderr for a failure."""
    found = CliRunner().invoke(app, [old, "--help"])
    new = " ".join(NEW[old])
    assert (found.exit_code, found.stderr) == (0, "")
    assert f"Usage: canbase {new}" in " ".join(found.stdout.split())


def test_a_terminal_shows_the_new_name() -> None:
    words = [sys.executable, "-m", "canbase_cli", "sample"]
    master, terminal = pty.openpty()
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=terminal, timeout=60, check=True)
    os.close(terminal)
    assert done.stdout.split() == [b"bench", b"example_can0"]
    assert os.read(master, 1000) == b"canbase sample is now: canbase print sample\r\n"
    os.close(master)


def test_record_was_a_command_and_is_a_group() -> None:
    assert renamed(["record", "--seconds", "5"]) == ["record", "start", "--seconds", "5"]
    assert renamed(["record"]) == ["record", "start"]
    for words in (["record", "--help"], ["record", "start"], ["record", "replay", "stop.asc"]):
        assert renamed(words) is None


def test_new_names_and_unknown_ones_stay() -> None:
    assert renamed(["bus", "scan"]) is None
    assert renamed(["docter"]) is None
    assert renamed([]) is None


@pytest.mark.parametrize("option", ["--output", "-o", "--out"])
def test_each_file_that_is_written_is_named_by_output_and_by_its_old_name(option: str) -> None:
    done = CliRunner().invoke(app, ["record", "start", option, "a.txt"])
    assert (done.exit_code, done.stderr.split(":")[1]) == (2, " --output a.txt")
    done = CliRunner().invoke(
        app, ["record", "export", "none.asc", "--mcap" if option == "--out" else option, "a.mcap"]
    )
    assert "none.asc" in done.stderr


@pytest.mark.parametrize("words", ["prove qualify", "prove evidence", "setup calibrate", "print urdf", "config check"])
def test_a_robot_yaml_is_named_once(words: str) -> None:
    done = CliRunner().invoke(app, [*words.split(), "a.yaml", "--config", "b.yaml"], env={"COLUMNS": "200"})
    assert done.exit_code == 2
    assert "give the robot.yaml once: --config FILE, or FILE alone" in done.stderr


def test_no_command_demands_a_robot_yaml_where_one_is_here() -> None:
    for words in leaves(typer.main.get_command(app)):
        command = typer.main.get_command(app)
        for word in words:
            command = command.commands[word]  # type: ignore[attr-defined]
        assert not [each for each in command.params if "--config" in each.opts and each.required], words


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("scna", "No such command 'scna'. Did you mean 'bus scan'?"),
        ("stopp", "Did you mean 'stop'"),
        ("xyzzy", "No such command 'xyzzy'."),
        ("bus dump stop.asc", "A recording: canbase explain stop.asc"),
    ],
)
def test_a_wrong_command_line_names_the_command_that_is_meant(words: str, told: str) -> None:
    done = CliRunner().invoke(app, words.split(), env={"COLUMNS": "200"})
    assert done.exit_code == 2
    assert told in done.stderr
