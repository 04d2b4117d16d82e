"""The page of all `canbase` commands: the help text of each, as Typer itself writes it in Markdown."""

from __future__ import annotations

import typer
from typer.cli import get_docs_for_click
from typer.main import get_command

from canbase_cli.main import app

_HEAD = """\
# Commands

The help text of every command, written from the commands themselves. `canbase COMMAND --help` prints the same.

"""


def page() -> str:
    """The whole page in Markdown."""
    command = get_command(app)
    text = get_docs_for_click(obj=command, ctx=typer.Context(command, info_name="canbase"), name="canbase")
    return _HEAD + text.replace("# `canbase`\n\n", "", 1)
