"""The dialog of commissioning behind the page: what a browser that hangs or goes away proves, and what it does not."""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path
from typing import Any

import pytest

from canbase_web import commissioning_dialog
from canbase_web.commissioning_dialog import CommissioningDialog
from canbase_web.presence import PROOF_S

ECHO = """
import json, sys
print("a warning before it begins", flush=True)
print(json.dumps({"tell": "left_wheel turns now", "loud": False}), flush=True)
print(json.dumps({"ask": "direction.left_wheel", "text": "Which way?", "confirms": False, "default": None}), flush=True)
heard = [json.loads(sys.stdin.readline()) for _ in range(COUNT)]
print(json.dumps({"tell": json.dumps(heard), "loud": True}), flush=True)
sys.exit(CODE)
"""


def dialog_with(monkeypatch: pytest.MonkeyPatch, count: int, code: int = 0) -> CommissioningDialog:
    """Its process says two lines and asks, hears `count` lines, and tells them."""
    script = ECHO.replace("COUNT", str(count)).replace("CODE", str(code))
    monkeypatch.setattr(commissioning_dialog, "module_command", lambda *_: [sys.executable, "-c", script])
    return CommissioningDialog()


async def until_asked(dialog: CommissioningDialog) -> None:
    while dialog.question is None:
        await asyncio.sleep(0.01)


def heard(dialog: CommissioningDialog) -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = json.loads(dialog.told[-1][0])
    return lines


def test_what_the_page_does_reaches_the_process_and_its_end_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    dialog = dialog_with(monkeypatch, 3)

    async def story() -> None:
        run = asyncio.create_task(dialog.run("setup", "commission"))
        await until_asked(dialog)
        assert (dialog.runs, dialog.told[0][0]) == (True, "a warning before it begins")
        dialog.on_proof(dialog.proof(10.0), 10.0 + PROOF_S - 0.001)
        dialog.answer("forward")
        dialog.stop()
        await run

    asyncio.run(story())
    assert heard(dialog) == [{"alive": True}, {"answer": "forward", "key": "direction.left_wheel"}, {"stop": True}]
    assert (dialog.runs, dialog.ended, dialog.question) == (False, "finished", None)


def test_a_late_proof_a_second_one_and_one_that_was_never_asked_for_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    dialog = dialog_with(monkeypatch, 2)

    async def story() -> None:
        run = asyncio.create_task(dialog.run("setup", "commission"))
        await until_asked(dialog)
        late = dialog.proof(10.0)
        dialog.on_proof(late, 10.0 + PROOF_S + 0.001)
        number = dialog.proof(20.0)
        for each in (number, number, number + 1, 0, -1, "1", None, 1.0, [number]):
            dialog.on_proof(each, 20.1)
        dialog.stop()
        await run

    asyncio.run(story())
    assert heard(dialog) == [{"alive": True}, {"stop": True}]


def test_a_failure_has_its_exit_code_and_the_next_run_begins_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    dialog = dialog_with(monkeypatch, 0, code=1)
    for _ in range(2):
        asyncio.run(dialog.run("setup", "commission"))
        assert (dialog.ended, len(dialog.told)) == ("ended with exit code 1", 3)


def test_one_run_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    dialog = dialog_with(monkeypatch, 1)

    async def story() -> None:
        first = asyncio.create_task(dialog.run("setup", "commission"))
        await until_asked(dialog)
        await dialog.run("setup", "init")
        assert dialog.runs
        dialog.stop()
        await first

    asyncio.run(story())
    assert heard(dialog) == [{"stop": True}]


def test_two_fingers_on_begin_start_one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    dialog = dialog_with(monkeypatch, 1)
    started = []
    start = asyncio.create_subprocess_exec

    async def counted(*words: str, **options: Any) -> Any:
        started.append(words)
        return await start(*words, **options)

    monkeypatch.setattr(asyncio, "create_subprocess_exec", counted)

    async def story() -> None:
        both = asyncio.gather(dialog.run("setup", "commission"), dialog.run("setup", "commission"))
        await until_asked(dialog)
        dialog.stop()
        await both

    asyncio.run(story())
    assert len(started) == 1


def test_a_stop_while_the_process_is_being_started_reaches_it(monkeypatch: pytest.MonkeyPatch) -> None:
    dialog = dialog_with(monkeypatch, 1, code=1)

    async def story() -> tuple[bool, str]:
        run = asyncio.create_task(dialog.run("setup", "commission"))
        await asyncio.sleep(0)
        answer = await dialog.end()
        await run
        return answer

    done, said = asyncio.run(story())
    assert (done, said.startswith("commission"), heard(dialog)) == (True, True, [{"stop": True}])


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("import time; time.sleep(60)", "has not ended within"),
        ("import os, sys; sys.stdin.readline(); os.abort()", "before it took the power off"),
    ],
)
def test_a_process_that_does_not_obey_is_no_stop(monkeypatch: pytest.MonkeyPatch, script: str, said: str) -> None:
    monkeypatch.setattr(commissioning_dialog, "module_command", lambda *_: [sys.executable, "-c", script])
    monkeypatch.setattr(commissioning_dialog, "ENDS_S", 0.5 if "sleep" in script else 20.0)
    dialog = CommissioningDialog()

    async def story() -> tuple[bool, str]:
        run = asyncio.create_task(dialog.run("setup", "commission"))
        await asyncio.sleep(0)
        answer = await dialog.end()
        await run  # one that does not listen gets a signal
        return answer

    done, sentence = asyncio.run(story())
    assert not done
    assert said in sentence


def test_without_a_process_nothing_is_said() -> None:
    dialog = CommissioningDialog()
    dialog.stop()
    dialog.answer("yes")
    dialog.on_proof(dialog.proof(1.0), 1.0)
    assert (dialog.runs, dialog.ended) == (False, "not begun")


def test_the_real_command_refuses_a_robot_yaml_that_is_not_there_in_words(tmp_path: Path) -> None:
    dialog = CommissioningDialog()
    asyncio.run(dialog.run("setup", "commission", "--config", str(tmp_path / "none.yaml")))
    assert dialog.ended == "ended with exit code 2"
    assert any("canbase setup init writes a robot.yaml" in text for text, _ in dialog.told)
    assert dialog.told[-1][1], "what ended it is loud"


def test_a_line_without_an_end_ends_the_process_and_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    script = "import time; print('x' * 20_000, end='', flush=True); time.sleep(60)"
    monkeypatch.setattr(commissioning_dialog, "module_command", lambda *_: [sys.executable, "-c", script])
    dialog = CommissioningDialog()
    with pytest.raises(ValueError, match="limit"):
        asyncio.run(dialog.run("setup", "commission"))
    assert (dialog.runs, dialog.ended) == (False, "ended with exit code -15")
