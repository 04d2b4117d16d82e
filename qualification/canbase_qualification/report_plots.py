"""The plots of the report's page, as Plotly's plain figures: each run of each hazard, and one hazard's distribution."""

from __future__ import annotations

import math
from typing import Any, Final

from canbase_qualification.hazard_figures import StopFigures
from canbase_qualification.report import Report
from canbase_qualification.report_sections import measured
from canbase_qualification.report_words import plain
from canbase_qualification.statistics import SHARES, Distribution, thinned

DOTS: Final = 40
"""Runs of a hazard that are drawn, evenly by rank, beside the ten worst ones."""
STEPS: Final = 200
COLOURS: Final = {"runs": "#3b82c4", "p50": "#3aa06b", "p99": "#d97b29", "p99.9": "#8a6fd1", "max": "#d64545"}
SYMBOLS: Final = {"p50": "line-ns-open", "p99": "line-ns-open", "p99.9": "line-ns-open", "max": "diamond"}
ROW_PX, MARGIN_PX = 24, 120


def named(report: Report) -> list[tuple[str, StopFigures]]:
    """What has measured stops, by a short name: rows of the catalogue, failures without a row, ordinary stops."""
    found = [(plain(each.row.id), each.stops) for each in measured(report) if each.stops is not None]
    found += [(plain(name), stops) for name, stops in report.unlisted if stops is not None]
    if report.ordinary_stops is not None:
        found.append(("ordinary stop", report.ordinary_stops))
    return found


def overview(report: Report, metric: str) -> dict[str, Any]:
    """One line for each hazard, the worst distance at the top. `metric`: `time_s` or `distance_m`."""
    rows = [(name, _of(stops, metric)) for name, stops in named(report)]
    unit = "s" if metric == "time_s" else "m"
    traces = [_dots(rows, unit), *(_marks(rows, name, unit) for name in (*SHARES, "max"))]
    layout = {
        "height": MARGIN_PX + ROW_PX * len(rows),
        "xaxis": {"ticksuffix": f" {unit}", "rangemode": "tozero", "side": "top"},
        "yaxis": {"autorange": "reversed", "automargin": True, "type": "category", "tickfont": {"size": 11}},
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": 0, "yanchor": "top"},
        "margin": {"l": 10, "r": 20, "t": 40, "b": 50},
        "annotations": list(_never(rows)),
    }
    return {"data": traces, "layout": layout}


def curves(report: Report) -> dict[str, Any]:
    """By name: the values of its runs in ascending order, thinned; with each the share of the runs not beyond it."""
    return {
        name: {"runs": stops.runs, **{metric: _steps(_of(stops, metric)) for metric in ("time_s", "distance_m")}}
        for name, stops in named(report)
    }


def _of(stops: StopFigures, metric: str) -> Distribution:
    return stops.time_s if metric == "time_s" else stops.distance_m


def _finite(values: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(value for value in values if math.isfinite(value))


def _dots(rows: list[tuple[str, Distribution]], unit: str) -> dict[str, Any]:
    at = [(round(value, 4), name) for name, found in rows for value in thinned(_finite(found.values), DOTS)]
    return {
        "type": "scatter", "mode": "markers", "name": "runs", "x": [x for x, _ in at], "y": [y for _, y in at],
        "marker": {"color": COLOURS["runs"], "opacity": 0.35, "size": 6},
        "hovertemplate": f"%{{y}}: %{{x:.3f}} {unit}<extra>a run</extra>",
    }  # fmt: skip


def _marks(rows: list[tuple[str, Distribution]], name: str, unit: str) -> dict[str, Any]:
    at = [(value, row) for row, found in rows if (value := _value(found, name)) is not None]
    return {
        "type": "scatter", "mode": "markers", "name": name, "x": [round(x, 4) for x, _ in at], "y": [y for _, y in at],
        "marker": {
            "color": COLOURS[name], "symbol": SYMBOLS[name], "size": 9 if name == "max" else 13,
            "line": {"width": 2, "color": COLOURS[name]},
        },
        "hovertemplate": f"%{{y}}: %{{x:.3f}} {unit}<extra>{name}</extra>",
    }  # fmt: skip


def _value(found: Distribution, name: str) -> float | None:
    value = max(_finite(found.values), default=None) if name == "max" else found.quantile(name)
    return value if value is not None and math.isfinite(value) else None


def _never(rows: list[tuple[str, Distribution]]) -> Any:
    """Where a base did not come to standstill there is no value to draw."""
    for name, found in rows:
        count = len(found.values) - len(_finite(found.values))
        if count:
            yield {
                "x": 1, "xref": "paper", "xanchor": "right", "y": name, "yref": "y", "showarrow": False,
                "text": f"{count} of {len(found.values)} never stood", "font": {"color": COLOURS["max"], "size": 11},
            }  # fmt: skip


def _steps(found: Distribution) -> list[list[float]]:
    values, count = found.values, len(found.values)
    kept = thinned(tuple(float(rank) for rank in range(count)), STEPS)
    return [[round(values[int(rank)], 4), (int(rank) + 1) / count] for rank in kept if math.isfinite(values[int(rank)])]
