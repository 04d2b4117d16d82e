"""Commands as processes of their own: what they print, how they end, and that none outlives its time."""

from __future__ import annotations

import asyncio
import sys

import pytest

from canbase_web import own_command


def ran(monkeypatch: pytest.MonkeyPatch, script: str, patience_s: float = 20.0) -> tuple[int | None, str, str]:
    monkeypatch.setattr(own_command, "module_command", lambda module, *words: [sys.executable, "-c", script, *words])
    return asyncio.run(own_command.run("reset", patience_s=patience_s))


@pytest.mark.parametrize("code", [0, 1, 6])
def test_exit_code_and_both_outputs_come_back_each_time(monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    script = f"import sys; print('done', sys.argv[1]); print('why', file=sys.stderr); sys.exit({code})"
    for _ in range(5):
        assert ran(monkeypatch, script) == (code, "done reset\n", "why\n")


def test_a_command_that_takes_too_long_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert ran(monkeypatch, "import time; time.sleep(60)", 0.2) == (None, "", "")


def test_the_real_command_says_what_is_wrong() -> None:
    code, _, said = asyncio.run(own_command.run("print", "sample", "none", patience_s=30.0))
    assert (code, "none" in said) == (2, True)
