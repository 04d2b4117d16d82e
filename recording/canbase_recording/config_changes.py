"""In which keys two effective configurations differ, and which of them concern the watchdog. Pure."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from pydantic import ValidationError

from canbase_config.derive import watchdog_config
from canbase_config.load import leaf_keys
from canbase_config.robot import Robot
from canbase_config.watchdog import WatchdogConfig

ABSENT: Final = "not given"
MOST_CHANGES: Final = 200

Loc = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Change:
    """A key of robot.yaml with both values."""

    loc: Loc
    before: Any
    after: Any

    @property
    def key(self) -> str:
        """As people write it: `drives[0].gear_ratio`."""
        return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in self.loc).lstrip(".")

    def __str__(self) -> str:
        return f"{self.key} {_short(self.before)} -> {_short(self.after)}"


def changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[Change]:
    """All keys with another value, in the order of `after`; keys that it does not have come last."""
    old, new = dict(_leaves(before)), dict(_leaves(after))
    order = [*new, *(loc for loc in old if loc not in new)]
    found = [Change(loc, old.get(loc, ABSENT), new.get(loc, ABSENT)) for loc in order]
    return [each for each in found if each.before != each.after][:MOST_CHANGES]


def alone(robot_yaml: Mapping[str, Any], change: Change) -> Robot | None:
    """The robot with this one change; None: it cannot be made alone."""
    if ABSENT in (change.before, change.after):
        return None
    values = copy.deepcopy(dict(robot_yaml))
    place: Any = values
    for part in change.loc[:-1]:
        place = place[part]
    place[change.loc[-1]] = change.after
    try:
        return Robot.model_validate(values)
    except ValidationError:
        return None


def of_the_watchdog(
    robot_yaml: Mapping[str, Any], recorded: WatchdogConfig, found: list[Change]
) -> dict[Change, WatchdogConfig]:
    """Those that change what the watchdog works with, each with its configuration if it alone were made."""
    robots = {str(each.loc): alone(robot_yaml, each) for each in found}
    of_each = {each: robots[str(each.loc)] for each in found}
    configs = {each: watchdog_config(robot) for each, robot in of_each.items() if robot is not None}
    return {each: config for each, config in configs.items() if config != recorded}


def _leaves(values: Mapping[str, Any]) -> Iterator[tuple[Loc, Any]]:
    for loc in leaf_keys(dict(values)):
        value: Any = values
        for part in loc:
            value = value[part]
        yield loc, value


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 60 else f"{text[:59]}…"
