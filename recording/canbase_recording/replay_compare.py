"""What the watchdog of another robot.yaml would have done with the same frames and leases. Pure.

Until the recorded stop alone: what comes after it in the recording is its consequence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from canbase_config.derive import watchdog_config
from canbase_config.robot import Robot
from canbase_config.watchdog import WatchedDrive, WatchedLayout
from canbase_recording.config_changes import Change, changes, of_the_watchdog
from canbase_recording.recorded_inputs import NoInputsError, RecordedInputs
from canbase_recording.recorded_watchdog import Trip
from canbase_recording.replay import Replayed, replay_watchdog

SAME_S: Final = 0.0005
"""Two replays of the same inputs differ by less where nothing has changed [s]."""
MOST_TRIED: Final = 12
"""This many changed keys are replayed alone, to find the one that matters."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One life of the watchdog with both configurations. `by`: the keys of which each alone has the same result."""

    recorded: Replayed
    other: Replayed
    by: tuple[Change, ...]

    @property
    def is_none(self) -> bool:
        """Both do the same."""
        return _same(self.recorded.trip, self.other.trip)

    @property
    def earlier_s(self) -> float:
        """How much earlier the other one trips [s]; NaN: one of them does not."""
        first, second = self.recorded.trip, self.other.trip
        return first.at_s - second.at_s if first and second else math.nan


@dataclass(frozen=True, slots=True)
class Comparison:
    """All lives, and the keys that differ."""

    changes: tuple[Change, ...]
    of_the_watchdog: tuple[Change, ...]
    differences: tuple[Difference, ...]


def compare(inputs: RecordedInputs, other: Robot) -> Comparison:
    """Raises NoInputsError where the other robot has other drives: then the frames mean something else."""
    config = watchdog_config(other)
    _refuse_other_drives(inputs, config.drives)
    config = replace(config, lease_socket=inputs.watchdog.lease_socket)
    all_changes = changes(inputs.robot_yaml, other.model_dump(mode="json"))
    relevant = of_the_watchdog(inputs.robot_yaml, inputs.watchdog, all_changes)
    before = replay_watchdog(inputs, inputs.watchdog).lives
    after = replay_watchdog(inputs, config).lives
    tried = {
        change: replay_watchdog(inputs, alone).lives
        for change, alone in list(relevant.items())[:MOST_TRIED]
        if any(not _same(one.trip, two.trip) for one, two in zip(before, after, strict=True))
    }
    found = tuple(
        Difference(one, two, tuple(change for change, lives in tried.items() if _same(lives[at].trip, two.trip)))
        for at, (one, two) in enumerate(zip(before, after, strict=True))
    )
    return Comparison(tuple(all_changes), tuple(relevant), found)


def _refuse_other_drives(inputs: RecordedInputs, drives: Sequence[WatchedDrive]) -> None:
    recorded = [(drive.node_id, drive.axis, drive.layout) for drive in inputs.watchdog.drives]
    given = [(drive.node_id, drive.axis, drive.layout) for drive in drives]
    if recorded != given:
        raise NoInputsError(
            f"the drives differ: recorded {_nodes(recorded)}, in the other robot.yaml {_nodes(given)}; "
            "only a configuration of the same drives can be compared"
        )


def _nodes(drives: Sequence[tuple[int, int, WatchedLayout]]) -> str:
    return ", ".join(f"node {node_id} axis {axis}" for node_id, axis, _ in drives)


def _same(one: Trip | None, two: Trip | None) -> bool:
    if one is None or two is None:
        return one is two
    return one.cause is two.cause and abs(one.at_s - two.at_s) < SAME_S
