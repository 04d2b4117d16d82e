"""Commands as processes of their own: what they print, how they end, and that none outlives its time."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canbase_web import own_command


def ran(
    monkeypatch: pytest.MonkeyPatch, script: str, patience_s: float = 20.0, on_line: Callable[[str], Any] = len
) -> tuple[int | None, str, str]:
    monkeypatch.setattr(own_command, "module_command", lambda module, *words: [sys.executable, "-c", script, *words])
    return asyncio.run(own_command.run("reset", patience_s=patience_s, on_line=on_line))


@pytest.mark.parametrize("code", [0, 1, 6])
def test_exit_code_and_both_outputs_come_back_each_time(monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    script = f"import sys; print('done', sys.argv[1]); print('why', file=sys.stderr); sys.exit({code})"
    for _ in range(5):
        assert ran(monkeypatch, script) == (code, "done reset\n", "why\n")


def test_a_command_that_takes_too_long_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert ran(monkeypatch, "import time; time.sleep(60)", 0.2) == (None, "", "")


def test_each_line_is_passed_on_before_the_command_ends(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    told = tmp_path / "told"
    script = (
        f"import os, time; print('one', flush=True)\nwhile not os.path.exists({str(told)!r}): time.sleep(0.01)\n"
        "print('two')"
    )
    assert ran(monkeypatch, script, on_line=lambda line: told.touch()) == (0, "one\ntwo\n", "")


def test_a_line_that_cannot_be_used_ends_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    script = "import os, time; print(os.getpid(), flush=True); time.sleep(60)"
    pids: list[int] = []

    def refuse(line: str) -> None:
        pids.append(int(line))
        raise ValueError(line)

    with pytest.raises(ValueError, match=r"\d"):
        ran(monkeypatch, script, on_line=refuse)
    with pytest.raises(ProcessLookupError):
        os.kill(pids[0], 0)


def test_the_real_command_says_what_is_wrong() -> None:
    code, _, said = asyncio.run(own_command.run("print", "sample", "none", patience_s=30.0))
    assert (code, "none" in said) == (2, True)
