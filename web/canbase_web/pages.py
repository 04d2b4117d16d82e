"""What all pages share: the frame with menu, robot and the large stop, and what they show it from."""

from __future__ import annotations

import asyncio
import html
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Final

from nicegui import Client, ui

from canbase_config.derive import watchdog_config
from canbase_config.load import Loaded
from canbase_watchdog.envelope import Bounds, Envelope
from canbase_web.commissioning_dialog import ENDS_S, CommissioningDialog
from canbase_web.feed import Feed
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
HEADER: Final = """
<div class="top"><h1>{robot} · {title}</h1><nav aria-label="Pages">{links}</nav>
<div id="state" role="status">…</div><a id="to-reset" href="/drive#reset" hidden>Reset</a>
<button id="theme" type="button" aria-label="Light or dark" title="as the computer, dark, light">◐</button></div>"""
STOP: Final = """
<form class="stop-form" method="post" action="/stop">
  <p id="stop-answer" role="alert"></p>
  <button type="submit" aria-label="Stop the robot: ramp, power off, latched until a reset">STOP</button>
</form>"""
"""The first of the page, and none of NiceGUI's: it works without its script."""


class Pages:
    """Shared by the pages. `source`: the key of mux.sources that hold-to-drive publishes on; empty: there is none."""

    def __init__(self, loaded: Loaded, link: RobotLink, hold: HoldSocket, source: str, namespace: str) -> None:
        self.loaded, self.link, self.hold, self.source, self.namespace = loaded, link, hold, source, namespace
        self._envelope: Envelope | None = None
        self.commissioning = CommissioningDialog()
        """One run for all browsers."""
        self.feed = Feed(self)
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
    def frame(self, path: str) -> Iterator[dict[str, str]]:
        """Robot, menu and state above, large stop below, the page's own content between. It may fill in the plots that
        the feed gives numbers to."""
        client, plots = ui.context.client, dict[str, str]()
        title = next(name for each, name in MENU if each == path)
        robot = self.loaded.robot.name + self.namespace
        ui.add_head_html('<link rel="stylesheet" href="/static/page.css"><script src="/static/page.js"></script>')
        ui.add_body_html(STOP)
        here = {path: ' aria-current="page"'}
        links = "".join(f'<a href="{each}"{here.get(each, "")}>{name}</a>' for each, name in MENU)
        with ui.header():
            header = HEADER.format(robot=html.escape(robot), title=title, links=links)
            ui.html(header, sanitize=False).classes("w-full")
        ui.page_title(f"{title} · {robot}")
        with ui.column().classes("w-full q-gutter-sm"):
            yield plots
        client.on_disconnect(lambda: self.feed.leave(client))
        client.on_connect(lambda: self.feed.join(client, plots))
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
        ui.html(f"<h2>{html.escape(title)}</h2>", sanitize=False)
    return card


def table(name: str, columns: tuple[str, ...], empty: str) -> None:
    """A table whose rows the page's script fills in. `empty`: what will be there."""
    cells = "".join(f'<th scope="col">{html.escape(column)}</th>' for column in columns)
    ui.html(
        f'<table class="values" id="{name}" hidden><thead><tr>{cells}</tr></thead><tbody></tbody></table>'
        f'<p id="{name}-empty">{html.escape(empty)}</p>', sanitize=False,
    ).classes("w-full")  # fmt: skip


def legend(lines: Iterable[tuple[str, str, bool]]) -> str:
    """What the lines of a plot are: name, colour, and whether it is dashed. Beside the plot, where it has room."""
    items = (
        f'<li><i style="border-color:{colour};border-top-style:{"dashed" if dashed else "solid"}"></i>'
        f"{html.escape(name)}</li>"
        for name, colour, dashed in lines
    )
    return f'<ul class="legend">{"".join(items)}</ul>'
