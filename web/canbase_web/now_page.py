"""The page `Now`: who drives, what stops, speeds, the robot from above, its drives. Its numbers: now_view.py."""

from __future__ import annotations

import html
import itertools
import math
from typing import Final

from nicegui import ui

from canbase_config.bus_load import cyclic_load
from canbase_web.floor_view import outlines
from canbase_web.pages import Pages, legend, section, table

PARTS: Final = ("source", "velocity_mux", "safety_filter", "motor_driver", "watchdog", "drives")
COLOURS: Final = ("#4e98e2", "#a371f7", "#2da44e", "#8a8a8a", "#8a8a8a", "#d4a72c", "#cf222e", "#1b7c83")
DRIVE_COLUMNS: Final = (
    "wheel", "state", "target", "measured", "current", "torque", "voltage", "temperature", "data age", "trouble",
)  # fmt: skip


def add(pages: Pages) -> None:
    """The page at `/`."""

    @ui.page("/")
    def now() -> None:
        ui.add_head_html('<script src="/static/now.js" defer></script>')
        with pages.frame("/") as plots:
            plots |= _content(pages)


def _content(pages: Pages) -> dict[str, str]:
    """The elements; the ids of the plots."""
    robot = pages.loaded.robot
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
            ui.html('<span id="free"></span> <span id="no-scan">No scan yet: its readings will be dots.</span>',
                    sanitize=False)  # fmt: skip
    with section("Who may drive"):
        table("sources", ("priority", "source", "age", "why not"), "The sources of robot.yaml, once velocity_mux runs.")
    with section("Drives"):
        table("drives", DRIVE_COLUMNS, "Each drive with its state and values, once motor_driver runs.")
        share = cyclic_load(robot)
        planned = "simulated, without a bit rate" if robot.bus.is_virtual else f"{share:.0%} planned load"
        ui.html(f'Bus {html.escape(robot.bus.channel)}: {planned}; <span id="bus"></span>', sanitize=False)
    return plots


def _plot(title: str, names: tuple[str, ...], greatest: float) -> str:
    """A live plot; its lines get their data from the page's script."""
    most = _rounded_up(greatest)
    dashed = [not name.endswith(("filtered", "measured")) for name in names]
    lines = [
        {"name": name, "type": "line", "symbol": "none", "data": [], "animation": False,
         "lineStyle": {"width": 1 if name.endswith("allowed") else 2, "type": "dashed" if dashes else "solid"}}
        for name, dashes in zip(names, dashed, strict=True)
    ]  # fmt: skip
    grey = {"color": "#8a8a8a"}
    with section(title):
        ui.html(legend(zip(names, itertools.cycle(COLOURS), dashed, strict=False)), sanitize=False)
        chart = ui.echart({
            "color": COLOURS,
            "animation": False,
            "grid": {"left": 45, "right": 10, "top": 10, "bottom": 10},
            "xAxis": {"type": "value", "axisLabel": {"show": False}, "axisTick": {"show": False},
                      "splitLine": {"show": False}},
            "yAxis": {"type": "value", "min": -most, "max": most, "interval": most / 2, "axisLabel": grey,
                      "splitLine": {"lineStyle": {"color": "rgba(128,128,128,.25)"}}},
            "series": lines,
        }).classes("w-full").style("height:13rem")  # fmt: skip
        chart.props(f'role="img" aria-label="{html.escape(title)}, plotted over the last 20 s"')
    return str(chart.id)


def _rounded_up(value: float) -> float:
    """To two digits, even ones: it and its half fit beside an axis."""
    step = 2.0 * 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(round(value / step, 6)) * step:.6g}")


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
