"""Names and texts of others control no terminal, whichever command prints them."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from canbase_cli import explain
from canbase_cli.main import app
from canbase_config.load import sample
from canbase_runtime import terminal

ROOT = Path(__file__).parents[3]
RECORDING = ROOT / "virtual_bus_tests/unit/recording/data/cable_of_left_wheel_cut.asc"
EDS = ROOT / "can_config/canbase_config/eds/canbase_cia402.eds"
ATTACK = "\x1b]0;pwned\x07\x1b[2J\x9b2J\u202e"
"""Names the terminal, clears it, and turns the direction of writing."""


@pytest.mark.parametrize(
    ("text", "plain", "with_cursor"),
    [
        ("größer 가 🛞\t|\n", "größer 가 🛞\t|\n", "größer 가 🛞\t|\n"),
        ("\x1b[1;31mred\x1b[0m", "\x1b[1;31mred\x1b[0m", "\x1b[1;31mred\x1b[0m"),
        ("\r\x1b[2K\x1b[1A", "\\u000d\\u001b[2K\\u001b[1A", "\r\x1b[2K\x1b[1A"),
        ("\x1b[?1049h\x1b[?25l", "\\u001b[?1049h\\u001b[?25l", "\x1b[?1049h\x1b[?25l"),
        ("\x1b]52;c;aGk=\x07", "\\u001b]52;c;aGk=\\u0007", "\\u001b]52;c;aGk=\\u0007"),
        ("\x1b[6n\x1bc", "\\u001b[6n\\u001bc", "\\u001b[6n\\u001bc"),
        ("\x9b2J\x7f\x00", "\\u009b2J\\u007f\\u0000", "\\u009b2J\\u007f\\u0000"),
        ("\u202eab\u2066\u2028", "\\u202eab\\u2066\\u2028", "\\u202eab\\u2066\\u2028"),
        ("\udc1b", "\\udc1b", "\\udc1b"),  # a byte of a file's name that is no UTF-8
    ],
)
def test_of_control_characters_only_those_of_canbase_pass(
    monkeypatch: pytest.MonkeyPatch, text: str, plain: str, with_cursor: str
) -> None:
    for stream, expected in ((lambda: sys.stdout, plain), (lambda: terminal.with_cursor(sys.stdout), with_cursor)):
        written = io.BytesIO()
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, "utf-8"))
        monkeypatch.setattr(sys, "stderr", None)  # closed by whoever started the process
        terminal.filter_output()
        assert stream().write(text) == len(text)
        stream().flush()
        assert written.getvalue().decode() == expected
        assert sys.stderr is None
    assert json.loads(f'"{plain}"'.replace("\t", "").replace("\n", "").replace("\x1b", ""))


def test_what_is_unbuffered_stays_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """PYTHONUNBUFFERED=1 of the services: a line is in the journal at once."""
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, "utf-8", write_through=True))
    monkeypatch.setattr(sys, "stderr", unfiltered := io.StringIO())
    terminal.filter_output()
    print("at once")
    assert written.getvalue() == b"at once\n"
    assert terminal.with_cursor(unfiltered) is unfiltered


def test_the_progress_of_a_long_recording_shows_no_name_of_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its stream lets the cursor move."""
    file = tmp_path / "a\x1b[2Jb.log"
    file.touch()
    monkeypatch.setattr(explain, "LARGE_BYTES", 0)
    monkeypatch.setattr(sys, "stderr", shown := io.StringIO())
    monkeypatch.setattr(shown, "isatty", lambda: True, raising=False)
    with explain._progress(file) as progress:
        assert progress is not None
        progress(1, 2)
    assert "reading the recording" in shown.getvalue()
    assert "\x1b[2J" not in shown.getvalue()


PROGRAM = """
import json, sys
from canbase_cli.main import app
from canbase_runtime.terminal import filter_output
filter_output()
for words in json.loads(sys.stdin.read()):
    print(words[0], flush=True)
    try:
        app(words[1:])
    except SystemExit as ended:
        print("\\nexit", ended.code)
    sys.stdout.flush()
    sys.stderr.flush()
"""


def _with_a_file_of_that_name(command: Any, name: str, *words: str) -> Iterator[list[str]]:
    """Each command that reads robot.yaml or another file, with one that is not there."""
    for word, each in getattr(command, "commands", {}).items():
        yield from _with_a_file_of_that_name(each, name, *words, word)
    for each in command.params:
        is_option = each.param_type_name == "option"
        if "--config" in each.opts or ("FILE" in str(each.metavar) and not is_option):
            yield [*words, *(["--config"] if is_option else []), name]
            break


@pytest.mark.timeout(300)
def test_no_command_prints_what_controls_the_terminal(tmp_path: Path) -> None:
    robot = sample("bench").read_text(encoding="utf-8")
    eds = EDS.read_text(encoding="latin-1").replace("ProductName=", f"ProductName={ATTACK}")
    files = {
        "robot.yaml": robot.replace("name: ", "name: " + json.dumps(ATTACK) + " #", 1),
        "drive.eds": eds,
        "stop.asc": RECORDING.read_text(encoding="utf-8").replace("drive silent (", f"drive silent ({ATTACK}"),
        "text.asc": ATTACK,
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    lines = [
        ["config", "check", str(tmp_path / "robot.yaml")],
        ["config", "from-eds", str(tmp_path / "drive.eds")],
        ["explain", str(tmp_path / "stop.asc")],
        ["explain", "--json", str(tmp_path / "stop.asc")],
        ["explain", str(tmp_path / "text.asc")],
        ["replay", str(tmp_path / "stop.asc")],
        ["sdo", "read", ATTACK],
        [ATTACK],
        *_with_a_file_of_that_name(typer.main.get_command(app), f"x{ATTACK}"),
    ]
    numbered = [[f"--- {number} ---", *line] for number, line in enumerate(lines)]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=json.dumps(numbered).encode(), stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, timeout=290, check=False, cwd=tmp_path,
    )  # fmt: skip
    said = done.stdout.decode()
    parts = [said.partition(f"--- {number} ---")[2].partition("---")[0] for number in range(len(lines))]
    showed = {tuple(line[:2]) for line, part in zip(lines, parts, strict=True) if "pwned" in part}
    assert len(showed) > 30  # the others end before they print it
    assert [each for each in ("\x1b]", "\x07", "\x1b[2J", "\x9b", "\u202e", "Traceback") if each in said] == []
    assert json.loads(parts[3].partition("{")[2].rpartition("}")[0].join("{}"))


def test_no_command_prints_past_the_filter() -> None:
    """`remote_operator` writes JSON, for a program."""
    past = re.compile(r"sys\.__std|std(out|err)\.buffer|os\.write\((1|2|sys\.std)")
    packages = [each.parent for each in ROOT.glob("*/canbase_*/__init__.py")]
    files = [file for package in packages for file in package.rglob("*.py")]
    found = {file.name for file in files if past.search(file.read_text(encoding="utf-8"))}
    assert len(files) > 400
    assert found == {"remote_operator.py"}
