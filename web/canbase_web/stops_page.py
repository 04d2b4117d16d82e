"""The page `Stops`: each stop with cause, time and distance, and the speeds of its recording."""

from __future__ import annotations

import asyncio
import itertools
import math
import time
from pathlib import Path
from typing import Any, Final

import can
from nicegui import Client, ui

from canbase_web import explained_stop
from canbase_web.pages import Pages, section
from canbase_web.stop_recording import MOST_FRAMES, FrameAt, WheelSpeeds, wheel_speeds

PERIOD_S: Final = 1.0
LARGEST_BYTES: Final = 20_000_000
COLUMNS: Final = (
    ("when", "when"), ("by", "stopped by"), ("cause", "cause"), ("detail", "detail"),
    ("time", "to standstill"), ("way", "distance"), ("reset", "reset"), ("file", "recording"),
)  # fmt: skip


def add(pages: Pages) -> None:
    """The page at `/stops`."""

    @ui.page("/stops")
    async def stops(client: Client) -> None:
        with pages.frame("/stops"):
            with section("Stops since the driver's start, the newest first"):
                table = ui.table(
                    columns=[
                        {"name": key, "label": name, "field": key, "align": "left",
                         "style": "" if key == "detail" else "white-space:nowrap"}
                        for key, name in COLUMNS
                    ],
                    rows=[],
                    row_key="key",
                ).classes("w-full").props("flat dense wrap-cells")  # fmt: skip
                ui.label("Select a stop to see its recording.").classes("text-caption")
            with section("Recording"):
                said = ui.label("no recording selected").props('role="status"')
                story = ui.link("What stopped it: the recording explained", "", new_tab=True)
                story.set_visibility(False)
                chart = ui.echart(_options([])).classes("w-full").style("height:20rem")
                chart.props('role="img" aria-label="Speeds of the wheels in the recording"')

        def refresh() -> None:
            rows = [_row(event) for event in reversed(pages.link.new_stops())]
            if rows != table.rows:
                table.rows = rows

        async def show(event: Any) -> None:
            key = event.args[1]["key"]
            file = next((each.black_box for each in pages.link.stops if _key(each) == key), "")
            story.set_visibility(bool(address := explained_stop.link(file)))
            story.props(f'href="{address}"')
            if not file:
                said.text = "this stop has no recording: only latched stops have one"
                return
            said.text = f"reading {file}"
            try:
                speeds = await asyncio.to_thread(_read, pages, Path(file))
            except (OSError, ValueError) as error:
                said.text = f"{file} cannot be read: {error}"
                return
            said.text = file
            chart.options.update(_options(speeds))
            chart.update()

        table.on("rowClick", show)
        ui.timer(PERIOD_S, refresh)
        refresh()


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


def _options(speeds: list[WheelSpeeds]) -> dict[str, Any]:
    grey = {"color": "#8a8a8a"}
    lines = [
        {"name": f"{wheel.joint} {what}", "type": "line", "showSymbol": False, "data": [list(point) for point in line],
         "lineStyle": {"type": "dashed" if what == "ordered" else "solid"}}
        for wheel in speeds
        for what, line in (("ordered", wheel.ordered), ("measured", wheel.measured))
    ]  # fmt: skip
    return {
        "animation": False,
        "grid": {"left": 50, "right": 15, "top": 40, "bottom": 40},
        "legend": {"textStyle": grey, "type": "scroll"},
        "tooltip": {"trigger": "axis"},
        "xAxis": {"type": "value", "name": "s", "axisLabel": grey},
        "yAxis": {"type": "value", "name": "m/s at the rim", "nameTextStyle": grey, "axisLabel": grey},
        "series": lines,
    }


def _row(event: Any) -> dict[str, Any]:
    return {
        "key": _key(event),
        "when": _clock(event.stamp.sec),
        "by": event.stopped_by,
        "cause": event.cause,
        "detail": event.detail,
        "time": f"{event.standstill_s:.2f} s" if event.standstill else "not detected",
        "way": "unknown" if math.isnan(event.distance_m) else f"{event.distance_m:.3f} m",
        "reset": "needed" if event.latched else "",
        "file": Path(event.black_box).name,
    }


def _key(event: Any) -> str:
    return f"{event.stamp.sec}.{event.stamp.nanosec:09d} {event.stopped_by} {event.cause}"


def _clock(stamp_s: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(stamp_s))
