"""The page `Now`: who drives, what stops, speeds, the robot from above, its drives. Its numbers: now_view.py."""

from __future__ import annotations

import asyncio
import html
import json
from typing import Any, Final

from nicegui import Client, background_tasks, ui

from canbase_config.bus_load import cyclic_load
from canbase_web.floor_view import outlines, points
from canbase_web.now_view import fast_values, slow_values
from canbase_web.pages import Pages, section, table

PERIOD_S: Final = 0.05
WORDS_EVERY: Final = 4
"""Words change with every fourth set of numbers."""
PARTS: Final = ("source", "velocity_mux", "safety_filter", "motor_driver", "watchdog", "drives")
COLOURS: Final = ("#4e98e2", "#a371f7", "#2da44e", "#8a8a8a", "#8a8a8a", "#d4a72c", "#cf222e", "#1b7c83")
DRIVE_COLUMNS: Final = (
    "wheel", "state", "target", "measured", "current", "torque", "voltage", "temperature", "data age", "trouble",
)  # fmt: skip


def add(pages: Pages) -> None:
    """The page at `/`."""
    feed = _Feed(pages)

    @ui.page("/")
    async def now(client: Client) -> None:
        ui.add_head_html('<script src="/static/now.js"></script>')
        with pages.frame("/"):
            plots = _content(pages)
        client.on_disconnect(lambda: feed.leave(client))
        client.on_connect(lambda: feed.join(client, plots))


class _Feed:
    """Sends what the robot does to all browsers that show the page, as long as there is one."""

    def __init__(self, pages: Pages) -> None:
        self._pages = pages
        self._plots: dict[Client, dict[str, str]] = {}
        self._runs = False

    def join(self, client: Client, plots: dict[str, str]) -> None:
        """From now on; again after the browser was away."""
        self._plots[client] = plots
        if not self._runs:
            background_tasks.create(self._run(), name="page Now")

    def leave(self, client: Client) -> None:
        """No longer."""
        self._plots.pop(client, None)

    async def _run(self) -> None:
        self._runs = True
        try:
            turn = 0
            while self._plots:
                text = json.dumps(self._data(with_words=turn % WORDS_EVERY == 0))
                for client, plots in tuple(self._plots.items()):
                    client.run_javascript(f"canbaseNow.update({json.dumps(plots)}, {text})")
                turn += 1
                await asyncio.sleep(PERIOD_S)
        finally:
            self._runs = False

    def _data(self, *, with_words: bool) -> dict[str, Any]:
        robot, now_s, bounds = self._pages.now()
        given = (bounds.linear_low, bounds.linear_high, bounds.angular_low, bounds.angular_high)
        data: dict[str, Any] = {"numbers": fast_values(robot, now_s, given)}
        if not with_words:
            return data
        scans = zip(self._pages.loaded.robot.safety.scans, self._pages.link.scans(), strict=True)
        seen = [place for scanner, message in scans if message is not None for place in points(scanner, message)]
        return data | {"words": slow_values(robot)} | ({"scan": seen} if seen else {})


def _content(pages: Pages) -> dict[str, str]:
    """The elements; the ids of the plots."""
    robot = pages.loaded.robot
    ui.html('<div id="headline" role="status" aria-live="polite">…</div>', sanitize=False).classes("w-full")
    items = "".join(
        f'<li id="part-{i}"><b><span id="part-{i}-mark" aria-hidden="true"></span> {part}</b>'
        f'<span class="text" id="part-{i}-text"></span></li>'
        for i, part in enumerate(PARTS)
    )
    with section("The path of a command"):
        ui.html(f'<ol class="chain">{items}</ol>', sanitize=False).classes("w-full")
    names = ("selected", "filtered", "measured", "least allowed", "most allowed")
    wheels = tuple(f"{drive.joint} {what}" for drive in robot.drives for what in ("target", "measured"))
    with ui.element("div").classes("plots"):
        plots = {
            "linear": _plot("Forward speed [m/s]", names, robot.limits.linear_mps),
            "angular": _plot("Turning speed [rad/s]", names, robot.limits.angular_radps),
            "wheels": _plot("Wheels [rad/s]", wheels, robot.limits.linear_mps / robot.base.wheel_radius_m),
        }
        with section("From above"):
            ui.html(_floor(pages), sanitize=False).classes("w-full")
            ui.html('<span id="free"></span>', sanitize=False)
    with section("Who may drive"):
        table("sources", ("priority", "source", "age", "why not"))
    with section("Drives"):
        table("drives", DRIVE_COLUMNS)
        share = cyclic_load(robot)
        planned = "simulated, without a bit rate" if robot.bus.is_virtual else f"{share:.0%} planned load"
        ui.html(f'Bus {html.escape(robot.bus.channel)}: {planned}; <span id="bus"></span>', sanitize=False)
    return plots


def _plot(title: str, names: tuple[str, ...], greatest: float) -> str:
    """A live plot; its lines get their data from the page's script."""
    lines = [
        {"name": name, "type": "line", "symbol": "none", "data": [], "animation": False,
         "lineStyle": {"width": 1 if name.endswith("allowed") else 2,
                       "type": "solid" if name.endswith(("filtered", "measured")) else "dashed"}}
        for name in names
    ]  # fmt: skip
    grey = {"color": "#8a8a8a"}
    with section(title):
        chart = ui.echart({
            "color": COLOURS,
            "animation": False,
            "grid": {"left": 45, "right": 10, "top": 40, "bottom": 25},
            "legend": {"top": 0, "textStyle": grey, "type": "scroll", "itemWidth": 18},
            "xAxis": {"type": "value", "axisLabel": {"show": False}, "axisTick": {"show": False},
                      "splitLine": {"show": False}},
            "yAxis": {"type": "value", "min": -greatest, "max": greatest, "interval": greatest / 2, "axisLabel": grey,
                      "splitLine": {"lineStyle": {"color": "rgba(128,128,128,.25)"}}},
            "series": lines,
        }).classes("w-full").style("height:15rem")  # fmt: skip
        chart.props(f'role="img" aria-label="{html.escape(title)}, plotted over the last 20 s"')
    return str(chart.id)


def _floor(pages: Pages) -> str:
    """An SVG in metres; forward is up, left is left."""
    found = outlines(pages.loaded.robot)
    sight_m = found["sight"]

    def box(kind: str) -> str:
        front, rear, left, right = found[kind]
        return f'<rect class="{kind}" x="{-left}" y="{-front}" width="{left + right}" height="{front + rear}"/>'

    wheels = "".join(
        f'<line class="wheel" x1="{-y}" x2="{-y}" y1="{x - radius}" y2="{x + radius}"/>'
        for x, y, radius in found["wheels"]
    )
    return (
        f'<svg class="floor" role="img" aria-label="The robot from above with the readings of its scanners; '
        f'forward is up" viewBox="{-sight_m / 2} {-sight_m / 2} {sight_m} {sight_m}">{box("slow")}{box("stop")}'
        f'{box("footprint")}{wheels}<path id="scan" d=""/></svg>'
        "<small>solid: footprint; inner dashes: stops when something is nearer ahead; outer dashes: slows</small>"
    )
