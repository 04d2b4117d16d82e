"""The first screen of the report, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from canbase_qualification.outcome import KINDS
from canbase_qualification.report import Report
from canbase_qualification.report_numbers import own_stop_sentence
from canbase_qualification.report_words import NOTHING, metres, seconds, share
from canbase_qualification.sections import Section, Table
from canbase_qualification.statistics import runs_covering
from canbase_qualification.stopping_distance import StoppingDistance
from canbase_qualification.verdict import counted

ENOUGH: Final = 0.99
"""With 95 % confidence the worst run of each hazard covers so many of all such bodies, or the first screen says so."""
NO_CERTIFICATE: Final = (
    "This is a simulation in virtual time: the real decisions of canbase, with simulated drives, body, floor, bus and "
    "processes. It is no certificate, no proof of a performance level or SIL, and replaces no measurement on the robot."
)
NOT_LOOKED_AT: Final = (
    "real drives, firmware, gears, brakes, tyres and cables: measure stops on the robot, first with the wheels up",
    "stops from turns or backward: the measured ones begin on a straight line, forward, at full speed",
    "the corners of a base that turns while it stops: distances are those of its middle, from begin to end, straight",
    "wheels that slip or lift, tilting, loads that shift, trailers",
    "a safety relay or STO that takes the power off all drives at once: the wheels then coast, and no software brakes",
    "the real computer: Linux, DDS and Python are modelled as delays and pauses; `canbase prove "
    "benchmark` measures them",
    "what a scanner or a camera does not see, and its own response time, resolution and measuring error",
    "more than one failure of the CAN wiring at a time that also takes a drive's configuration",
)


def first_screen(report: Report) -> Section:
    """The verdict, the numbers that matter most, what was assumed and what was not looked at."""
    setup, collected = report.setup, report.collected
    assumed = Table(
        "What was assumed",
        ("what", "value"),
        (
            ("runs", _runs(report)),
            ("payload", _span(*collected.payloads, "× the empty robot's mass")),
            ("slope of the floor", _span(*_percent(collected.slopes), "% (positive: downhill ahead)")),
        ),
    )
    missing = [f"{text} (this robot)" for text in setup.not_judged]
    rows = len(report.uncovered)
    missing.append(
        f"{rows} of {len(report.hazards)} rows of the catalogue of hazards: no run has their failure, see below"
    )
    notes = [*(f"Problem of the results: {text}" for text in setup.problems), *_few(report)]
    return Section(
        "verdict",
        f"{setup.robot.name}: {report.grade.value}",
        (report.verdict, *notes, NO_CERTIFICATE),
        tables=(_in_short(report), assumed),
        facts=setup.assumed,
        list_title="What was not looked at",
        items=(*missing, *NOT_LOOKED_AT),
    )


def _few(report: Report) -> Iterator[str]:
    """Quantiles and worst values of a few runs are little evidence, whatever the verdict is."""
    found = [figures.stops for figures in report.hazards if figures.stops]
    least = min(found, key=lambda stops: stops.bodies, default=None)
    if least is not None and least.covered_share < ENOUGH:
        needed = runs_covering(ENOUGH)
        yield (
            f"**Few runs**: some hazards were measured with {least.bodies:,} drawn bodies only. With 95 % confidence "
            f"their worst values cover {share(least.covered_share)} of such bodies; {needed:,} cover "
            f"{100.0 * ENOUGH:.0f} % (`--stops {needed}`)."
        )


def _in_short(report: Report) -> Table:
    rows = [(f"distance for scanner fields: {each.name}", _planned(each)) for each in report.distances]
    tight = min(report.collected.ages.values(), key=lambda age: age.limit_s - age.longest_s, default=None)
    if tight is not None:
        room_s = tight.limit_s - tight.longest_s
        rows.append(
            ("the tightest timeout", f"`{tight.key}`: {seconds(tight.limit_s)}, {room_s:.3f} s more than needed")
        )
    rows.append(("drives that stop by themselves", own_stop_sentence(report)))
    return Table("In short", ("what", "value"), tuple(rows))


def _planned(distance: StoppingDistance) -> str:
    never = f"; {distance.measured.never:,} stops never ended" if distance.measured.never else ""
    return f"{metres(distance.distance_m)} and {seconds(distance.time_s)} from {distance.speed_mps:.2f} m/s{never}"


def _runs(report: Report) -> str:
    collected, asked = report.collected, report.setup.asked
    kinds = (
        f"{collected.runs[kind]:,} of {counted(kind, max(asked.get(kind, 0), collected.runs[kind]))}" for kind in KINDS
    )
    return (
        f"{', '.join(kinds)}; {collected.virtual_s / 3600.0:.2f} h in virtual time, {collected.moved_m / 1000.0:.2f} km"
    )


def _percent(span: tuple[float, float]) -> tuple[float, float]:
    return 100.0 * span[0], 100.0 * span[1]


def _span(low: float, high: float, unit: str) -> str:
    if low > high:
        return NOTHING
    return f"{low:.3g} {unit}" if low == high else f"{low:.3g} to {high:.3g} {unit}"
