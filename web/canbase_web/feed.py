"""What the robot does, for all browsers: its state in the header of every page, its numbers on the page `Now`."""

from __future__ import annotations

import asyncio
import json
from typing import TYPE_CHECKING, Any, Final

from nicegui import Client, background_tasks

from canbase_web.floor_view import points
from canbase_web.now_view import Robot, fast_values, header_values, slow_values

if TYPE_CHECKING:
    from canbase_web.pages import Pages

PERIOD_S: Final = 0.05
WORDS_EVERY: Final = 4
"""Words change with every fourth set of numbers."""


class Feed:
    """It runs as long as a browser shows a page."""

    def __init__(self, pages: Pages) -> None:
        self._pages = pages
        self._plots: dict[Client, dict[str, str]] = {}
        self._runs = False

    def join(self, client: Client, plots: dict[str, str]) -> None:
        """From now on; again after the browser was away. `plots`: their ids; a page without them shows words alone."""
        self._plots[client] = plots
        if not self._runs:
            background_tasks.create(self._run(), name="feed of the pages")

    def leave(self, client: Client) -> None:
        """No longer."""
        self._plots.pop(client, None)

    async def _run(self) -> None:
        self._runs = True
        try:
            turn = 0
            while self._plots:
                self._send(with_words=turn % WORDS_EVERY == 0)
                turn += 1
                await asyncio.sleep(PERIOD_S)
        finally:
            self._runs = False

    def _send(self, *, with_words: bool) -> None:
        robot, numbers = self._numbers()  # in each turn, or what was received counts as old (ReceiveTimes)
        readers = {client: plots for client, plots in self._plots.items() if plots}
        if not readers and not with_words:
            return
        state = f"canbasePage.state({json.dumps(header_values(robot))});" if with_words else ""
        data = json.dumps(numbers | (self._words(robot) if with_words else {})) if readers else ""
        for client in tuple(self._plots):
            plots = readers.get(client)
            client.run_javascript(f"{state}canbaseNow.update({json.dumps(plots)}, {data})" if plots else state)

    def _numbers(self) -> tuple[Robot, dict[str, Any]]:
        robot, now_s, bounds = self._pages.now()
        given = (bounds.linear_low, bounds.linear_high, bounds.angular_low, bounds.angular_high)
        return robot, {"numbers": fast_values(robot, now_s, given)}

    def _words(self, robot: Robot) -> dict[str, Any]:
        scans = zip(self._pages.loaded.robot.safety.scans, self._pages.link.scans(), strict=True)
        seen = [place for scanner, message in scans if message is not None for place in points(scanner, message)]
        return {"words": slow_values(robot)} | ({"scan": seen} if seen else {})
