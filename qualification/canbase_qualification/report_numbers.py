"""The numbers that an integrator plans with, in words: stopping distance, timeouts, drives that do not stop alone."""

from __future__ import annotations

import math
from collections.abc import Iterator

from canbase_qualification.report import Report
from canbase_qualification.report_words import NOTHING, metres, plain, seconds, share
from canbase_qualification.sections import Section, Table
from canbase_qualification.self_stop import StopsItself
from canbase_qualification.stopping_distance import WALKING_MPS, StoppingDistance

UNDISTURBED = "undisturbed"
"""The property of driving, see runs.OWN_PROPERTIES."""


def numbers(report: Report) -> list[Section]:
    """Three sections."""
    return [_distances(report), _timeouts(report), _own_stops(report)]


def _distances(report: Report) -> Section:
    title = "Stopping distance for scanner fields"
    if not report.distances:
        return Section("distance", title, ("No stop was measured: there is no distance to plan with.",))
    about = (
        "S = v × (age of the scan + period of the filter) + measured stop, in the form of ISO 13855. It is from "
        "simulation: a start for planning, to be confirmed by measured stops of the loaded robot.",
        f"Not included: the scanner's own response time (add v × that time), its measuring error and resolution, "
        f"ground clearance, worn brakes, more payload than assumed. A person who walks toward the base at "
        f"{WALKING_MPS:g} m/s (ISO 13855) comes the last line nearer meanwhile.",
        "The second case takes the worst of all single failures, also of those that leave the safety filter alive: an "
        "upper limit.",
        *_open_ends(report),
    )
    return Section("distance", title, about, tables=tuple(map(_sum, report.distances)))


def _open_ends(report: Report) -> Iterator[str]:
    """What makes a sum no limit."""
    scans = report.setup.robot.safety.scans
    if not any(scan.required for scan in scans):
        yield (
            "**No scanner is required in robot.yaml** (`safety.scan.required`): the base also drives without a scan, "
            "nothing bounds the age of a scan, and obstacles are not an order to stop. The terms are for a scanner "
            "that keeps its timeout."
        )
    never = max(each.measured.never for each in report.distances)
    if never:
        yield f"**{never:,} stops never ended**: they have no distance and are in no sum. STO alone stops that base."


def _sum(distance: StoppingDistance) -> Table:
    terms = [(term.name, seconds(term.time_s), metres(term.distance_m), term.source) for term in distance.terms]
    total = ("sum: the base", seconds(distance.time_s), metres(distance.distance_m), f"at {distance.speed_mps:.2f} m/s")
    walk = f"{WALKING_MPS:g} m/s × {seconds(distance.time_s)}"
    approach = ("a person who walks toward it", NOTHING, metres(distance.approach_m), walk)
    both = ("sum with that person", NOTHING, metres(distance.distance_m + distance.approach_m), "")
    rows = (*terms, total, approach, both)
    return Table(f"Case: {distance.name}", ("term", "time", "distance", "where it comes from"), rows)


def _timeouts(report: Report) -> Section:
    collected, title = report.collected, "Timeouts and false trips"
    if not collected.ages:
        return Section(
            "timeouts", title, ("There was no run without a failure: the room of the timeouts is not known.",)
        )
    cycle_s = 1.0 / report.setup.robot.rates.control_hz
    ages = sorted(collected.ages.values(), key=lambda age: age.limit_s - age.longest_s)
    rows = tuple(
        (f"`{age.key}`", seconds(age.limit_s), f"{age.longest_s:.3f} s", f"{age.limit_s - age.longest_s:.3f} s",
         seconds(math.ceil(100.0 * (age.longest_s + cycle_s)) / 100.0))
        for age in ages
    )  # fmt: skip
    about = (
        _trips(report),
        f"The longest age in {collected.driving_s / 3600.0:.2f} h of driving without a failure, in virtual time, with "
        "a computer that is late now and then. A timeout below it would have stopped the robot without a reason; the "
        "last column adds one control cycle. Your computer and your network are not in it: `canbase monitor` and "
        "`canbase doctor` show their ages.",
    )
    columns = ("key", "timeout", "longest age", "room", "no false trip from")
    return Section("timeouts", title, about, tables=(Table("Longest ages without a failure", columns, rows),))


def _trips(report: Report) -> str:
    """Nothing was seen in a time T: with 95 % confidence it comes fewer than 3 / T times (rule of three)."""
    hours, stopped = report.collected.driving_s / 3600.0, report.collected.properties[UNDISTURBED]
    if stopped:
        return f"{stopped:,} of these runs were stopped without a reason: see the violations of *{UNDISTURBED}*."
    return (
        f"None of these runs was stopped. In {hours:.2f} h that means, with 95 % confidence, fewer than "
        f"{3.0 / hours:.2g} false stops an hour of such driving: for a better limit run more of them (`--drives`)."
    )


def _own_stops(report: Report) -> Section:
    drives = tuple((own.joint, str(own.node_id), own.title, own.stops.value, own.why) for own in report.own_stops)
    rows = tuple(
        (plain(name), f"{stops.runs:,}", f"{stops.never:,}", seconds(stops.time_s.greatest),
         metres(stops.distance_m.greatest), share(stops.covered_share))
        for name, stops in report.masters_die
    )  # fmt: skip
    tables = [Table("By their profiles", ("joint", "node", "drive", "stops by itself", "why"), drives)]
    if rows:
        columns = ("failure", "runs", "never stood", "time max", "distance max", "max covers")
        tables.append(Table("Measured in simulation: the drives receive neither driver nor watchdog", columns, rows))
    return Section("drives", "Drives that stop by themselves", (own_stop_sentence(report),), tables=tuple(tables))


def own_stop_sentence(report: Report) -> str:
    """Which do, and which do not."""
    no = [own.joint for own in report.own_stops if own.stops is StopsItself.NO]
    unproven = [own.joint for own in report.own_stops if own.stops is StopsItself.UNPROVEN]
    parts = []
    if no:
        parts.append(
            f"{', '.join(no)} do NOT stop by themselves when the computer or the cable fails: only STO stops them."
        )
    if unproven:
        parts.append(f"For {', '.join(unproven)} it is not proven; `canbase setup commission` tests it on the robot.")
    if not parts:
        return (
            "By their profiles all drives stop by themselves when both heartbeats end. `canbase setup "
            "commission` proves it."
        )
    return " ".join(parts)
