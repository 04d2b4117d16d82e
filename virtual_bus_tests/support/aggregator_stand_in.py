"""The rules of diagnostic_aggregator (github.com/ros/diagnostics), in our words: its package is not on PyPI.

GenericAnalyzer: an entry matches by `startswith`, `contains` or `expected`; every analyzer that matches takes it; what
none takes is in "Other". `remove_prefix` shortens the shown name. An entry is stale after `timeout`, or when it is
expected and never came; a group with a stale entry is an error, and stale where all its entries are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

OK, WARN, ERROR, STALE = 0, 1, 2, 3
"""diagnostic_msgs/DiagnosticStatus."""
GENERIC, GROUP = "diagnostic_aggregator/GenericAnalyzer", "diagnostic_aggregator/AnalyzerGroup"
KEYS = {"type", "path", "startswith", "contains", "expected", "remove_prefix", "find_and_remove_prefix", "timeout"}


@dataclass
class Analyzer:
    """A GenericAnalyzer."""

    path: str
    keys: dict[str, Any]
    items: dict[str, tuple[int, float]] = field(default_factory=dict)
    """By name: level, and when it came."""

    def __post_init__(self) -> None:
        unknown = set(self.keys) - KEYS
        assert not unknown, f"{self.path}: GenericAnalyzer has no key {unknown}"
        assert isinstance(self.keys.get("timeout", 5.0), float), "as_double() of a whole number ends the aggregator"
        self.items = dict.fromkeys(self.keys.get("expected", ()), (STALE, 0.0))

    def matches(self, name: str) -> bool:
        """`expected` alone matches in some versions only, so it does not here."""
        starts = [*self.keys.get("startswith", ()), *self.keys.get("find_and_remove_prefix", ())]
        return any(name.startswith(start) for start in starts) or any(
            part in name for part in self.keys.get("contains", ())
        )

    def shown(self, name: str) -> str:
        """Its path in rqt_robot_monitor."""
        for prefix in [*self.keys.get("remove_prefix", ()), *self.keys.get("find_and_remove_prefix", ())]:
            name = name.removeprefix(prefix)
        return f"{self.path}/{name.lstrip(': ')}"

    def level(self, now_s: float) -> int:
        """Of the group."""
        timeout_s: float = self.keys.get("timeout", 5.0)
        levels: list[int] = [STALE if now_s - at_s > timeout_s else level for level, at_s in self.items.values()]
        stale = [level == STALE for level in levels]
        if all(stale):
            return STALE
        return ERROR if any(stale) else max(levels)


class Aggregator:
    """aggregator_node with the parameters of one file."""

    def __init__(self, parameters: dict[str, Any]) -> None:
        keys = dict(parameters["analyzers"]["ros__parameters"])
        self.root = f"/{keys.pop('path')}"
        self.analyzers = [analyzer for key in keys.values() for analyzer in _made(self.root, key)]
        self.other: list[str] = []

    def take(self, entries: list[DiagnosticStatus], now_s: float) -> None:
        """One message of /diagnostics."""
        for entry in entries:
            matching = [analyzer for analyzer in self.analyzers if analyzer.matches(entry.name)]
            for analyzer in matching:
                analyzer.items[entry.name] = entry.level[0], now_s
            if not matching:
                self.other.append(entry.name)

    def paths(self) -> list[str]:
        """Of each entry, as often as it is shown."""
        return [analyzer.shown(name) for analyzer in self.analyzers for name in analyzer.items]

    def levels(self, now_s: float) -> dict[str, int]:
        """Of each group."""
        return {analyzer.path: analyzer.level(now_s) for analyzer in self.analyzers}


def _made(path: str, keys: dict[str, Any]) -> list[Analyzer]:
    if keys["type"] == GROUP:
        below = f"{path}/{keys['path']}"
        return [analyzer for key in keys["analyzers"].values() for analyzer in _made(below, key)]
    assert keys["type"] == GENERIC
    return [Analyzer(f"{path}/{keys['path']}", keys)]
