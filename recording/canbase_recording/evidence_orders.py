"""Signs that somebody ordered a stop, or that orders did not arrive: people, filter, mux, commands, leases. Pure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Final

from canbase_driver.causes import DriverCause
from canbase_driver.supervision.watchdog_link import LEASE_AGE_UNKNOWN, TRIPPED
from canbase_recording.cause import Found
from canbase_recording.evidence_bus import pause
from canbase_recording.notes import FilterNote
from canbase_recording.scene import Scene
from canbase_recording.trace import last_before, value_at
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import SCAN_LOST, StopCause

Seen = Callable[[Scene], Found | None]
SLACK_S: Final = 0.02
"""A note is written down a little after what it is about."""
WAKES_S: Final = 0.1
"""A driver that stood still takes in what has waited within this time."""
COMMANDS_LOST_S: Final = 0.15
LEASE_LOST_S: Final = 0.15
DIFFERS_MPS: Final = 0.02
ESTOP: Final = frozenset({StopCause.ESTOP})
BUTTON: Final = frozenset({StopCause.ESTOP_STALE})
SCANNER: Final = SCAN_LOST | {StopCause.SCAN_BLIND, StopCause.BLIND}
OBSTACLE: Final = frozenset({StopCause.OBSTACLE, StopCause.OBSTACLE_NEAR})
OTHER: Final = frozenset(StopCause) - ESTOP - BUTTON - SCANNER - OBSTACLE - {StopCause.NONE}


def filter_stops(causes: frozenset[StopCause]) -> Seen:
    """The safety filter is the first that stops, for one of these causes."""

    def seen(scene: Scene) -> Found | None:
        note = _first_hold(scene)
        if note is None or note.cause not in causes or note.at_s > scene.reaction_s + SLACK_S:
            return None
        detail = f": {note.detail}" if note.detail else ""
        return Found(note.at_s, f"safety_filter orders zero, {note.cause.value}{detail}")

    return seen


def _first_hold(scene: Scene) -> FilterNote | None:
    """The note with which the filter began the hold that it has at the reaction."""
    first: FilterNote | None = None
    for note in scene.filters:
        if note.at_s > scene.reaction_s + SLACK_S:
            break
        holds = note.cause is not StopCause.NONE and not note.orders_motion
        if note.at_s > scene.reaction_s and first is not None and not holds:
            break
        first = None if not holds else first if first is not None and first.cause is note.cause else note
    return first


def source_lost(scene: Scene) -> Found | None:
    """The mux has no source any more, while the last one ordered motion; after a stop of the driver it ends by that.

    What a driver takes in when it goes on after a pause shows no order of events.
    """
    paused = pause(scene)
    woken_s = sum(paused) if paused is not None else -math.inf
    stops = (note.at_s for note in scene.drivers if note.state in (DriverState.STOPPING, DriverState.LATCHED))
    stopped_s = next((at_s for at_s in stops if at_s >= scene.reaction_s - SLACK_S), math.inf)
    before = ""
    for note in scene.muxes:
        if note.at_s > scene.reaction_s + SLACK_S or note.at_s >= stopped_s:
            break
        is_late = woken_s - SLACK_S <= note.at_s < woken_s + WAKES_S
        if not note.active and before and note.at_s >= scene.reaction_s - SLACK_S and not is_late:
            return Found(note.at_s, f"velocity_mux follows {before} no longer: {note.detail or 'no source'}")
        before = note.active
    return None


def driver_reports(*causes: DriverCause) -> Seen:
    """The driver is the first that stops, for one of these causes."""
    words = {cause.value for cause in causes}

    def seen(scene: Scene) -> Found | None:
        note = next((each for each in scene.drivers if each.at_s >= scene.reaction_s - SLACK_S), None)
        if note is None or note.cause not in words or note.at_s > scene.reaction_s + SLACK_S:
            return None
        detail = f" ({note.detail})" if note.detail else ""
        return Found(note.at_s, f"motor_driver {note.state.name}: {note.cause}{detail}")

    return seen


def reported(scene: Scene) -> Found | None:
    """What the watchdog or the driver gives as its cause, where the frames do not show what it saw."""
    for at_s, state in scene.watchdog:
        if state.state == TRIPPED and scene.reaction_s - SLACK_S <= at_s <= scene.reaction_s + SOON_S:
            about = f", {scene.who(state.node_id)}" if state.node_id else ""
            return Found(
                scene.reaction_s, f"the watchdog tripped: {state.cause_text}{about}; {NOT_SHOWN}", state.node_id
            )
    for note in scene.drivers:
        if note.cause and scene.reaction_s - SLACK_S <= note.at_s <= scene.reaction_s + SOON_S:
            detail = f" ({note.detail})" if note.detail else ""
            return Found(scene.reaction_s, f"motor_driver {note.state.name}: {note.cause}{detail}; {NOT_SHOWN}")
    return None


SOON_S: Final = 0.3
NOT_SHOWN: Final = "the frames of this recording do not show what it saw"


def leases_lost(scene: Scene) -> Found | None:
    """The watchdog reports that its last lease grows old."""
    state = value_at(scene.watchdog, scene.reaction_s + SLACK_S)
    at_s = last_before([at for at, _ in scene.watchdog], scene.reaction_s + SLACK_S)
    if state is None or state.lease_age_ms in (0, LEASE_AGE_UNKNOWN) or state.lease_age_ms < 1000.0 * LEASE_LOST_S:
        return None
    since_s = at_s - state.lease_age_ms / 1000.0
    commands = [note.at_s for note in scene.commands]
    silent = scene.silence_s(commands)
    if not scene.commands:
        more = "whether cmd_vel came is not in this recording"
    elif silent > COMMANDS_LOST_S:
        more = f"cmd_vel ended too, at {scene.reaction_s - silent:.3f} s: the velocity process is silent"
    else:
        more = "cmd_vel goes on: only the way of the leases is broken"
    return Found(since_s, f"the watchdog gets no lease since {since_s:.3f} s; {more}")


def commands_lost(scene: Scene) -> Found | None:
    """No cmd_vel came to the driver, while it had ordered motion and the filter went on."""
    last = next((note for note in reversed(scene.commands) if note.at_s <= scene.reaction_s), None)
    if last is None or not last.moves or scene.reaction_s - last.at_s < COMMANDS_LOST_S:
        return None
    goes_on = any(last.at_s + SLACK_S < note.at_s <= scene.ended_s for note in scene.filters)
    more = "the safety filter goes on" if goes_on else "nothing of the safety filter came either"
    return Found(last.at_s, f"no cmd_vel came after {last.at_s:.3f} s, while it ordered motion; {more}")


def two_commanders(scene: Scene) -> Found | None:
    """cmd_vel has messages that the safety filter did not send."""
    strange = []
    for note in scene.commands:
        if not scene.reaction_s - 1.0 <= note.at_s <= scene.reaction_s:
            continue
        ordered = [each for each in scene.filters if note.at_s - 0.25 <= each.at_s <= note.at_s + 0.15]
        if ordered and all(abs(each.linear_mps - note.linear_mps) > DIFFERS_MPS for each in ordered):
            strange.append(note)
    calm = [note for note in scene.commands if scene.reaction_s - 0.3 <= note.at_s <= scene.reaction_s]
    turns = sum(abs(a.linear_mps - b.linear_mps) > 0.1 for a, b in itertools.pairwise(calm))
    if len(strange) < 5 or turns < 4:
        return None
    first = strange[0]
    return Found(
        first.at_s,
        f"cmd_vel has {first.linear_mps:.2f} m/s {first.angular_radps:.2f} rad/s {len(strange)} times, "
        "which the safety filter did not order: somebody else publishes on it",
    )


def setpoints_kept(scene: Scene) -> Found | None:
    """cmd_vel orders zero, and the setpoints of enabled axes do not fall."""
    zero_s = _zero_since(scene)
    if not math.isfinite(zero_s) or scene.reaction_s - zero_s < 0.05:
        return None
    kept = []
    for trace in scene.enabled_axes():
        then, now = value_at(trace.target, zero_s), value_at(trace.target, scene.reaction_s)
        if then and now and abs(now) >= KEPT_SHARE * abs(then):
            kept.append(f"{trace.name} {trace.speed(now):.2f}{' m/s' if trace.has_units else ''}")
    if not kept:
        return None
    return Found(
        zero_s, f"cmd_vel orders zero since {zero_s:.3f} s, and setpoints go on: {', '.join(kept)}"
    )  # fmt: skip


KEPT_SHARE: Final = 0.98


def _zero_since(scene: Scene) -> float:
    """Since when every command has ordered zero; infinity: the last one before the reaction did not."""
    since = math.inf
    for note in reversed(scene.commands):
        if note.at_s > scene.reaction_s:
            continue
        if note.moves:
            break
        since = note.at_s
    return since
