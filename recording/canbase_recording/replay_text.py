"""What `canbase record replay` reports, in words and for JSON. Pure. Times: seconds of the recording."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final, Protocol

from canbase_driver.supervision.watchdog_link import CAUSES
from canbase_recording.recorded_inputs import RecordedInputs
from canbase_recording.recorded_watchdog import Trip
from canbase_recording.replay import Replayed, WatchdogReplay
from canbase_recording.replay_compare import Comparison, Difference
from canbase_recording.replay_setpoints import SetpointReplay
from canbase_recording.replay_sources import NOBODY, SourceReplay

MOST_LINES: Final = 20
NOT_REPLAYED: Final = "safety filter: cannot tell, since the file of the inputs of mux and filter is not beside it"


class Begun(Protocol):
    """A recording. Its first moment is the zero of all times here."""

    @property
    def began_s(self) -> float:
        """Monotonic time [s]."""


def watchdog_lines(inputs: Begun, found: WatchdogReplay) -> Iterator[str]:
    """The watchdog: what was recorded, and beside it what a new one does."""
    yield f"watchdog: {found.lease_count} leases, {found.frames} frames {found.source}"
    yield from (f"  note: {sentence}" for sentence in lease_notes(found))
    if not found.lives:
        yield "  no state frame 1FEh of a watchdog that was not tripped: nothing to compare with"
    for life in found.lives:
        yield from (f"  {line}" for line in _life_lines(inputs, life))


def lease_notes(found: WatchdogReplay) -> Iterator[str]:
    """What of the leases is not as plain as it should be."""
    leases = found.leases
    if leases.unstamped:
        yield (
            f"{leases.unstamped} messages on cmd_vel have no stamp of the filter's clock: they count as somebody "
            "else's, without a lease"
        )
    if leases.lost:
        yield f"{leases.lost} messages on cmd_vel had no lease, by the age that the watchdog reported"
    if leases.unheard:
        yield f"{leases.unheard} leases have no cmd_vel in the recording: they count with the velocity before them"


def _life_lines(inputs: Begun, life: Replayed) -> Iterator[str]:
    since, until = _at(inputs, life.life.from_s), _at(inputs, life.life.until_s)
    yield f"from {since} to {until}:"
    yield f"  recorded: {trip_text(inputs, life.life.trip)}"
    yield f"  replayed: {trip_text(inputs, life.trip)}"
    yield f"  {verdict(life)}"
    if life.starts:
        yield f"  the replay began {life.starts + 1} times: without its past a new watchdog trips at once there"
    for begin_s, end_s in life.life.silent:
        span = f"from {_at(inputs, begin_s)} to {_at(inputs, end_s)}"
        yield f"  no state frame came {span}: the watchdog did not run, or was not heard"


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
    if life.late_s == 0.0 and life.whole:
        return "the same cause, in the same tick"
    if life.lacks_a_cycle:
        return "the same cause, where the evidence lasts one cycle of the driver less: a new watchdog began it later"
    edge = ", within the accuracy of the recorded times: a limit was reached just so" if life.on_edge else ""
    cycle = ": one cycle of the driver" if life.is_a_cycle_apart else ""
    return f"the same cause, {abs(life.late_s) * 1000.0:.1f} ms {_later(life.late_s)}{cycle}{edge}"


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


def setpoint_lines(inputs: RecordedInputs, found: SetpointReplay) -> Iterator[str]:
    """The driver: the setpoints that cmd_vel orders, beside the recorded ones."""
    if not found.compared:
        yield "driver: it followed no commands in this recording"
        return
    yield (
        f"driver: {found.compared} cycles in which it followed cmd_vel; setpoints differ by at most "
        f"{found.greatest_mps:.4f} m/s (tolerance {found.tolerance_mps:.4f} m/s)"
    )
    for each in found.differences:
        span = f"from {_at(inputs, each.from_s)} to {_at(inputs, each.until_s)}"
        yield f"  DIFFERS {span}: recorded {each.recorded_mps:.3f} m/s, replayed {each.replayed_mps:.3f} m/s"


def source_lines(inputs: RecordedInputs, found: SourceReplay) -> Iterator[str]:
    """The mux: which source has the base by its orders, beside its recorded states."""
    orders = ", ".join(f"{name} {count}" for name, count in sorted(found.orders.items())) or "none"
    yield f"velocity mux: orders of {orders}; {found.compared} states compared, {found.left_out} left out"
    yield from (f"  {_at(inputs, each.at_s)} {each.source or NOBODY}" for each in found.takeovers[:MOST_LINES])
    for each in found.differences[:MOST_LINES]:
        yield f"  DIFFERS at {_at(inputs, each.at_s)}: recorded {each.recorded}, replayed {each.replayed}"


def source_values(inputs: RecordedInputs, found: SourceReplay) -> dict[str, Any]:
    """The same, for JSON."""
    return {
        "orders": dict(found.orders),
        "compared": found.compared,
        "left_out": found.left_out,
        "takeovers": [{"at_s": each.at_s - inputs.began_s, "source": each.source} for each in found.takeovers],
        "differences": [
            {"at_s": each.at_s - inputs.began_s, "recorded": each.recorded, "replayed": each.replayed}
            for each in found.differences
        ],
    }


def setpoint_values(inputs: RecordedInputs, found: SetpointReplay) -> dict[str, Any]:
    """The same, for JSON."""
    return {
        "compared": found.compared,
        "greatest_mps": found.greatest_mps,
        "tolerance_mps": found.tolerance_mps,
        "differences": [
            {
                "from_s": each.from_s - inputs.began_s,
                "until_s": each.until_s - inputs.began_s,
                "recorded_mps": each.recorded_mps,
                "replayed_mps": each.replayed_mps,
            }
            for each in found.differences
        ],
    }


def watchdog_values(inputs: Begun, found: WatchdogReplay) -> dict[str, Any]:
    """The same as `watchdog_lines`, for JSON."""
    return {
        "source": found.source,
        "leases": found.lease_count,
        "frames": found.frames,
        "notes": list(lease_notes(found)),
        "lives": [_life_values(inputs, life) for life in found.lives],
    }


def _life_values(inputs: Begun, life: Replayed) -> dict[str, Any]:
    return {
        "from_s": life.life.from_s - inputs.began_s,
        "until_s": life.life.until_s - inputs.began_s,
        "recorded": _trip_values(inputs, life.life.trip),
        "replayed": _trip_values(inputs, life.trip),
        "agrees": life.agrees,
        "on_edge": life.on_edge,
        "a_cycle_apart": life.is_a_cycle_apart,
        "cannot_be_replayed": life.cannot,
        "late_s": None if math.isnan(life.late_s) else life.late_s,
        "began": life.starts + 1,
        "silent": [[begin - inputs.began_s, end - inputs.began_s] for begin, end in life.life.silent],
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
