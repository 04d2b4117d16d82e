"""What `canbase record replay` reports, in words and for JSON. Pure. Times: seconds of the recording."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final, Protocol

from canbase_driver.supervision.watchdog_link import CAUSES
from canbase_recording.replay_compare import Comparison, Difference
from canbase_recording.replay_trip import Replayed, Trip, WatchdogReplay

NO_WATCHDOG: Final = "watchdog: cannot tell, since no file watchdog_….jsonl of this stop is beside it"
NO_VELOCITY: Final = "mux and filter: cannot tell, since no file velocity_….jsonl of this stop is beside it"


class Begun(Protocol):
    """A recording. Its first moment is the zero of all times here."""

    @property
    def began_s(self) -> float:
        """Monotonic time [s]."""


def watchdog_lines(inputs: Begun, found: WatchdogReplay) -> Iterator[str]:
    """The watchdog: what was recorded, and beside it what a new one does."""
    yield f"watchdog: {found.leases} leases, {found.frames} frames of its own file {found.file}"
    for life in found.lives:
        yield from (f"  {line}" for line in _life_lines(inputs, life))


def _life_lines(inputs: Begun, life: Replayed) -> Iterator[str]:
    since, until = _at(inputs, life.life.from_s), _at(inputs, life.life.until_s)
    yield f"from {since} to {until}:"
    yield f"  recorded: {trip_text(inputs, life.life.trip)}"
    yield f"  replayed: {trip_text(inputs, life.trip)}"
    yield f"  {verdict(life)}"
    if life.starts:
        yield f"  the replay began {life.starts + 1} times: without its past a new watchdog trips at once there"


def verdict(life: Replayed) -> str:
    """Whether the replay does what was recorded."""
    if life.cannot:
        return f"cannot be replayed: {life.cannot}"
    if not life.differs:
        return _same(life)
    if life.trip is None:
        return "DIFFERS: the replay does not trip"
    if life.life.trip is None:
        return "DIFFERS: the watchdog that ran did not trip"
    if life.trip.cause is not life.life.trip.cause:
        return "DIFFERS: another cause"
    return f"DIFFERS: the same cause, {abs(life.late_s):.3f} s {_later(life.late_s)}"


def _same(life: Replayed) -> str:
    if life.trip is None:
        return "the same: no trip"
    if life.late_s == 0.0:
        return "the same cause, in the same tick"
    return f"the same cause, {abs(life.late_s) * 1000.0:.1f} ms {_later(life.late_s)}"


def _later(late_s: float) -> str:
    return "later" if late_s > 0.0 else "earlier"


def trip_text(inputs: Begun, trip: Trip | None) -> str:
    """One trip in words."""
    if trip is None:
        return "no trip"
    node = f", node {trip.node_id}" if trip.node_id else ""
    cause = CAUSES.get(int(trip.cause), "unknown") if trip.cause is not None else "unknown"
    return f"{_at(inputs, trip.at_s)} trips: {cause}{node}" + (f" ({trip.detail})" if trip.detail else "")


def comparison_lines(inputs: Begun, found: Comparison) -> Iterator[str]:
    """What the other robot.yaml changes."""
    shown = ", ".join(map(str, found.of_the_watchdog)) or "none"
    yield f"with the other robot.yaml: {len(found.changes)} keys differ; of the watchdog: {shown}"
    for difference in found.differences:
        yield f"  from {_at(inputs, difference.recorded.life.from_s)}: {difference_text(inputs, difference)}"


def difference_text(inputs: Begun, found: Difference) -> str:
    """The same, or when and why it trips instead."""
    why = ": " + " or ".join(map(str, found.by)) if found.by else ""
    before, after = found.recorded.trip, found.other.trip
    if found.is_none:
        return f"the same: {trip_text(inputs, after)}"
    if after is None:
        end = _at(inputs, found.other.life.until_s)
        return f"no trip until {end}{why}; what comes then in the recording is the consequence of its stop"
    if before is None:
        return f"{trip_text(inputs, after)}, where there was no trip{why}"
    if math.isclose(found.earlier_s, 0.0, abs_tol=0.0005):
        return f"{trip_text(inputs, after)} at the same time, with another cause{why}"
    when = f"{abs(found.earlier_s):.3f} s {_later(-found.earlier_s)}"
    cause = "" if before.cause is after.cause else f" by another cause, {CAUSES.get(int(after.cause or 0), 'unknown')}"
    return f"trips {when}{cause}{why}"


def watchdog_values(inputs: Begun, found: WatchdogReplay) -> dict[str, Any]:
    """The same as `watchdog_lines`, for JSON."""
    return {
        "file": found.file,
        "leases": found.leases,
        "frames": found.frames,
        "lives": [_life_values(inputs, life) for life in found.lives],
    }


def _life_values(inputs: Begun, life: Replayed) -> dict[str, Any]:
    return {
        "from_s": life.life.from_s - inputs.began_s,
        "until_s": life.life.until_s - inputs.began_s,
        "recorded": _trip_values(inputs, life.life.trip),
        "replayed": _trip_values(inputs, life.trip),
        "agrees": life.agrees,
        "cannot_be_replayed": life.cannot,
        "late_s": None if math.isnan(life.late_s) else life.late_s,
        "began": life.starts + 1,
    }


def comparison_values(inputs: Begun, found: Comparison) -> dict[str, Any]:
    """The same as `comparison_lines`, for JSON."""
    return {
        "changes": [_change_values(change) for change in found.changes],
        "of_the_watchdog": [change.key for change in found.of_the_watchdog],
        "lives": [
            {
                "from_s": each.recorded.life.from_s - inputs.began_s,
                "recorded_robot_yaml": _trip_values(inputs, each.recorded.trip),
                "other_robot_yaml": _trip_values(inputs, each.other.trip),
                "earlier_s": None if math.isnan(each.earlier_s) else each.earlier_s,
                "by": [change.key for change in each.by],
            }
            for each in found.differences
        ],
    }


def _change_values(change: Any) -> dict[str, Any]:
    return {"key": change.key, "before": change.before, "after": change.after}


def _trip_values(inputs: Begun, trip: Trip | None) -> dict[str, Any] | None:
    if trip is None:
        return None
    cause = None if trip.cause is None else trip.cause.name
    return {"at_s": trip.at_s - inputs.began_s, "cause": cause, "node_id": trip.node_id, "detail": trip.detail}


def _at(inputs: Begun, at_s: float) -> str:
    return f"{at_s - inputs.began_s:.3f} s"
