"""The page of a qualification: one file that opens without a network. Plots are Plotly's; texts are escaped.

Texts go through `html.escape`, plots come as JSON. The page may load nothing (its Content-Security-Policy).
"""

from __future__ import annotations

import html
import json
import re
from importlib.resources import files
from string import Template
from typing import Any, Final

from plotly.offline import get_plotlyjs

from canbase_qualification.report import Report
from canbase_qualification.report_plots import curves, named, overview
from canbase_qualification.sections import Section, Table
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable

CODE: Final = re.compile(r"`([^`]+)`")
STRONG: Final = re.compile(r"\*\*([^*<>]+)\*\*")
EMPHASIS: Final = re.compile(r"(?<!\w)\*([^*<>]+)\*(?!\w)")
NUMBER: Final = re.compile(r"^[\d.,]+( s| m| %|%)?$|^—|^never$")


def page(title: str, report: Report, sections: list[Section]) -> str:
    """The whole page."""
    template = Template((files("canbase_qualification") / "report_page.html").read_text(encoding="utf-8"))
    first, *rest = sections
    links = "".join(f'<li><a href="#{section.key}">{_text(section.title)}</a></li>' for section in rest)
    return template.substitute(
        title=_text(title),
        grade=report.grade.value,
        first=_first(first),
        contents=links,
        sections="".join(_section(section, report) for section in rest),
        plotly=get_plotlyjs(),
    )


def _text(text: str) -> str:
    """Escaped, on one line; code between backquotes, emphasis between asterisks."""
    escaped = html.escape(printable(text, 4 * SENTENCE_LENGTH))
    return EMPHASIS.sub(r"<em>\1</em>", STRONG.sub(r"<strong>\1</strong>", CODE.sub(r"<code>\1</code>", escaped)))


def _first(section: Section) -> str:
    """The first screen: the verdict stands out, and what it does not say comes beside what was assumed."""
    verdict, *notes = section.paragraphs
    told = "".join(f'<p class="soft">{_text(note)}</p>' for note in notes)
    short, assumed = section.tables
    return (
        f'<p class="verdict">{_text(verdict)}</p>{told}{_terms(short)}<div class="two">'
        f"<div><h2>{_text(assumed.caption)}</h2>{_terms(assumed)}{_bullets(section.facts)}</div>"
        f"<div><h2>{_text(section.list_title)}</h2>{_bullets(section.items)}</div></div>"
    )


def _terms(table: Table) -> str:
    rows = "".join(f"<dt>{_text(what)}</dt><dd>{_text(value)}</dd>" for what, value in table.rows)
    return f"<dl>{rows}</dl>"


def _bullets(items: tuple[str, ...]) -> str:
    return f"<ul>{''.join(f'<li>{_text(item)}</li>' for item in items)}</ul>" if items else ""


def _section(section: Section, report: Report) -> str:
    paragraphs = "".join(f"<p>{_text(text)}</p>" for text in section.paragraphs)
    plots = _plots(report) if section.plot else ""
    tables = "".join(map(_table, section.tables))
    code = f"<details><summary>robot.yaml as it took effect</summary><pre>{html.escape(section.code)}</pre></details>"
    return (
        f'<section id="{section.key}"><h2>{_text(section.title)}</h2>{paragraphs}{plots}{tables}'
        f"{_bullets(section.facts)}{_bullets(section.items)}{code if section.code else ''}</section>"
    )


def _table(table: Table) -> str:
    head = "".join(_column(table, at) for at in range(len(table.columns)))
    body = "".join(f"<tr>{''.join(_cell(at, cell) for at, cell in enumerate(row))}</tr>" for row in table.rows)
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{_attribute(table.caption)}"><table>'
        f"<caption>{_text(table.caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _column(table: Table, at: int) -> str:
    numbers = at > 0 and table.rows and all(NUMBER.match(row[at]) for row in table.rows)
    kind = ' class="number"' if numbers else ""
    return f'<th scope="col"{kind}>{_text(table.columns[at])}</th>'


def _cell(at: int, text: str) -> str:
    if at == 0:
        return f'<th scope="row">{_text(text)}</th>'
    kind = "number" if NUMBER.match(text) else ("long" if len(text) > 40 else "")
    return f'<td class="{kind}">{_text(text)}</td>' if kind else f"<td>{_text(text)}</td>"


def _attribute(text: str) -> str:
    return html.escape(printable(text, SENTENCE_LENGTH), quote=True)


def _plots(report: Report) -> str:
    if not named(report):
        return ""
    options = "".join(f"<option>{html.escape(name)}</option>" for name, _ in named(report))
    return (
        '<fieldset class="choice"><legend>Shown</legend>'
        '<label><input type="radio" name="metric" value="distance_m" checked> distance</label>'
        '<label><input type="radio" name="metric" value="time_s"> time</label></fieldset>'
        '<div id="overview" class="plot" role="img" aria-label="Each run of each hazard, with its quantiles. The table '
        'below has the same figures."></div>'
        f'<label class="choice">Distribution of <select id="which">{options}</select></label>'
        '<div id="curve" class="plot" role="img" aria-label="Share of the runs that stood by then"></div>'
        f"{_data('overviews', {metric: overview(report, metric) for metric in ('distance_m', 'time_s')})}"
        f"{_data('curves', curves(report))}"
    )


def _data(name: str, value: Any) -> str:
    """Inside a script element: nothing in it ends that."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    escaped = text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    return f'<script type="application/json" id="{name}">{escaped}</script>'
