"""The page and the Markdown of a qualification: whole, offline, and no text of a robot becomes markup."""

from __future__ import annotations

import re

from canbase_qualification.outcome import Violation
from canbase_qualification.report import Report
from canbase_qualification.report_markdown import markdown
from canbase_qualification.report_page import page
from canbase_qualification.report_sections import sections
from support.made_results import KILLED, made, never, passed, scenario, stops

EVIL = "<img src=x onerror=alert(1)> `b` | \u202e </script>"


def page_of(report: Report, title: str = "canbase prove qualify: bench") -> str:
    return page(title, report, sections(report))


def without_library(text: str) -> str:
    """The page, less Plotly."""
    return re.sub(r"<script>.*?</script>", "", text, count=1, flags=re.DOTALL)


def test_the_page_has_all_sections_and_may_load_nothing() -> None:
    report = made(passed())
    text = page_of(report)
    assert "default-src 'none'" in text
    assert len(text) < 7_000_000
    own = without_library(text)
    for each in sections(report)[1:]:
        assert f'<section id="{each.key}">' in own
        assert f'href="#{each.key}"' in own
    assert "://" not in own


def test_each_plot_has_a_table_with_the_same_rows() -> None:
    own = without_library(page_of(made(passed())))
    plotted = re.findall(r"<option>([^<]*)</option>", own)
    table = own.split("<caption>Time and distance to standstill</caption>")[1].split("</table>")[0]
    assert len(plotted) == table.count('<th scope="row">') == 5


def test_text_of_others_stays_text() -> None:
    held = Violation("held", 0.7, EVIL)
    report = made([*stops(KILLED, 5), scenario(1, "driver_dies", violations=(held,))], robot_file=EVIL)
    own = without_library(page_of(report, EVIL))
    assert "<img" not in own
    assert own.count("</script>") == 3  # two of data, one of the page
    told = markdown("bench", sections(report))
    assert "<img" not in told
    row = next(line for line in told.splitlines() if "onerror" in line and line.startswith("| held"))
    assert row.count("|") == 8


def test_nothing_measured_is_a_page_too() -> None:
    own = without_library(page_of(made([])))
    assert "Nothing was measured" in own
    assert 'id="overview"' not in own


def test_a_base_that_never_stood_is_written_into_the_plot() -> None:
    own = without_library(page_of(made([*stops(KILLED, 9), never(KILLED, 77)])))
    assert "1 of 10 never stood" in own


def test_markdown_has_a_line_for_each_cell() -> None:
    told = markdown("bench", sections(made(passed())))
    for block in re.findall(r"(?:^\|.*\n)+", told, flags=re.MULTILINE):
        lines = block.splitlines()
        assert len({line.count("|") for line in lines}) == 1, lines[0]
    assert told.startswith("# bench\n")
