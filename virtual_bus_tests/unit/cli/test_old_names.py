"""Every command of version 0.1 works by its old name too, and says the new one."""

from __future__ import annotations

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
def test_an_old_name_is_said_to_be_one_and_works(old: str) -> None:
    found = CliRunner().invoke(app, [old, "--help"])
    new = " ".join(NEW[old])
    assert (found.exit_code, found.stderr) == (0, f"canbase {old} is now: canbase {new}\n")
    assert f"Usage: canbase {new}" in " ".join(found.stdout.split())


def test_record_was_a_command_and_is_a_group() -> None:
    assert renamed(["record", "--seconds", "5"]) == ["record", "start", "--seconds", "5"]
    for words in (["record"], ["record", "--help"], ["record", "start"], ["record", "replay", "stop.asc"]):
        assert renamed(words) is None


def test_new_names_and_unknown_ones_stay() -> None:
    assert renamed(["bus", "scan"]) is None
    assert renamed(["docter"]) is None
    assert renamed([]) is None
