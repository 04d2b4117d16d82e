"""`canbase commission --json` and `canbase init --json` as a process, and the proof that somebody looks.

The process stops its wheels when it hears nothing for a second. It is told that the person is there only while a
browser shows the page: each number that is sent there has to come back soon.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from typing import Any, Final

from canbase_runtime.own_modules import module_command

PROOF_S: Final = 0.8
"""A number that comes back later proves nothing."""
MOST_LINES: Final = 500
LONGEST_LINE: Final = 8192


class CommissioningDialog:
    """One run at a time. `told`: its lines; `question`: the open one; `ended`: how it ended, empty while it runs."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._sent: dict[int, float] = {}
        self._number = 0
        self.told: list[tuple[str, bool]] = []
        """Text, and whether it must not be overlooked."""
        self.question: dict[str, Any] | None = None
        self.again = ""
        """Why the last answer was not valid."""
        self.ended = "not begun"

    @property
    def runs(self) -> bool:
        """Whether the process lives."""
        return self._process is not None and self._process.returncode is None

    async def run(self, *words: str) -> None:
        """From the start of `canbase WORDS --json` to its end."""
        if self.runs:
            return
        self.told, self.question, self.again, self.ended = [], None, "", ""
        self._process = process = await asyncio.create_subprocess_exec(
            *module_command("canbase_cli", *words, "--json"),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            limit=LONGEST_LINE,
        )
        assert process.stdout is not None
        is_read = False
        try:
            while line := await process.stdout.readline():
                self._take(line.decode(errors="replace").strip())
            is_read = True
        finally:
            if not is_read:  # a line without an end, or this page's server ends: then the wheels stop as well
                process.terminate()
            code = await process.wait()
            self.question = None
            self.ended = "finished" if code == 0 else f"ended with exit code {code}"

    def proof(self, now_s: float) -> int:
        """A number for the browser."""
        self._number += 1
        self._sent = {each: at_s for each, at_s in self._sent.items() if at_s > now_s - PROOF_S} | {self._number: now_s}
        return self._number

    def on_proof(self, number: object, now_s: float) -> None:
        """The number came back: the person is told to be there, once for each number."""
        sent_s = self._sent.pop(number, None) if isinstance(number, int) else None
        if sent_s is not None and now_s - sent_s <= PROOF_S:
            self._say(alive=True)

    def answer(self, text: str) -> None:
        """To the open question."""
        if self.question is not None:
            self._say(answer=text[:200], key=self.question["ask"])
            self.again = ""

    def stop(self) -> None:
        """Everything, at once."""
        self._say(stop=True)

    def _say(self, **values: object) -> None:
        if self.runs and self._process is not None and self._process.stdin is not None:
            with contextlib.suppress(OSError, RuntimeError):  # it is ending
                self._process.stdin.write(json.dumps(values).encode() + b"\n")

    def _take(self, line: str) -> None:
        """A line that is no JSON is what the command says to a person."""
        try:
            said = json.loads(line)
        except ValueError:
            said = {"tell": line, "loud": line.startswith("canbase:")} if line else {}
        if not isinstance(said, dict):
            return
        if "ask" in said:
            self.question = said
        elif "again" in said:
            self.again = str(said["reason"])
        elif "tell" in said:
            self.question = None
            self.told = [*self.told[1 - MOST_LINES :], (str(said["tell"]), bool(said["loud"]))]
