"""The page `Commission`: the questions of `canbase setup commission` and `setup init`, with the wheels drawn."""

from __future__ import annotations

import html
import time
from pathlib import Path
from typing import Any, Final

from nicegui import Client, ui
from nicegui.events import GenericEventArguments

from canbase_config.robot import Robot
from canbase_web.floor_view import outlines
from canbase_web.pages import Pages, section
from canbase_web.presence import PERIOD_S, SEEN

STEPS: Final = {"directions": "directions", "scale": "scale", "proof": "self-stop", "floor": "radius and track"}
BEFORE: Final = (
    "Wheels up: all wheels off the floor, nothing near them, the emergency stop (STO) within reach and tried. "
    "End canbase up or the services first: a bus has one master. The wheels stop when you press Stop here, "
    "and within two seconds after you close or leave this page."
)
CHOICES: Final = {"direction.": ("forward", "backward", "nothing", "other")}
"""Buttons for questions whose key begins so."""


def add(pages: Pages) -> None:
    """The page at `/commission`; all browsers show the same run."""

    @ui.page("/commission")
    async def commission(client: Client) -> None:
        with pages.frame("/commission"):
            _View(pages, client)


class _View:
    """The page in one browser."""

    def __init__(self, pages: Pages, client: Client) -> None:
        self._pages, self._dialog, self._client = pages, pages.commissioning, client
        self._lines_shown: object = None
        self._key_shown: str | None = None
        self._leads = False
        """This browser has begun the run: it alone proves that somebody is there, and answers. Others may stop it."""
        self._before()
        self._question()
        with section("Messages"):
            self._lines = ui.column().classes("w-full q-gutter-none")
        ui.on("canbase_proof", self._on_proof)
        self._refresh()
        ui.timer(PERIOD_S, self._refresh)
        ui.timer(PERIOD_S, self._prove)

    def _before(self) -> None:
        with section("Before"):
            ui.label(BEFORE).style("max-width:60rem")
            self._unlocked = ui.switch("unlocked: I stand beside the robot, and its wheels are up")
            with ui.row().classes("items-center"):
                self._steps = {step: ui.checkbox(name, value=step != "floor") for step, name in STEPS.items()}
            self._begin = ui.button("Begin", on_click=self._start)
            with ui.row().classes("items-end"):
                self._output = ui.input("New file", value="robot_new.yaml")
                self._init = ui.button("Write a robot.yaml from the drives on this bus", on_click=self._write)
                self._init.props("outline")

    def _question(self) -> None:
        with section("Now"):
            self._drawing = ui.html(_wheels(self._pages.loaded.robot, ""), sanitize=False).classes("w-full")
            self._said = ui.label("").props('role="status"').style("font-size:1.2rem;font-weight:600")
            self._wrong = ui.label("").props('role="alert" data-level="bad"')
            with ui.row().classes("items-end") as self._answers:
                self._text = ui.input("Answer").props("autofocus")
                self._text.on("keydown.enter", self._answer)
                ui.button("Answer", on_click=self._answer)
                self._choices = ui.row()
            self._stop = ui.button("Stop", on_click=self._dialog.stop).props("color=negative")

    def _refresh(self) -> None:
        dialog, question = self._dialog, self._dialog.question
        self._begin.set_enabled(bool(self._unlocked.value) and not dialog.runs)
        self._init.set_enabled(bool(self._unlocked.value) and not dialog.runs)
        self._stop.set_enabled(dialog.runs)
        self._answers.set_visibility(question is not None and self._leads)
        said = question["text"] if question else "at work" if dialog.runs else dialog.ended
        self._said.set_text(f"{said}{self._other}")
        self._wrong.set_text(dialog.again)
        if dialog.told is not self._lines_shown:
            self._lines_shown = dialog.told
            self._show_lines()
        key = question["ask"] if question else ""
        if key != self._key_shown:
            self._key_shown = key
            self._drawing.set_content(_wheels(self._pages.loaded.robot, key))
            self._text.set_value(question["default"] or "" if question else "")
            self._choose(question)

    def _show_lines(self) -> None:
        self._lines.clear()
        with self._lines:
            for line, loud in self._dialog.told:
                ui.label(line).props('data-level="bad"' if loud else "").style("overflow-wrap:anywhere")

    def _choose(self, question: dict[str, Any] | None) -> None:
        """Buttons for the answers that there are, where these are known."""
        self._choices.clear()
        if question is None:
            return
        known = [words for start, words in CHOICES.items() if question["ask"].startswith(start)]
        with self._choices:
            for word in known[0] if known else ("yes", "no") if question["confirms"] else ():
                ui.button(word, on_click=lambda word=word: self._answer_with(word)).props("outline")

    @property
    def _other(self) -> str:
        return " (in another browser, which has begun this)" if self._dialog.runs and not self._leads else ""

    def _answer(self) -> None:
        self._answer_with(str(self._text.value or ""))

    def _answer_with(self, words: str) -> None:
        if self._leads:
            self._dialog.answer(words)

    async def _run(self, *words: str) -> None:
        if self._dialog.runs:
            return
        self._leads = True
        try:
            await self._dialog.run(*words)
        finally:
            self._leads = False

    async def _start(self) -> None:
        steps = ",".join(step for step, box in self._steps.items() if box.value)
        if steps and self._unlocked.value:
            await self._run("setup", "commission", "--config", str(self._pages.loaded.path), "--steps", steps)

    async def _write(self) -> None:
        if not self._unlocked.value:
            return
        here = self._pages.loaded.path
        file = here.parent / Path(str(self._output.value)).name
        await self._run("setup", "init", "--config", str(here), "--output", str(file))

    def _on_proof(self, event: GenericEventArguments) -> None:
        if self._leads:
            self._dialog.on_proof(event.args, time.monotonic())

    def _prove(self) -> None:
        """The browser sends the number back, unless nobody looks at the page."""
        if self._leads:
            number = self._dialog.proof(time.monotonic())
            self._client.run_javascript(SEEN.format(event="canbase_proof", number=number))


def _wheels(robot: Robot, key: str) -> str:
    """The base from above; the wheel that the question is about is filled."""
    front, rear, left, right = outlines(robot)["footprint"]
    parts = [f'<rect class="footprint" x="{-left}" y="{-front}" width="{left + right}" height="{front + rear}"/>']
    for side, sign in (("left", -1), ("right", 1)):
        drives = [drive for drive in robot.drives if drive.side == side]
        for i, drive in enumerate(drives):
            y = (i - (len(drives) - 1) / 2.0) * 2.5 * robot.base.wheel_radius_m
            x = sign * robot.base.track_m / 2.0
            asked = drive.joint in key.split(".")
            parts.append(
                f'<line x1="{x}" x2="{x}" y1="{y - robot.base.wheel_radius_m}" y2="{y + robot.base.wheel_radius_m}" '
                f'stroke="{"#2da44e" if asked else "currentColor"}" stroke-width="{0.12 if asked else 0.07}"/>'
                f'<text x="{x + sign * 0.1}" y="{y}" font-size=".09" fill="currentColor" '
                f'text-anchor="{"start" if sign > 0 else "end"}">{html.escape(drive.joint)}</text>'
            )
    reach_m = max(front, rear, left, right) + 0.7
    label = f"The base from above, forward is up; asked about: {key or 'nothing'}"
    return (
        f'<svg class="floor" style="max-width:18rem" role="img" aria-label="{html.escape(label)}" '
        f'viewBox="{-reach_m} {-reach_m} {2 * reach_m} {2 * reach_m}">{"".join(parts)}</svg>'
    )
