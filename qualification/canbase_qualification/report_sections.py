"""The report in words: sections of paragraphs, lists and tables, which Markdown and the page show alike. Pure.

Text between backquotes is code. Nothing here is markup: what shows it escapes it.
"""

from __future__ import annotations

from collections.abc import Iterator

from canbase_qualification.hazard_figures import MOST_VIOLATIONS, HazardFigures, StopFigures
from canbase_qualification.qualified import Setup
from canbase_qualification.report import Report
from canbase_qualification.report_first import first_screen
from canbase_qualification.report_numbers import numbers
from canbase_qualification.report_words import NOTHING, metres, plain, quantile_text, run, seconds, share, told_by
from canbase_qualification.sections import Section, Table
from canbase_qualification.statistics import SHARES
from canbase_qualification.tally import SENTENCES


def sections(report: Report) -> list[Section]:
    """All of them, the first screen first."""
    return [
        first_screen(report),
        *numbers(report),
        _violations(report),
        _measured(report),
        _judged(report),
        _uncovered(report),
        _configuration(report),
    ]


def _violations(report: Report) -> Section:
    collected = report.collected
    if not collected.violated:
        return Section("violations", "Violations", ("No property was violated in any run.",))
    counted = Table(
        "Properties",
        ("property", "violations", "what must hold"),
        tuple((name, f"{count:,}", SENTENCES.get(name, "")) for name, count in collected.properties.most_common()),
    )
    rows = tuple(
        (
            found.violation.property,
            f"{found.runs:,}",
            f"{found.violation.at_s:.2f} s",
            found.violation.detail,
            ", ".join(map(plain, found.outcome.faults)),
            found.outcome.robot,
            told_by(report.setup, found.outcome),
        )
        for found in collected.violations
    )
    one_by_one = Table(
        "Each with its first run", ("property", "runs", "at", "what", "failures", "robot", "replay"), rows
    )
    cut = collected.properties.total() - sum(found.runs for found in collected.violations)
    notes = (
        (f"The first {MOST_VIOLATIONS} kinds are listed; {cut:,} more violations are in results.jsonl.",)
        if cut > 0
        else ()
    )
    return Section("violations", "Violations", notes, tables=(counted, one_by_one))


def _measured(report: Report) -> Section:
    setup = report.setup
    rows = [
        _row(f"{plain(each.row.id)}: {each.row.failure}", each.stops, setup, each)
        for each in measured(report)
        if each.stops
    ]
    rows += [_row(f"{plain(name)} (no row of the catalogue)", stops, setup) for name, stops in report.unlisted if stops]
    if report.ordinary_stops is not None:
        rows.append(_row("Ordinary stop: zero is commanded, nothing fails.", report.ordinary_stops, setup))
    columns = (
        "hazard", "runs", "acts within", *(f"time {name}" for name in SHARES), "time max",
        *(f"distance {name}" for name in SHARES), "distance max", "max covers", "worst run", "replay",
    )  # fmt: skip
    about = (
        "From the failure to the lasting standstill, by the ground truth of the simulation. *acts within* is what the "
        "catalogue states for this robot.yaml: the time until a part acts, without braking.",
        "*max covers*: with 95 % confidence, at least this share of all bodies that may be drawn is not beyond the "
        "greatest value found (runs of one body are alike, and count once). A quantile of too few runs is a dash, with "
        "the number of runs that it needs.",
    )
    if not rows:
        return Section("stops", "Time and distance of each hazard", ("No stop was measured.",))
    table = Table("Time and distance to standstill", columns, tuple(rows))
    return Section("stops", "Time and distance of each hazard", about, tables=(table,), plot="stops")


def measured(report: Report) -> list[HazardFigures]:
    """Rows with measured stops, the longest distance first."""
    found = [(each.stops.distance_m.greatest, each) for each in report.hazards if each.stops]
    return [each for _, each in sorted(found, key=lambda pair: -pair[0])]


def _row(name: str, stops: StopFigures, setup: Setup, figures: HazardFigures | None = None) -> tuple[str, ...]:
    acts_s = figures.acts_within_s if figures else None
    never = f", {stops.never} never" if stops.never else ""
    return (
        name,
        f"{stops.runs:,}{never}",
        NOTHING if acts_s is None else seconds(acts_s),
        *(quantile_text(stops.time_s, each, "time") for each in SHARES),
        seconds(stops.time_s.greatest),
        *(quantile_text(stops.distance_m, each, "distance") for each in SHARES),
        metres(stops.distance_m.greatest),
        share(stops.covered_share),
        run(stops.farthest),
        told_by(setup, stops.farthest.outcome),
    )


def _judged(report: Report) -> Section:
    rows = tuple(
        (each.row.failure, f"{each.scenarios:,}", f"{each.violated:,}", "yes" if each.stops else "no")
        for each in sorted(report.hazards, key=lambda each: -each.scenarios)
        if each.scenarios
    )
    about = (
        "Scenarios have up to six overlapping failures; the properties are judged in each. A violation is counted for "
        "every failure that took part, whichever was the reason.",
    )
    columns = ("hazard", "scenarios with it", "of them violated", "stop measured alone")
    tables = (Table("Hazards in scenarios", columns, rows),) if rows else ()
    return Section(
        "scenarios", "Hazards in overlapping failures", about if rows else ("No scenario ran.",), tables=tables
    )


def _uncovered(report: Report) -> Section:
    rows = tuple(
        (each.row.part.heading, each.row.failure, each.row.constraint, ", ".join(_tests(each)))
        for each in report.uncovered
    )
    about = (
        "No run of this qualification has these failures: it says nothing about them. The tests of canbase that cover "
        "them run on sample robots, not on yours.",
    )
    table = Table("Rows without a run", ("part", "failure", "what must hold", "tests of canbase"), rows)
    return Section("uncovered", "Hazards without a run", about, tables=(table,) if rows else ())


def _tests(figures: HazardFigures) -> Iterator[str]:
    """The first ones by name; the catalogue has the rest."""
    shown = 3
    for test in figures.row.tests[:shown]:
        yield f"`{test}`"
    if len(figures.row.tests) > shown:
        yield f"{len(figures.row.tests) - shown} more"


def _configuration(report: Report) -> Section:
    setup = report.setup
    versions = Table("Versions", ("what", "version"), tuple(setup.versions.items()))
    head = (f"Hash of the effective configuration (SHA-256): `{setup.configuration_sha256}`",)
    return Section("configuration", "Configuration and versions", head, tables=(versions,), code=setup.configuration)
