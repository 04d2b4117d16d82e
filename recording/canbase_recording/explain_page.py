"""The page of `canbase explain --html`: one file that opens without a network. Plots are Plotly's; texts are escaped.

Nothing of a recording becomes markup: texts go through `html.escape`, and tables and plots come as JSON that scripts
put into the page as text. The page may load nothing (its Content-Security-Policy).
"""

from __future__ import annotations

import html
import json
from importlib.resources import files
from string import Template
from typing import Any, Final

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from canbase_recording import page_data
from canbase_recording.event import Event, Level
from canbase_recording.explain_text import collapsed, ending, gaps, node_facts, standstill_sentence
from canbase_recording.explanation import Explanation
from canbase_recording.frame_words import pdo_sources
from canbase_recording.kind import Kind
from canbase_recording.lease_bounds import Bounds
from canbase_recording.recording_facts import RecordingFacts
from canbase_recording.story import Story
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable

COLOURS: Final = ("#3b82c4", "#d97b29", "#3aa06b", "#b3528f", "#8a6fd1", "#a58a1e", "#2aa3a3", "#c0504d")
TONES: Final = {"good": "#3aa06b", "warn": "#e0982f", "bad": "#d64545", "idle": "#8b9298"}
AROUND_S: Final = (1.0, 3.0)
"""A plot shows so much before the first cause and after the reaction, to begin with [s]."""


def page(facts: RecordingFacts, told: Explanation) -> str:
    """The whole page."""
    template = Template((files("canbase_recording") / "explain_page.html").read_text(encoding="utf-8"))
    stops = "".join(_stop(number, story, told) for number, story in enumerate(told.stories, start=1))
    return template.substitute(
        title=_text(f"canbase explain: {facts.file}"),
        facts=_text(facts.sentence(told)),
        problems="".join(f'<p class="warning">{_text(problem)}</p>' for problem in facts.problems),
        plotly=get_plotlyjs(),
        stops=stops + _more_stops(told) if told.stories else _no_stop(told),
        network=_network(told),
    )


def _text(text: str) -> str:
    """One line of a recording, as text of the page."""
    return html.escape(printable(text, SENTENCE_LENGTH))


def _no_stop(told: Explanation) -> str:
    lines = "".join(f"<p>{_text(line)}</p>" for line in ending(told))
    said = "No drive lost its power in motion, and no part of canbase stopped the base."
    return f"<section><h2>No stop was found</h2><p>{said}</p>{lines}</section>"


def _more_stops(told: Explanation) -> str:
    return f'<p class="warning">{told.further_stops} further stops are not told.</p>' if told.further_stops else ""


def _stop(number: int, story: Story, told: Explanation) -> str:
    delay_ms = 1000.0 * (story.scene.reaction_s - story.found.at_s)
    facts = [("what shows it", story.found.text)]
    if story.caught_by:
        facts.append(("caught by", f"{story.caught_by}, {delay_ms:.0f} ms later: {story.reported}"))
    facts += [("standstill", standstill_sentence(story)), ("look at", story.advice)]
    facts += [("also seen", f"{cause.value}: {found.text}") for cause, found in story.also]
    listed = "".join(f"<dt>{name}</dt><dd>{_text(value)}</dd>" for name, value in facts)
    return (
        f'<section id="stop{number}"><h2>Stop {number} of {len(told.stories)}, at {story.scene.reaction_s:.3f} s</h2>'
        f'<div class="cause">{_text(story.cause.value)}</div><dl>{listed}</dl>'
        f"{_plot(f'plot{number}', _figure(story))}"
        f"<h3>What happened</h3>{_events(story.chain)}"
        f"<h3>Frames around the reaction</h3>{_frames(f'frames{number}', story, told)}</section>"
    )


def _plot(name: str, figure: go.Figure, size: str = "") -> str:
    return (
        f'<div class="plot{size}" id="{name}"></div>'
        f'<script type="application/json" class="figure" data-plot="{name}">'
        f"{_json(json.loads(figure.to_json()))}</script>"
    )


def _json(value: Any) -> str:
    """Inside a script element: nothing in it ends that."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


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
    for row, curves in ((1, page_data.speeds(scene)), (2, commands)):
        for at, curve in enumerate(curves):
            colour = COLOURS[at // 2 % len(COLOURS)]
            line = {"color": colour, "dash": "dot" if curve.dashed else "solid", "width": 1.6}
            name = _text(curve.name)
            figure.add_scatter(x=curve.times, y=curve.values, name=name, mode="lines", line=line, row=row, col=1)
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
    figure.add_scatter(x=times, y=high, name=f"{_text(name)} lease bounds", row=1, col=1, **style, **fill)


def _add_bars(figure: go.Figure, bars: list[page_data.Bar]) -> None:
    figure.add_bar(
        orientation="h",
        y=[_text(bar.lane) for bar in bars],
        base=[bar.since_s for bar in bars],
        x=[bar.until_s - bar.since_s for bar in bars],
        marker_color=[TONES[bar.tone] for bar in bars],
        hovertext=[f"{_text(bar.text)}, {bar.since_s:.3f} to {bar.until_s:.3f} s" for bar in bars],
        text=[_text(bar.text) for bar in bars],
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


def _events(events: tuple[Event, ...] | list[Event]) -> str:
    rows = "".join(
        f'<tr class="{_LEVELS[event.level]}"><td>{event.at_s:.3f}</td><td>{_text(event.who)}</td>'
        f"<td>{_text(event.text)}{f' ({times} times)' if times > 1 else ''}</td></tr>"
        for event, times in collapsed(events)
    )
    return _table(("s", "part", "what"), rows)


_LEVELS: Final = {Level.INFO: "", Level.WARNING: "warning", Level.ALARM: "alarm"}


def _table(columns: tuple[str, ...], rows: str, style: str = "") -> str:
    head = "".join(f'<th scope="col">{column}</th>' for column in columns)
    return (
        f'<div class="scroll"><table class="{style}"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
    )


def _frames(name: str, story: Story, told: Explanation) -> str:
    kinds = "".join(f'<option value="{kind.value}">{kind.value}</option>' for kind in Kind)
    return (
        f'<div id="{name}"><div class="filter"><input type="search" placeholder="words, such as 181 fault" '
        f'aria-label="Show frames with these words"><select aria-label="Kind of frame">'
        f'<option value="">all kinds</option>{kinds}</select><output class="soft"></output></div>'
        f"{_table(('s', 'COB-ID', '', 'kind', 'data', 'words'), '', 'mono')}</div>"
        f'<script type="application/json" class="rows" data-table="{name}">'
        f"{_json(page_data.frame_rows(story.scene, told.decoder))}</script>"
    )


def _network(told: Explanation) -> str:
    nodes = "".join(
        f"<tr><td>{_text(told.decoder.who(node.node_id))}</td><td>{_text(', '.join(node_facts(told, node)))}</td></tr>"
        for node in sorted(told.network.nodes.values(), key=lambda each: each.node_id)
    )
    sources = "".join(
        f"<tr><td>{_text(source.value)}</td><td>{', '.join(f'{each:03X}h' for each in ids[:50])}</td></tr>"
        for source, ids in pdo_sources(told.layouts).items()
    )
    unknown = "".join(f'<p class="warning">{_text(line)}</p>' for line in gaps(told))
    return (
        f'<section id="network"><h2>Network</h2>{_table(("node", "what the recording shows"), nodes)}'
        f"<h3>How the contents of PDOs are known</h3>{_table(('source', 'COB-IDs'), sources)}{unknown}"
        f"<h3>Bus load</h3>{_plot('load', _load(told), ' small')}"
        f"<h3>Events of the whole recording</h3>{_events(told.events)}{_left_out(told)}</section>"
    )


def _left_out(told: Explanation) -> str:
    return f'<p class="soft">{told.events_left_out} later events are left out.</p>' if told.events_left_out else ""


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
