"""The report as plain values for JSON, for programs: figures, violations, numbers to plan with. Pure."""

from __future__ import annotations

import math
from typing import Any

from canbase_qualification.hazard_figures import Found, HazardFigures, Run, StopFigures
from canbase_qualification.report import Report
from canbase_qualification.statistics import CONFIDENCE, SHARES, Distribution, runs_needed
from canbase_qualification.stopping_distance import StoppingDistance

FORM = 1
"""A program that reads it refuses another one."""


def as_json(report: Report) -> dict[str, Any]:
    """Strings, numbers, lists and objects; what is infinite, or has too few runs, is null. Times in s, lengths in m."""
    setup, collected = report.setup, report.collected
    return {
        "form": FORM,
        "verdict": report.verdict,
        "passed": report.grade.value == "passed",
        "grade": report.grade.value,
        "certificate": False,
        "robot": setup.robot.name,
        "robot_file": setup.robot_file,
        "configuration_sha256": setup.configuration_sha256,
        "versions": dict(setup.versions),
        "payload": _span(collected.payloads),
        "slope": _span(collected.slopes),
        "assumed": list(setup.assumed),
        "not_judged": list(setup.not_judged),
        "problems": list(setup.problems),
        "asked": dict(setup.asked),
        "runs": dict(collected.runs),
        "scenarios": collected.runs["scenario"],
        "seeds": {kind: list(span) for kind, span in collected.seeds.items()},
        "virtual_s": collected.virtual_s,
        "moved_m": collected.moved_m,
        "trips": dict(collected.trips),
        "violations": collected.properties.total(),
        "violated_runs": collected.violated,
        "properties": dict(collected.properties),
        "found": [_found(each) for each in collected.violations],
        "stopping_distances": [_distance(each) for each in report.distances],
        "timeouts": [
            {"key": age.key, "timeout_s": age.limit_s, "longest_s": age.longest_s} for age in collected.ages.values()
        ],
        "drives": [
            {"joint": own.joint, "node_id": own.node_id, "stops_by_itself": own.stops.value, "why": own.why}
            for own in report.own_stops
        ],
        "masters_die": {name: _stops(stops) for name, stops in report.masters_die},
        "ordinary_stop": _stops(report.ordinary_stops),
        "hazards": [_hazard(each) for each in report.hazards],
        "without_a_row": {name: _stops(stops) for name, stops in report.unlisted},
    }


def _hazard(figures: HazardFigures) -> dict[str, Any]:
    return {
        "id": figures.row.id,
        "covered": figures.is_covered,
        "acts_within_s": figures.acts_within_s,
        "scenarios": figures.scenarios,
        "violated": figures.violated,
        "stops": _stops(figures.stops),
    }


def _stops(stops: StopFigures | None) -> dict[str, Any] | None:
    if stops is None:
        return None
    return {
        "runs": stops.runs,
        "never": stops.never,
        "bodies": stops.bodies,
        "time_s": _distribution(stops.time_s),
        "distance_m": _distribution(stops.distance_m),
        "covered_share": stops.covered_share,
        "confidence": CONFIDENCE,
        "slowest": _run(stops.slowest),
        "farthest": _run(stops.farthest),
    }


def _distribution(distribution: Distribution) -> dict[str, Any]:
    told = {name: _finite(distribution.quantile(name)) for name in SHARES}
    needed = {name: runs_needed(share) for name, share in SHARES.items() if distribution.quantile(name) is None}
    return {**told, "max": _finite(distribution.greatest), "runs_needed": needed}


def _run(run: Run) -> dict[str, Any]:
    stop, outcome = run.stop, run.outcome
    return {
        "kind": outcome.kind, "seed": outcome.seed, "fault": stop.fault, "cause": stop.cause, "robot": outcome.robot,
        "speed_mps": stop.speed_mps, "time_s": _finite(stop.time_s), "distance_m": _finite(run.distance_m),
    }  # fmt: skip


def _found(found: Found) -> dict[str, Any]:
    violation, outcome = found.violation, found.outcome
    return {
        "property": violation.property, "at_s": violation.at_s, "detail": violation.detail, "runs": found.runs,
        "kind": outcome.kind, "seed": outcome.seed, "faults": list(outcome.faults), "robot": outcome.robot,
    }  # fmt: skip


def _distance(distance: StoppingDistance) -> dict[str, Any]:
    return {
        "case": distance.name,
        "speed_mps": distance.speed_mps,
        "time_s": _finite(distance.time_s),
        "distance_m": distance.distance_m,
        "approach_m": _finite(distance.approach_m),
        "terms": [
            {"name": term.name, "time_s": _finite(term.time_s), "distance_m": term.distance_m, "source": term.source}
            for term in distance.terms
        ],
        "stops": _stops(distance.measured),
    }


def _span(span: tuple[float, float]) -> list[float] | None:
    return list(span) if span[0] <= span[1] else None


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
