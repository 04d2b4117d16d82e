"""`canbase web` before it serves: addresses, tokens and ports that it refuses, in words."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_cli.web import _origin


def refused(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["web", *words])
    return result.exit_code, result.stderr


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_an_address_that_no_browser_can_open_is_refused(host: str) -> None:
    code, said = refused("--host", host)
    assert (code, "give that of one interface" in said) == (2, True)


@pytest.mark.parametrize("url", ["http://robot.example", "robot.example", "https://", "https://robot.example/canbase"])
def test_a_proxy_without_tls_or_with_a_path_is_refused(url: str) -> None:
    code, said = refused("--proxy", url)
    assert (code, "expected https://NAME" in said) == (2, True)


@pytest.mark.parametrize("url", ["https://Robot.example", "https://robot.example:443/"])
def test_a_proxy_has_the_name_that_a_browser_gives_it(url: str) -> None:
    assert _origin(url) == "https://robot.example"


@pytest.mark.parametrize(
    "token", ["", "short", "x" * 15, "with a space in it", "ümläute-sind-zu-viel", "line\nfeed-in-the-middle"]
)
def test_a_token_that_is_easy_to_guess_or_does_not_fit_an_address_is_refused(tmp_path: Path, token: str) -> None:
    file = tmp_path / "token"
    file.write_text(token, encoding="utf-8")
    file.chmod(0o600)
    code, said = refused("--token-file", str(file))
    assert (code, "at least 16 characters" in said) == (2, True)


@pytest.mark.parametrize("mode", [0o604, 0o640, 0o620, 0o602])
def test_a_token_file_that_others_may_read_or_write_is_refused(tmp_path: Path, mode: int) -> None:
    file = tmp_path / "token"
    file.write_text("x" * 24, encoding="utf-8")
    file.chmod(mode)
    code, said = refused("--token-file", str(file))
    assert (code, "may be read or written by other users: chmod 600" in said) == (2, True)


def test_a_token_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    code, said = refused("--token-file", str(tmp_path / "none"))
    assert (code, str(tmp_path / "none") in said) == (2, True)


def test_a_port_that_another_program_has_is_1_with_a_way_out() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        code, said = refused("--port", str(other.getsockname()[1]))
    assert (code, "give another --port" in said) == (1, True)


def test_without_nicegui_the_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("canbase_web.") or name == "nicegui"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "nicegui", None)
    code, said = refused()
    assert (code, "pip install 'nicegui>=3.18,<4'" in said) == (2, True)
