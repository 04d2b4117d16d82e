"""Sources of the mux whose topics are wrong where this node runs: its own outputs, or one topic twice. Pure.

robot.yaml refuses what can be seen there. Which topic an absolute name is, and what a remap makes of a name, is known
when the node has its namespace: in robot1, /robot1/cmd_vel is the output of the filter.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping


def wrong_topic(sources: Mapping[str, str], outputs: Collection[str]) -> str:
    """What is wrong with the full names of the topics of `sources`, by name of the source; empty: nothing.

    `outputs`: full names of topics that this robot publishes, with which it would follow itself.
    """
    first: dict[str, str] = {}
    for name, topic in sources.items():
        if topic in outputs:
            return f"mux.sources.{name}: its topic is {topic} here, an output of this robot; give it another topic"
        other = first.setdefault(topic, name)
        if other != name:
            return f"mux.sources.{other} and {name} both have the topic {topic} here; give each its own"
    return ""
