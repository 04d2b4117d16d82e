"""The page `Health`: the doctor, again and again while the page is open. It runs as a process of its own."""

from __future__ import annotations

import json
import time
from typing import Any, Final

from nicegui import Client, background_tasks, ui

from canbase_doctor.check import Verdict
from canbase_web.own_command import run
from canbase_web.pages import Pages, section

PERIOD_S: Final = 15.0
PATIENCE_S: Final = 60.0
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
        self._words = ("doctor", "--config", str(pages.loaded.path), "--no-bus", "--json", *namespace)
        self._runs = False
        self._next_s = 0.0
        self.checks: list[dict[str, Any]] = []
        self.said = "the doctor is at work"

    async def look(self) -> None:
        """Run it, unless its result is still new."""
        if self._runs or time.monotonic() < self._next_s:
            return
        self._runs = True
        try:
            code, out, error = await run(*self._words, patience_s=PATIENCE_S)
            self.checks = json.loads(out) if out else []
            gave_up = f"the doctor gave no answer within {PATIENCE_S:.0f} s"
            self.said = (
                f"looked at {time.strftime('%H:%M:%S')}" if self.checks else error if code is not None else gave_up
            )
        finally:
            self._runs, self._next_s = False, time.monotonic() + PERIOD_S


def add(pages: Pages) -> None:
    """The page at `/health`."""
    doctor = Doctor(pages)

    @ui.page("/health")
    async def health(client: Client) -> None:
        with pages.frame("/health"), section("The doctor: each check, and what to do next"):
            said = ui.label(doctor.said).props('role="status"')
            rows = ui.column().classes("w-full q-gutter-none")
        shown: list[dict[str, Any]] = []

        def again() -> None:
            nonlocal shown
            background_tasks.create(doctor.look(), name="doctor")  # for all browsers: it outlives this page
            said.text = doctor.said
            if shown is doctor.checks:
                return
            shown = doctor.checks
            rows.clear()
            with rows:
                for check in sorted(shown, key=lambda check: -_rank(check["verdict"])):
                    _row(check)

        await client.connected(timeout=30.0)
        ui.timer(1.0, again)


def _rank(verdict: str) -> int:
    return {"good": 0, "warn": 1, "bad": 2}[LEVELS[verdict][0]]


def _row(check: dict[str, Any]) -> None:
    level, word = LEVELS[check["verdict"]]
    with ui.row().classes("w-full no-wrap q-py-xs").style("border-bottom:1px solid rgba(128,128,128,.35)"):
        ui.label(word).props(f'data-level="{level}"').style("width:7rem;flex:none;font-weight:600")
        ui.label(check["name"]).style("width:14rem;flex:none;overflow-wrap:anywhere")
        with ui.column().classes("q-gutter-none"):
            ui.label(check["found"]).style("overflow-wrap:anywhere")
            if check["advice"]:
                ui.label(f"→ {check['advice']}").props(f'data-level="{level}"')
