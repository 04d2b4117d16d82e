"""What all pages share: the frame with menu, robot and the large stop, and what they show it from."""

from __future__ import annotations

import asyncio
import html
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from nicegui import Client, ui

from canbase_config.derive import watchdog_config
from canbase_config.load import Loaded
from canbase_watchdog.envelope import Bounds, Envelope
from canbase_web.commissioning_dialog import ENDS_S, CommissioningDialog
from canbase_web.hold_socket import HoldSocket
from canbase_web.now_view import Robot
from canbase_web.presence import PERIOD_S, SEEN, Presence
from canbase_web.robot_link import RobotLink

MENU: Final = (
    ("/", "Now"),
    ("/drive", "Drive"),
    ("/commission", "Commission"),
    ("/stops", "Stops"),
    ("/health", "Health"),
)
NEXT_THEME: Final = {None: True, True: False, False: None}
"""By the one of now: as the computer has it, dark, light."""
STOP: Final = """
<form class="stop-form" method="post" action="/stop">
  <button type="submit" aria-label="Stop the robot: ramp, power off, latched until a reset">STOP</button>
</form>"""
STOP_SCRIPT: Final = """
document.addEventListener("submit", async event => {
  if (event.target.className !== "stop-form") return;
  event.preventDefault();
  const place = document.getElementById("stop-answer");
  if (place) place.textContent = "Stop: no answer yet";
  const patience = new AbortController(), timer = setTimeout(() => patience.abort(), 5000);  // both parts answer sooner
  let said;
  try {
    const answer = await fetch("/stop", {method: "POST", signal: patience.signal});
    said = new DOMParser().parseFromString(await answer.text(), "text/html").querySelector("p").textContent;
  } catch (error) {
    said = "The page does not reach canbase web: press the emergency stop at the robot.";
  }
  clearTimeout(timer);
  if (place) place.textContent = said; else alert(said);
});"""


class Pages:
    """Shared by the pages. `source`: the key of mux.sources that hold-to-drive publishes on; empty: there is none."""

    def __init__(self, loaded: Loaded, link: RobotLink, hold: HoldSocket, source: str, namespace: str) -> None:
        self.loaded, self.link, self.hold, self.source, self.namespace = loaded, link, hold, source, namespace
        self._envelope: Envelope | None = None
        self.commissioning = CommissioningDialog()
        """One run for all browsers."""
        self.watch = Presence()
        """Whether any browser shows any page: each has the stop."""

    def now(self) -> tuple[Robot, float, Bounds]:
        """The robot, the time, and what its leases allow: by the orders that the filter reports, as the watchdog
        works it out."""
        now_s = time.monotonic()
        robot = self.link.robot(now_s)
        if self._envelope is None:
            self._envelope = Envelope(watchdog_config(self.loaded.robot), now_s)
        if robot.ordered.age_s == 0.0:  # it came since the last look
            twist = robot.ordered.message.twist
            self._envelope.order(twist.linear.x, twist.angular.z, now_s)
        return robot, now_s, self._envelope.advance(now_s)

    @contextmanager
    def frame(self, path: str) -> Iterator[None]:
        """Menu above, large stop below, the page's own content between."""
        title = next(name for each, name in MENU if each == path)
        robot = self.loaded.robot.name + self.namespace
        ui.add_head_html('<link rel="stylesheet" href="/static/page.css">')
        ui.add_body_html(STOP)
        ui.add_body_html(f"<script>{STOP_SCRIPT}</script>")
        dark = ui.dark_mode(value=None)
        with ui.header().classes("items-center q-py-xs"):
            ui.label(f"canbase · {robot}").classes("text-subtitle1").props('role="heading" aria-level="1"')
            with ui.element("nav").props('aria-label="Pages"').classes("row"):
                for each, name in MENU:
                    here = ' aria-current="page"' if each == path else ""
                    ui.html(
                        f'<a href="{each}"{here} style="color:inherit;padding:.5rem .7rem">{name}</a>', sanitize=False
                    )
            ui.space()
            theme = ui.button(icon="contrast", on_click=lambda: dark.set_value(NEXT_THEME[dark.value]))
            theme.props('flat color=white aria-label="Light or dark"')
        ui.page_title(f"{title} · {robot}")
        with ui.column().classes("w-full q-pa-sm q-gutter-sm"):
            ui.html(
                '<p id="stop-answer" role="alert" data-level="bad" style="margin:0;font-weight:600"></p>',
                sanitize=False,
            )
            yield
        client = ui.context.client
        ui.on("canbase_seen", lambda event: self.watch.on_number(event.args, time.monotonic()))
        ui.timer(PERIOD_S, lambda: self._prove(client))

    def _prove(self, client: Client) -> None:
        if self.link.goals.runs:
            number = self.watch.number(time.monotonic())
            client.run_javascript(SEEN.format(event="canbase_seen", number=number))

    def drive(self, distance_m: float, speed_mps: float) -> None:
        """Send a goal, which is canceled when no browser shows a page any more: who sent it can then stop nothing."""
        self.watch.begin(time.monotonic())
        self.link.goals.start(distance_m, speed_mps, lambda: self.watch.is_lost(time.monotonic()))

    def stop_page(self, loop: asyncio.AbstractEventLoop) -> tuple[int, str]:
        """The large stop: status and page of its answer. `loop`: of the pages; this waits in another thread."""
        done, sentence = asyncio.run(self.stop(loop))
        said = f"Stop: {sentence}" if done else f"STOP FAILED: {sentence}. Press the emergency stop at the robot."
        return 200 if done else 503, (
            f'<!doctype html><html lang="en"><title>Stop</title><body style="font:1.3rem sans-serif">'
            f'<p>{html.escape(said)}</p><a href="/">back</a></body></html>'
        )

    async def stop(self, loop: asyncio.AbstractEventLoop) -> tuple[bool, str]:
        """Of every part that may move the wheels. Whether each of them stops, and what it said.

        Commissioning may be at work beside a driver: until it has heard it, and while it waits for an answer.
        """
        parts = [self._end_commissioning(loop)] if self.commissioning.runs else []
        if not parts or self.link.has_driver:
            parts.append(self.link.stop())
        answers = await asyncio.gather(*parts)
        return all(done for done, _ in answers), "; ".join(sentence for _, sentence in answers)

    async def _end_commissioning(self, loop: asyncio.AbstractEventLoop) -> tuple[bool, str]:
        ending = asyncio.run_coroutine_threadsafe(self.commissioning.end(), loop)
        try:
            return await asyncio.wait_for(asyncio.wrap_future(ending), 2 * ENDS_S)
        except asyncio.TimeoutError:
            return False, "the pages do not answer, and commissioning may be at work: wheels may turn"


def section(title: str) -> ui.card:
    """A card with a heading."""
    card = ui.card().classes("w-full")
    with card:
        ui.label(title).classes("text-subtitle2").props('role="heading" aria-level="2"')
    return card


def table(name: str, columns: tuple[str, ...]) -> None:
    """A table whose rows the page's script fills in."""
    cells = "".join(f'<th scope="col">{html.escape(column)}</th>' for column in columns)
    head = f"<thead><tr>{cells}</tr></thead>"
    ui.html(
        f'<div class="scroll"><table class="values" id="{name}">{head}<tbody></tbody></table></div>', sanitize=False
    ).classes("w-full")
