"""Nodes that publish without being expected: on sources' topics, and on the topics of the chain (chain_topics.py).

A ROS message does not contain its publisher, so they are found in the ROS graph. mux_node.py queries the graph.

Rules:
1. On a source's topic those are foreign that its `nodes` do not name; without `nodes` anybody may publish there.
2. A topic of the chain belongs to one node; every other publisher, and a second one of that name, is foreign. One that
   was killed counts until DDS removes it, after about 20 s. Nothing obeys cmd_vel_mux: it shows what the mux orders. A
   foreign publisher there is a notice and disturbs nothing. One on a state ends goals; sources are not disturbed.
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
    obeyed: bool = True
    """What arrives there moves the base."""
    shown: bool = False
    """Published for people to look at: nothing obeys it."""
    consequence: str = ""
    """Ends the sentence about a foreign publisher."""


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
    """Its messages are obeyed: of the right type, on a topic of velocities that counts."""
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

    def check_graph(self, graph: Mapping[str, Sequence[Publisher]], now_s: float) -> tuple[Foreign, ...]:
        """All foreign publishers among those in the graph, by topic, at time `now_s` [s, monotonic]."""
        unknown = {topic for topic, publishers in graph.items() if any(not p.node for p in publishers)}
        self._unknown_since = {topic: self._unknown_since.get(topic, now_s) for topic in sorted(unknown)}
        return tuple(
            found for expected in self.expected for found in self._on(expected, graph.get(expected.topic, ()), now_s)
        )

    def _on(self, expected: Expected, publishers: Sequence[Publisher], now_s: float) -> list[Foreign]:
        patient = now_s - self._unknown_since.get(expected.topic, now_s) < PATIENCE_S
        counts = Counter(publisher.node for publisher in publishers if publisher.kind == expected.kind)
        foreign = []
        for node, kind in sorted({(publisher.node, publisher.kind) for publisher in publishers}):
            problem = _problem(node, kind, expected, counts[node])
            if problem and (node or not patient):
                obeyed = kind == expected.kind and expected.obeyed
                foreign.append(
                    Foreign(expected.topic, node or UNKNOWN, kind, problem, expected.source, obeyed, expected.shown)
                )
        return foreign


def _problem(node: str, kind: str, expected: Expected, count: int) -> str:
    """Empty: there is none."""
    if kind != expected.kind:
        return f"of type {kind}, which is not received; expected {expected.kind}"
    if not expected.nodes:
        return ""
    if node not in expected.nodes:
        return f"only {' and '.join(expected.nodes)} should{expected.consequence}"
    return f"{count} times; is it running twice?{expected.consequence}" if expected.alone and count > 1 else ""
