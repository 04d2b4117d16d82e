"""What the watchdog of another robot.yaml would have done with the same frames and leases. Pure.

Until the recorded stop alone: what comes after it in the recording is its consequence.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from canbase_config.derive import watchdog_config
from canbase_config.robot import Robot
from canbase_config.watchdog import WatchdogConfig, WatchedLayout
from canbase_recording.config_changes import Change, changes, of_the_watchdog
from canbase_recording.input_lines import NoInputsError
from canbase_recording.replay_trip import Replayed, Trip
from canbase_recording.stop_file import StopFile

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


Replay = Callable[[WatchdogConfig], tuple[Replayed, ...]]
"""The lives of the watchdog that ran, with this configuration."""


def compare(inputs: StopFile, other: Robot, replay: Replay) -> Comparison:
    """Raises NoInputsError where the other robot has other drives: then the frames mean something else."""
    config = watchdog_config(other)
    refuse_other_drives(inputs.watchdog, config)
    config = replace(config, lease_socket=inputs.watchdog.lease_socket)
    all_changes = changes(inputs.robot_yaml, other.model_dump(mode="json"))
    relevant = of_the_watchdog(inputs.robot_yaml, inputs.watchdog, all_changes)
    before = replay(inputs.watchdog)
    after = replay(config)
    tried = {
        change: replay(alone)
        for change, alone in list(relevant.items())[:MOST_TRIED]
        if any(not _same(one.trip, two.trip) for one, two in zip(before, after, strict=True))
    }
    found = tuple(
        Difference(one, two, tuple(change for change, lives in tried.items() if _same(lives[at].trip, two.trip)))
        for at, (one, two) in enumerate(zip(before, after, strict=True))
    )
    return Comparison(tuple(all_changes), tuple(relevant), found)


def compare_alone(recorded: WatchdogConfig, other: Robot, replay: Replay) -> Comparison:
    """Where the recorded robot.yaml is unknown: the keys are those of the watchdog's own configuration."""
    config = replace(watchdog_config(other), lease_socket=recorded.lease_socket, lease_uid=recorded.lease_uid)
    refuse_other_drives(recorded, config)
    before, after = dataclasses.asdict(recorded), dataclasses.asdict(config)
    found = tuple(each for each in changes(before, after) if each.loc[0] not in _OF_NO_MATTER)
    lives = zip(replay(recorded), replay(config), strict=True)
    return Comparison(found, found, tuple(Difference(one, two, ()) for one, two in lives))


_OF_NO_MATTER: Final = ("bus_arguments", "lease_uid", "recording_folder", "recording_s", "recordings", "relay", "robot")


def refuse_other_drives(before: WatchdogConfig, after: WatchdogConfig) -> None:
    """Raises NoInputsError."""
    recorded = [(drive.node_id, drive.axis, drive.layout) for drive in before.drives]
    given = [(drive.node_id, drive.axis, drive.layout) for drive in after.drives]
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
