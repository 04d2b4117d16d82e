"""Nodes that publish velocities without being expected: on sources' topics, on cmd_vel_mux and on cmd_vel.

A ROS message does not contain its publisher, so they are found in the ROS graph. mux_node.py queries the graph.

Rules:
1. On a source's topic those are foreign that its `nodes` do not name; without `nodes` anybody may publish there.
2. cmd_vel_mux and cmd_vel belong to one node each; every other publisher, and a second one of that name, is foreign.
   Nothing obeys cmd_vel_mux: it shows what the mux orders. A foreign publisher there is a notice and disturbs nothing.
3. A publisher of another message type is not received at all. That is reported, and it disturbs nothing.
4. A publisher whose node is not known (yet) counts after PATIENCE_S: discovery finds names a little later than topics.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from canbase_runtime.log_priority import Priority

PATIENCE_S = 2.0
UNKNOWN = "an unknown node"


@dataclass(frozen=True, slots=True)
class Expected:
    """What is right on one topic (its full name). `source`: whose topic it is; None: the chain's own."""

    topic: str
    kind: str
    source: str | None
    nodes: tuple[str, ...]
    """Full names of the nodes that may publish there; empty: anybody."""
    alone: bool = False
    """One publisher at most."""
    shown: bool = False
    """Published for people to look at: nothing obeys it."""


@dataclass(frozen=True, slots=True)
class Publisher:
    """A publisher in the ROS graph. `node`: namespace and name; empty: not known. `key`: no other one ever has it."""

    node: str
    kind: str
    key: str = ""


@dataclass(frozen=True, slots=True)
class Foreign:
    """A publisher that is wrong where it is. `source`: whose topic it is; None: the chain's own."""

    topic: str
    node: str
    kind: str
    problem: str
    source: str | None
    obeyed: bool
    """Its messages are obeyed: of the right type, on a topic that counts."""
    shown: bool = False
    """It is on a topic that nothing obeys."""

    @property
    def priority(self) -> Priority:
        """How grave it is."""
        return Priority.NOTICE if self.shown else Priority.ERROR

    @property
    def sentence(self) -> str:
        """What is wrong, for people."""
        return f"{self.node} publishes on {self.topic}: {self.problem}"

    def disturbs(self, source: str) -> bool:
        """Whether the commands of `source` cannot be trusted for it: on its own topic, or on what all of them share."""
        return self.obeyed and self.source in (None, source)


class ForeignWatch:
    """Finds them; remembers since when a publisher without a name is there."""

    def __init__(self, expected: Sequence[Expected]) -> None:
        self.expected = tuple(expected)
        self._unknown_since: dict[str, float] = {}

    def look(self, graph: Mapping[str, Sequence[Publisher]], now_s: float) -> tuple[Foreign, ...]:
        """All foreign publishers among those in the graph, by topic, at time `now_s` [s, monotonic]."""
        unknown = {topic for topic, publishers in graph.items() if any(not p.node for p in publishers)}
        self._unknown_since = {topic: self._unknown_since.get(topic, now_s) for topic in sorted(unknown)}
        return tuple(
            found for expected in self.expected for found in self._on(expected, graph.get(expected.topic, ()), now_s)
        )

    def _on(self, expected: Expected, publishers: Sequence[Publisher], now_s: float) -> list[Foreign]:
        patient = now_s - self._unknown_since.get(expected.topic, now_s) < PATIENCE_S
        counts = Counter(publisher.node for publisher in publishers if publisher.kind == expected.kind)
        found = []
        for publisher in sorted(set(publishers), key=lambda p: (p.node, p.kind)):
            problem = _problem(publisher, expected, counts[publisher.node])
            if problem and (publisher.node or not patient):
                node, obeyed = publisher.node or UNKNOWN, publisher.kind == expected.kind and not expected.shown
                found.append(
                    Foreign(expected.topic, node, publisher.kind, problem, expected.source, obeyed, expected.shown)
                )
        return found


def _problem(publisher: Publisher, expected: Expected, count: int) -> str:
    """Empty: there is none."""
    if publisher.kind != expected.kind:
        return f"of type {publisher.kind}, which is not received; expected {expected.kind}"
    if not expected.nodes:
        return ""
    if publisher.node not in expected.nodes:
        nobody = "; it does not move the base" if expected.shown else ""
        return f"only {' and '.join(expected.nodes)} should{nobody}"
    return f"{count} times; is it running twice?" if expected.alone and count > 1 else ""
