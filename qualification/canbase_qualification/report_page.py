"""The page of a qualification: its sections, and plots of Plotly that come as JSON."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import Final

from plotly.offline import get_plotlyjs

from canbase_qualification.report import Report
from canbase_qualification.report_plots import curves, named, overview
from canbase_qualification.sections import Section, Table
from canbase_recording import html_page
from canbase_recording.html_page import Html, bullets, data, marked, section, table, tag, terms

NUMBER: Final = re.compile(r"^[\d.,]+( s| m| %|%)?$|^—|^never$")
METRICS: Final = ("distance_m", "time_s")


def page(title: str, report: Report, sections: list[Section]) -> str:
    """The whole page."""
    first, *rest = sections
    links = bullets(tag("a", marked(each.title), href=f"#{each.key}") for each in rest)
    return html_page.page(
        title,
        [tag("div", *_first(first), class_=f"card {report.grade.value}"), tag("nav", links, aria_label="Sections")],
        [_section(each, report) for each in rest],
        library=get_plotlyjs(),
        script=(files("canbase_qualification") / "report_page.js").read_text(encoding="utf-8"),
    )


def _first(first: Section) -> list[Html]:
    """The first screen: the verdict stands out, and what it does not say comes beside what was assumed."""
    verdict, *notes = first.paragraphs
    short, assumed = first.tables
    beside = tag("div", tag("h2", assumed.caption), _terms(assumed), bullets(map(marked, first.facts)))
    missing = tag("div", tag("h2", first.list_title), bullets(map(marked, first.items)))
    return [
        tag("p", marked(verdict), class_="verdict"),
        *(tag("p", marked(note), class_="soft") for note in notes),
        _terms(short),
        tag("div", beside, missing, class_="two"),
    ]


def _terms(of: Table) -> Html:
    return terms((marked(what), marked(value)) for what, value in of.rows)


def _section(of: Section, report: Report) -> Html:
    code = tag("details", tag("summary", "robot.yaml as it took effect"), html_page.code(of.code)) if of.code else ""
    return section(
        of.key,
        marked(of.title),
        *(tag("p", marked(text)) for text in of.paragraphs),
        *(_plots(report) if of.plot else ()),
        *map(_table, of.tables),
        bullets(map(marked, of.facts)),
        bullets(map(marked, of.items)),
        code,
    )


def _table(of: Table) -> Html:
    columns = (tag("th", marked(name), scope="col", class_=_kind(of, at)) for at, name in enumerate(of.columns))
    rows = (tag("tr", tag("th", marked(cells[0]), scope="row"), *map(_cell, cells[1:])) for cells in of.rows)
    return table(columns, rows, caption=of.caption)


def _kind(of: Table, at: int) -> str:
    return "number" if at and of.rows and all(NUMBER.match(cells[at]) for cells in of.rows) else ""


def _cell(text: str) -> Html:
    return tag("td", marked(text), class_="number" if NUMBER.match(text) else "long" if len(text) > 40 else "")


def _plots(report: Report) -> list[Html]:
    if not named(report):
        return []
    choices = [
        tag("label", tag("input", type="radio", name="metric", value=metric, checked=metric == METRICS[0]), f" {words}")
        for metric, words in zip(METRICS, ("distance", "time"), strict=True)
    ]
    which = tag("select", *(tag("option", name) for name, _ in named(report)), id="which")
    about = "Each run of each hazard, with its quantiles. The table below has the same figures."
    return [
        tag("fieldset", tag("legend", "Shown"), *choices, class_="choice"),
        tag("div", id="overview", class_="plot", role="img", aria_label=about),
        tag("label", "Distribution of ", which, class_="choice"),
        tag("div", id="curve", class_="plot", role="img", aria_label="Share of the runs that stood by then"),
        data({metric: overview(report, metric) for metric in METRICS}, id="overviews"),
        data(curves(report), id="curves"),
    ]
