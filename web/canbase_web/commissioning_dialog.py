"""`canbase setup commission --json` and `canbase setup init --json` as a process, and the proof that somebody looks.

The process stops its wheels when it hears nothing for a second. It is told that the person is there only while a
browser shows the page: each number that is sent there has to come back soon.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from typing import Any, Final

from canbase_runtime.own_modules import module_command
from canbase_web.presence import Presence

ENDS_S: Final = 3.5
"""A process that was told to stop ends within this time: safe_stop.py takes 2.1 s, its report and its end the rest."""
MOST_LINES: Final = 500
LONGEST_LINE: Final = 8192


class CommissioningDialog:
    """One run at a time. `told`: its lines; `question`: the open one; `ended`: how it ended, empty while it runs."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._over = asyncio.Event()
        self._over.set()
        self._stops = False
        self._code: int | None = None
        self._presence = Presence()
        self.told: list[tuple[str, bool]] = []
        """Text, and whether it must not be overlooked."""
        self.question: dict[str, Any] | None = None
        self.again = ""
        """Why the last answer was not valid."""
        self.ended = "not begun"

    @property
    def runs(self) -> bool:
        """Whether a process lives, or is being started."""
        return not self._over.is_set()

    async def run(self, *words: str) -> None:
        """From the start of `canbase WORDS --json` to its end."""
        if self.runs:
            return
        self._over.clear()
        self._stops, self._code = False, None
        self.told, self.question, self.again, self.ended = [], None, "", ""
        try:
            await self._live(*words)
        finally:
            self.question = self._process = None
            self.ended = "finished" if self._code == 0 else f"ended with exit code {self._code}"
            self._over.set()

    async def _live(self, *words: str) -> None:
        self._process = process = await asyncio.create_subprocess_exec(
            *module_command("canbase_cli", *words, "--json"),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            limit=LONGEST_LINE,
        )
        assert process.stdout is not None
        if self._stops:  # meanwhile
            self.stop()
        is_read = False
        try:
            while line := await process.stdout.readline():
                self._take(line.decode(errors="replace").strip())
            is_read = True
        finally:
            if not is_read:  # a line without an end, or this page's server ends: then the wheels stop as well
                self._terminate()
            self._code = await process.wait()

    def proof(self, now_s: float) -> int:
        """A number for the browser."""
        return self._presence.number(now_s)

    def on_proof(self, number: object, now_s: float) -> None:
        """The number came back: the person is told to be there, once for each number."""
        if self._presence.on_number(number, now_s):
            self._say(alive=True)

    def answer(self, text: str) -> None:
        """To the open question."""
        if self.question is not None:
            self._say(answer=text[:200], key=self.question["ask"])
            self.again = ""

    def stop(self) -> None:
        """Everything, at once."""
        self._stops = True
        self._say(stop=True)

    async def end(self) -> tuple[bool, str]:
        """Stop everything, and wait for the end of the process: it takes the power off before. Whether it did, and the
        sentence."""
        self.stop()
        try:
            await asyncio.wait_for(self._over.wait(), ENDS_S)
        except asyncio.TimeoutError:
            self._terminate()
            return False, f"commissioning was told to stop, and has not ended within {ENDS_S:g} s: wheels may turn"
        if self._code is None or self._code < 0:
            return False, f"commissioning {self.ended} before it took the power off: wheels may turn"
        return True, "commissioning has ended: quick stop, then power off for every drive that it moved"

    def _terminate(self) -> None:
        """A process that moves wheels stops them first."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                self._process.terminate()

    def _say(self, **values: object) -> None:
        if self._process is not None and self._process.stdin is not None:
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
