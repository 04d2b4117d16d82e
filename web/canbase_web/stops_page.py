"""The page `Stops`: each stop with cause, time and distance, and the speeds of its recording."""

from __future__ import annotations

import asyncio
import html
import itertools
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import can
from nicegui import ui

from canbase_web import explained_stop
from canbase_web.now_view import Robot, waits_for_reset
from canbase_web.pages import Pages, legend, section
from canbase_web.stop_recording import MOST_FRAMES, FrameAt, WheelSpeeds, wheel_speeds

PERIOD_S: Final = 1.0
LARGEST_BYTES: Final = 20_000_000
COLUMNS: Final = {
    "when": "when", "by": "stopped by", "cause": "cause", "detail": "detail", "time": "to standstill",
    "way": "distance", "reset": "reset", "file": "recording",
}  # fmt: skip
COLOURS: Final = ("#4e98e2", "#2da44e", "#d4a72c", "#a371f7")
ORDERED, MEASURED = "ordered", "measured"
EMPTY: Final = (
    "No stop since the driver's start. Each will be here with its cause, the time to standstill and the distance."
)
NOT_SELECTED: Final = "Select the time of a stop: the speeds of its wheels will be drawn here."


def add(pages: Pages) -> None:
    """The page at `/stops`."""

    @ui.page("/stops")
    def stops() -> None:
        with pages.frame("/stops"):
            _View(pages)


class _View:
    """The page in one browser."""

    def __init__(self, pages: Pages) -> None:
        self._pages = pages
        self._shown: list[dict[str, str]] | None = None
        self._selected = ""
        with section("Stops since the driver's start, the newest first"):
            self._table = ui.element("table").classes("values")
            self._empty = ui.label(EMPTY)
        with section("Recording"):
            self._said = ui.label(NOT_SELECTED).props('role="status"')
            self._story = ui.link("What stopped it: the recording explained", "", new_tab=True)
            self._story.set_visibility(False)
            self._drawn = ui.column().classes("w-full")
            self._drawn.set_visibility(False)
            with self._drawn:
                self._legend = ui.html("", sanitize=False)
                self._chart = ui.echart(_options([])).classes("w-full").style("height:18rem")
                self._chart.props('role="img" aria-label="Speeds of the wheels in the recording"')
        ui.timer(PERIOD_S, self._refresh)
        self._refresh()

    def _refresh(self) -> None:
        rows = rows_of(self._pages.link.new_stops(), self._pages.now()[0])
        if rows == self._shown:
            return
        self._shown = rows
        self._table.set_visibility(bool(rows))
        self._empty.set_visibility(not rows)
        self._table.clear()
        with self._table:
            with ui.element("thead"), ui.element("tr"):
                for name in COLUMNS.values():
                    ui.html(name, tag="th", sanitize=False).props('scope="col"')
            with ui.element("tbody"):
                for row in rows:
                    self._row(row)

    def _row(self, row: dict[str, str]) -> None:
        with ui.element("tr") as line:
            if row["key"] == self._selected:
                line.props('aria-current="true"')
            for column, name in COLUMNS.items():
                with ui.element("td").props(f'data-name="{name}"'):
                    if column == "when":
                        button = ui.html(row[column], tag="button", sanitize=False).props("type=button")
                        button.on("click", lambda: self._select(row["key"]))
                    else:
                        ui.html(html.escape(row[column]), tag="span", sanitize=False)

    async def _select(self, key: str) -> None:
        self._selected, self._shown = key, None
        self._refresh()
        file = next((each.black_box for each in self._pages.link.stops if _key(each) == key), "")
        self._story.set_visibility(bool(address := explained_stop.link(file)))
        self._story.props(f'href="{address}"')
        self._drawn.set_visibility(False)
        if not file:
            self._said.text = "this stop has no recording: only latched stops have one"
            return
        self._said.text = f"reading {file}"
        try:
            speeds = await asyncio.to_thread(_read, self._pages, Path(file))
        except (OSError, ValueError) as error:
            self._said.text = f"{file} cannot be read: {error}"
            return
        self._said.text = f"{file}: speed at the rim [m/s] over time [s]"
        lines = _lines(speeds)
        self._legend.set_content(
            legend((f"{joint} {what}", colour, what == ORDERED) for joint, what, colour, _ in lines)
        )
        self._chart.options.update(_options(lines))
        self._chart.update()
        self._drawn.set_visibility(True)


def _read(pages: Pages, file: Path) -> list[WheelSpeeds]:
    """Raises OSError and ValueError for a file that is none."""
    if file.suffix != ".asc" or not file.is_file() or file.stat().st_size > LARGEST_BYTES:
        raise ValueError("it is no recording of a stop")
    with can.ASCReader(file) as reader:
        found: list[FrameAt] = [
            (message.timestamp, message.arbitration_id, bytes(message.data))
            for message in itertools.islice(reader, MOST_FRAMES)
        ]
    began_s = found[0][0] if found else 0.0
    return wheel_speeds(pages.loaded.robot, ((at_s - began_s, cob_id, data) for at_s, cob_id, data in found))


def _lines(speeds: list[WheelSpeeds]) -> list[tuple[str, str, str, list[tuple[float, float]]]]:
    """Joint, what it is, colour, points."""
    return [
        (wheel.joint, what, colour, points)
        for wheel, colour in zip(speeds, itertools.cycle(COLOURS), strict=False)
        for what, points in ((ORDERED, wheel.ordered), (MEASURED, wheel.measured))
    ]


def _options(lines: list[tuple[str, str, str, list[tuple[float, float]]]]) -> dict[str, Any]:
    grey = {"color": "#8a8a8a"}
    return {
        "animation": False,
        "grid": {"left": 50, "right": 15, "top": 10, "bottom": 30},
        "tooltip": {"trigger": "axis"},
        "xAxis": {"type": "value", "axisLabel": grey},
        "yAxis": {"type": "value", "axisLabel": grey},
        "series": [
            {"name": f"{joint} {what}", "type": "line", "showSymbol": False, "data": [list(point) for point in points],
             "color": colour, "lineStyle": {"type": "dashed" if what == ORDERED else "solid"}}
            for joint, what, colour, points in lines
        ],
    }  # fmt: skip


def rows_of(events: Sequence[Any], robot: Robot) -> list[dict[str, str]]:
    """The newest first. The newest latched stop needs a reset until the robot waits for none; the others had theirs."""
    still = not robot.driver.fresh or waits_for_reset(robot) or (robot.safety.fresh and robot.safety.message.estop)
    latched = [event for event in events if event.latched]
    needing = latched[-1] if still and latched else None
    return [_row(event, "needed" if event is needing else "done" if event.latched else "") for event in events[::-1]]


def _row(event: Any, reset: str) -> dict[str, str]:
    return {
        "key": _key(event),
        "when": _clock(event.stamp.sec),
        "by": event.stopped_by,
        "cause": event.cause,
        "detail": event.detail,
        "time": f"{event.standstill_s:.2f} s" if event.standstill else "not detected",
        "way": "unknown" if math.isnan(event.distance_m) else f"{event.distance_m:.3f} m",
        "reset": reset,
        "file": Path(event.black_box).name,
    }


def _key(event: Any) -> str:
    return f"{event.stamp.sec}.{event.stamp.nanosec:09d} {event.stopped_by} {event.cause}"


def _clock(stamp_s: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(stamp_s))
