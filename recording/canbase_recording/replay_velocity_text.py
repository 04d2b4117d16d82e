"""What `canbase record replay` reports of mux and filter that were fed with their own file, in words and for JSON.
Pure."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, Final

from canbase_recording.replay_text import Begun
from canbase_recording.replay_velocity import Decided, Held, VelocityReplay
from canbase_runtime.source_standing import SourceStanding
from canbase_runtime.stop_cause import StopCause

MOST_LINES: Final = 20
NOBODY: Final = "no source"
NO_STATE: Final = "  note: the file has no state of mux and filter at its begin: new ones know nothing of before"


def velocity_lines(zero: Begun, name: str, found: VelocityReplay) -> Iterator[str]:
    """`name`: of the file. What the filter did, and whether mux and filter that are new decide the same."""
    yield f"mux and filter: {found.holds} and {found.decisions} decisions of their own file {name}"
    if not found.has_state:
        yield NO_STATE
    for recorded, replayed in found.stops[:MOST_LINES]:
        said = "the same" if recorded.is_as(replayed) else f"DIFFERS: {_decided(replayed)}"
        yield f"  {_at(zero, recorded.at_s)} {_decided(recorded)}: {said}"
    if found.agrees:
        yield "  each decision is the same, at the same time"
    yield from (f"  {line}" for line in difference_lines(zero, found))


def difference_lines(zero: Begun, found: VelocityReplay) -> Iterator[str]:
    """Runs of decisions that differ, each by its first one."""
    lines = [*_runs(zero, found.mux_differences, _held), *_runs(zero, found.filter_differences, _decided)]
    yield from lines[:MOST_LINES]
    if found.different:
        yield f"{found.different} decisions differ"


def changed_lines(zero: Begun, found: VelocityReplay) -> Iterator[str]:
    """What another robot.yaml changes."""
    yield "mux and filter with the other robot.yaml, as far as the base would have moved as recorded:"
    if found.agrees:
        yield "  the same decisions"
    yield from (f"  {line}" for line in difference_lines(zero, found))


def velocity_values(zero: Begun, name: str, found: VelocityReplay) -> dict[str, Any]:
    """The same, for JSON."""
    return {
        "source": name,
        "has_state": found.has_state,
        "mux_decisions": found.holds,
        "filter_decisions": found.decisions,
        "different": found.different,
        "filter": [_pair(zero, *each) for each in found.stops],
        "mux_differences": [_pair(zero, *each) for each in found.mux_differences[:MOST_LINES]],
        "filter_differences": [_pair(zero, *each) for each in found.filter_differences[:MOST_LINES]],
    }


def _runs(zero: Begun, differences: list[Any], words: Any) -> Iterator[str]:
    """One line for neighbours that differ in the same way."""
    told = None
    for recorded, replayed in differences:
        said = words(recorded, short=True), words(replayed, short=True)
        if said != told:
            yield f"DIFFERS at {_at(zero, recorded.at_s)}: recorded {words(recorded)}, replayed {words(replayed)}"
        told = said


def _decided(decided: Decided, *, short: bool = False) -> str:
    cause = f" {decided.cause}" if decided.cause not in ("", StopCause.NONE.value) else ""
    hard = ", brakes hard" if decided.emergency else ""
    if short:
        return f"{decided.action}{cause}{hard}"
    detail = f" ({decided.detail})" if decided.detail else ""
    return f"{decided.action}{cause}, {_twist(decided)}{hard}{detail}"


def _held(held: Held, *, short: bool = False) -> str:
    standing = "" if held.standing is None else f" {SourceStanding(held.standing).name.lower()}"
    who = f"{held.active or NOBODY}{standing}"
    return who if short else f"{who}, {_twist(held)}"


def _twist(thing: Decided | Held) -> str:
    return f"{thing.linear_mps:.3f} m/s {thing.angular_radps:.3f} rad/s"


def _pair(zero: Begun, recorded: Decided | Held, replayed: Decided | Held) -> dict[str, Any]:
    return {
        "at_s": recorded.at_s - zero.began_s,
        "recorded": _values(recorded),
        "replayed": _values(replayed),
    }


def _values(thing: Decided | Held) -> dict[str, Any]:
    return {name: value for name, value in dataclasses.asdict(thing).items() if name != "at_s"}


def _at(zero: Begun, at_s: float) -> str:
    return f"{at_s - zero.began_s:.3f} s"
