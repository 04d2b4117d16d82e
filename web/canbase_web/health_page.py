"""The page `Health`: the doctor, again and again; each check is shown as soon as it is made.

It runs while the page is open, as a process of its own.
"""

from __future__ import annotations

import html
import json
import time
from typing import Any, Final

from nicegui import Client, background_tasks, ui

from canbase_doctor.check import Verdict
from canbase_web.own_command import run
from canbase_web.pages import Pages, section

PERIOD_S: Final = 15.0
PATIENCE_S: Final = 60.0
PERIOD_SHOWN_S: Final = 0.3
LEVELS: Final = {
    Verdict.OK.value.lower(): ("good", "✓ ok"),
    Verdict.WARN.value.lower(): ("warn", "! look"),
    Verdict.INCONCLUSIVE.value.lower(): ("warn", "? inconclusive"),
    Verdict.FAIL.value.lower(): ("bad", "✕ FAIL"),
}


class Doctor:
    """The newest result for all browsers; one process at a time."""

    def __init__(self, pages: Pages) -> None:
        namespace = ("--namespace", pages.namespace) if pages.namespace else ()
        self._words = ("doctor", "--config", str(pages.loaded.path), "--no-bus", "--stream", *namespace)
        self._runs = False
        self._next_s = 0.0
        self.checks: dict[str, dict[str, Any]] = {}
        """By name; a check that is being made anew keeps its last result until then."""
        self.said = "The checks of canbase doctor will be here: it looks at robot.yaml, then listens to the robot."

    async def look(self) -> None:
        """Run it, unless its result is still new."""
        if self._runs or time.monotonic() < self._next_s:
            return
        self._runs = True
        made: dict[str, dict[str, Any]] = {}

        def take(line: str) -> None:
            check = json.loads(line)
            made[check["name"]] = check
            self.checks = self.checks | made
            self.said = f"{len(made)} checks made; the doctor listens to the robot"

        try:
            code, _, error = await run(*self._words, patience_s=PATIENCE_S, on_line=take)
            self.checks = made
            gave_up = f"the doctor gave no answer within {PATIENCE_S:.0f} s"
            self.said = f"looked at {time.strftime('%H:%M:%S')}" if made else error if code is not None else gave_up
        finally:
            self._runs, self._next_s = False, time.monotonic() + PERIOD_S


def add(pages: Pages) -> None:
    """The page at `/health`."""
    doctor = Doctor(pages)

    @ui.page("/health")
    async def health(client: Client) -> None:
        with pages.frame("/health"), section("The doctor: each check, and what to do next"):
            said = ui.label(doctor.said).props('role="status"')
            rows = ui.html("", sanitize=False).classes("w-full")

        def again() -> None:
            background_tasks.create(doctor.look(), name="doctor")  # for all browsers: it outlives this page
            said.text = doctor.said
            worst_first = sorted(doctor.checks.values(), key=lambda check: -_rank(check["verdict"]))
            rows.set_content(f'<div class="checks">{"".join(map(_row, worst_first))}</div>')

        await client.connected(timeout=30.0)
        ui.timer(PERIOD_SHOWN_S, again)


def _rank(verdict: str) -> int:
    return {"good": 0, "warn": 1, "bad": 2}[LEVELS[verdict][0]]


def _row(check: dict[str, Any]) -> str:
    level, word = LEVELS[check["verdict"]]
    advice = f'<p class="advice" data-level="{level}">→ {html.escape(check["advice"])}</p>' if check["advice"] else ""
    return (
        f'<p class="level" data-level="{level}">{word}</p><p>{html.escape(check["name"])}</p>'
        f'<p class="found">{html.escape(check["found"])}</p>{advice}<hr>'
    )
