"""The page of `canbase explain --html`: plots are Plotly's; frames and plots are JSON that scripts put in as text."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from importlib.resources import files
from typing import Final

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from canbase_recording import html_page, page_data
from canbase_recording.event import Event, Level
from canbase_recording.explain_text import collapsed, ending, gaps, no_stop, node_facts, standstill_sentence
from canbase_recording.explanation import Explanation
from canbase_recording.frame_words import pdo_sources
from canbase_recording.html_page import Html, data, escaped, row, section, table, tag, terms
from canbase_recording.kind import Kind
from canbase_recording.lease_bounds import Bounds
from canbase_recording.recording_facts import OwnTrip, RecordingFacts
from canbase_recording.story import Story

COLOURS: Final = ("#3b82c4", "#d97b29", "#3aa06b", "#b3528f", "#8a6fd1", "#a58a1e", "#2aa3a3", "#c0504d")
TONES: Final = {"good": "#3aa06b", "warn": "#e0982f", "bad": "#d64545", "idle": "#8b9298"}
AROUND_S: Final = (1.0, 3.0)
"""A plot shows so much before the first cause and after the reaction, to begin with [s]."""


def page(facts: RecordingFacts, told: Explanation) -> str:
    """The whole page."""
    return html_page.page(
        f"canbase explain: {facts.file}",
        [tag("p", facts.sentence(told), class_="soft"), *_warnings(facts.problems), *_own_trip(facts.trip)],
        [*_stops(told), _network(told)],
        library=get_plotlyjs(),
        script=(files("canbase_recording") / "explain_page.js").read_text(encoding="utf-8"),
    )


def _own_trip(trip: OwnTrip | None) -> Iterator[Html]:
    """What the watchdog recorded before this recording begins."""
    if trip is not None and trip.told is not None:
        yield tag("p", trip.sentence)
        yield from (tag("p", f"{each.cause.value}: {each.found.text}") for each in trip.told.stories)


def _warnings(lines: Iterable[str]) -> Iterator[Html]:
    return (tag("p", line, class_="warning") for line in lines)


def _stops(told: Explanation) -> Iterator[Html]:
    for number, story in enumerate(told.stories, start=1):
        yield _stop(number, story, told)
    if told.further_stops:
        yield from _warnings([f"{told.further_stops} further stops are not told."])
    if not told.stories:
        yield section("stop", "No stop was found", *(tag("p", line) for line in (no_stop(told), *ending(told))))


def _stop(number: int, story: Story, told: Explanation) -> Html:
    facts = [("what shows it", story.found.text)]
    if story.caught_by:
        facts.append(("caught by", story.caught))
    facts += [("standstill", standstill_sentence(story)), ("look at", story.advice)]
    facts += [("also seen", f"{cause.value}: {found.text}") for cause, found in story.also]
    return section(
        f"stop{number}",
        f"{story.kind} {number} of {len(told.stories)}, at {story.scene.reaction_s:.3f} s",
        tag("div", story.cause.value, class_="verdict bad"),
        terms(facts),
        *_plot(f"plot{number}", _figure(story), "tall"),
        tag("h3", "What happened"),
        _events(story.chain),
        tag("h3", "Frames around the reaction"),
        *_frames(f"frames{number}", story, told),
    )


def _plot(name: str, figure: go.Figure, size: str) -> tuple[Html, Html]:
    plot = tag("div", id=name, class_=f"plot {size}")
    return plot, data(json.loads(figure.to_json()), class_="figure", data_plot=name)


def _figure(story: Story) -> go.Figure:
    """Speeds with the bounds of the leases, commands, and states, over one time."""
    scene = story.scene
    commands = page_data.commands(scene)
    unit = page_data.speed_unit(scene)
    figure = make_subplots(
        rows=3, shared_xaxes=True, vertical_spacing=0.05, row_heights=[0.45, 0.25, 0.30],
        subplot_titles=(f"Wheels [{unit}]", "Commands" if commands else "Commands: not in this recording", "States"),
    )  # fmt: skip
    for name, bounds in page_data.bounds(scene).items():
        _add_bounds(figure, name, bounds)
    for place, curves in ((1, page_data.speeds(scene)), (2, commands)):
        for at, curve in enumerate(curves):
            colour = COLOURS[at // 2 % len(COLOURS)]
            line = {"color": colour, "dash": "dot" if curve.dashed else "solid", "width": 1.6}
            name = escaped(curve.name)
            figure.add_scatter(x=curve.times, y=curve.values, name=name, mode="lines", line=line, row=place, col=1)
    _add_bars(figure, page_data.bars(scene))
    marks = (
        (story.found.at_s, TONES["bad"], "first cause", "right"),
        (scene.reaction_s, TONES["warn"], "reaction", "left"),
    )
    for at_s, colour, name, anchor in marks:
        figure.add_vline(x=at_s, line_color=colour, line_width=1.5, line_dash="dash")
        figure.add_annotation(x=at_s, y=1.0, yref="y domain", text=name, showarrow=False, xanchor=anchor, row=1, col=1)
    figure.update_xaxes(range=[story.found.at_s - AROUND_S[0], min(scene.reaction_s + AROUND_S[1], scene.ended_s)])
    figure.update_xaxes(ticksuffix=" s", row=3, col=1)
    _dress(figure)
    return figure


def _add_bounds(figure: go.Figure, name: str, bounds: Bounds) -> None:
    times = [at_s for at_s, _, _ in bounds]
    style = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip", "legendgroup": name}
    low, high = [low for _, low, _ in bounds], [high for _, _, high in bounds]
    figure.add_scatter(x=times, y=low, showlegend=False, row=1, col=1, **style)
    fill = {"fill": "tonexty", "fillcolor": "rgba(139,146,152,0.25)"}
    figure.add_scatter(x=times, y=high, name=f"{escaped(name)} lease bounds", row=1, col=1, **style, **fill)


def _add_bars(figure: go.Figure, bars: list[page_data.Bar]) -> None:
    figure.add_bar(
        orientation="h",
        y=[escaped(bar.lane) for bar in bars],
        base=[bar.since_s for bar in bars],
        x=[bar.until_s - bar.since_s for bar in bars],
        marker_color=[TONES[bar.tone] for bar in bars],
        hovertext=[f"{escaped(bar.text)}, {bar.since_s:.3f} to {bar.until_s:.3f} s" for bar in bars],
        text=[escaped(bar.text) for bar in bars],
        textposition="inside",
        insidetextanchor="start",
        hoverinfo="text",
        showlegend=False,
        row=3,
        col=1,
    )
    figure.update_yaxes(autorange="reversed", row=3, col=1)


def _dress(figure: go.Figure) -> None:
    figure.update_layout(
        template="none",
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        margin={"l": 60, "r": 10, "t": 30, "b": 40},
        barmode="overlay",
        bargap=0.25,
        hovermode="x unified",
        legend={"orientation": "h", "y": -0.1},
        font={"size": 12},
    )
    figure.update_annotations(font_size=12)
    figure.update_yaxes(automargin=True)


def _events(events: Iterable[Event]) -> Html:
    rows = (
        row(
            f"{event.at_s:.3f}", event.who, f"{event.text}{f' ({times} times)' if times > 1 else ''}",
            class_=_LEVELS[event.level],
        )
        for event, times in collapsed(events)
    )  # fmt: skip
    return table(("s", "part", "what"), rows, class_="events")


_LEVELS: Final = {Level.INFO: "", Level.WARNING: "warning", Level.ALARM: "alarm"}


def _frames(name: str, story: Story, told: Explanation) -> tuple[Html, Html]:
    words = {"type": "search", "placeholder": "words, such as 181 fault", "aria-label": "Show frames with these words"}
    kinds = (tag("option", kind.value, value=kind.value) for kind in Kind)
    choice = tag("select", Html('<option value="">all kinds</option>'), *kinds, aria_label="Kind of frame")
    chosen = tag("div", tag("input", **words), choice, tag("output", class_="soft"), class_="choice")
    frames = table(("s", "COB-ID", "", "kind", "data", "words"), (), class_="events mono")
    rows = page_data.frame_rows(story.scene, told.decoder)
    return tag("div", chosen, frames, id=name), data(rows, class_="rows", data_table=name)


def _network(told: Explanation) -> Html:
    nodes = sorted(told.network.nodes.values(), key=lambda each: each.node_id)
    sources = pdo_sources(told.layouts).items()
    left_out = f"{told.events_left_out} later events are left out." if told.events_left_out else ""
    return section(
        "network",
        "Network",
        table(
            ("node", "what the recording shows"),
            (row(told.decoder.who(node.node_id), ", ".join(node_facts(told, node))) for node in nodes),
            class_="events",
        ),
        tag("h3", "How the contents of PDOs are known"),
        table(
            ("source", "COB-IDs"),
            (row(source.value, ", ".join(f"{each:03X}h" for each in ids[:50])) for source, ids in sources),
            class_="events",
        ),
        *_warnings(gaps(told)),
        tag("h3", "Bus load"),
        *_plot("load", _load(told), "small"),
        tag("h3", "Events of the whole recording"),
        _events(told.events),
        tag("p", left_out, class_="soft"),
    )


def _load(told: Explanation) -> go.Figure:
    load = told.network.load
    shares = load.shares
    figure = go.Figure()
    figure.add_scatter(
        x=[round(at_s, 3) for at_s, _ in shares],
        y=[round(100.0 * share, 2) for _, share in shares],
        mode="lines",
        line={"color": COLOURS[0], "shape": "hv"},
        name="load",
    )
    figure.update_yaxes(title_text=f"% at {load.bitrate // 1000} kbit/s", rangemode="tozero")
    figure.update_xaxes(ticksuffix=" s")
    _dress(figure)
    figure.update_layout(showlegend=False)
    return figure
