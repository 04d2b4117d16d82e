"""The command line of `canbase record start`."""

from __future__ import annotations

from typer.testing import CliRunner

from canbase_cli.main import app


def test_a_recording_is_an_asc_file() -> None:
    done = CliRunner().invoke(app, ["record", "start", "--out", "a.txt"], env={"COLUMNS": "200"})
    assert (done.exit_code, "must end with .asc" in done.output) == (2, True)
