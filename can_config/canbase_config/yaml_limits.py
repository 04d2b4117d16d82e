"""How much a YAML file may be: depth, values, digits, with every alias written out. Beyond it the reading ends at once.

A few lines can stand for a million values: `b: [*a, *a]`, `c: [*b, *b]`, and so on.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Any, Final

from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import AliasEvent
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

MAX_BYTES: Final = 256_000
"""Ten times the sample with all its comments."""
MAX_VALUES: Final = 5_000
"""Keys count too."""
MAX_DEPTH: Final = 32
MAX_BRACKETS: Final = 100
"""Open in one line: ruamel.yaml's work there grows with the square of their number, before it builds anything."""
MAX_DIGITS: Final = 40
"""Of a number: more than any type of CANopen has."""
MAX_CHARACTERS: Final = 4_000
"""Of a text."""
_NUMBERS: Final = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")


def line_of_brackets(text: str) -> int:
    """The first line, from 1, with more than MAX_BRACKETS open at once, wherever they stand in it; 0: none."""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.count("[") + line.count("{") > MAX_BRACKETS:
            depths = accumulate((one in "[{") - (one in "]}") for one in line)
            if max(depths) > MAX_BRACKETS:
                return number
    return 0


class ExcessError(MarkedYAMLError):
    """The file goes beyond a limit. `problem` names it, `problem_mark` has the place."""


class BoundedComposer(Composer):
    """Counts while it builds, so that it can give up in time."""

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader)
        self.warn_double_anchors = False  # YAML allows them, and a file may have thousands
        self._begin()

    def _begin(self) -> None:
        self._open = self._nodes = 0
        self._extents: dict[int, tuple[int, int]] = {}
        """Of each whole node, by its identity: values, and depth."""

    def compose_document(self) -> Any:
        """As Composer; counts from zero."""
        self._begin()
        return super().compose_document()

    def compose_node(self, parent: Any, index: Any) -> Any:
        """As Composer. Raises ExcessError."""
        is_alias = self.parser.check_event(AliasEvent)
        mark = self.parser.peek_event().start_mark
        self._nodes += 1
        self._refuse(self._nodes, self._open, mark)
        self._open += 1
        node = super().compose_node(parent, index)
        self._open -= 1
        if is_alias and id(node) not in self._extents:
            raise ExcessError(None, None, "an alias (*name) contains itself", mark)
        if not is_alias:
            self._extents[id(node)] = self._extent(node)
        self._refuse(*self._extents[id(node)], mark)
        return node

    def _extent(self, node: Node) -> tuple[int, int]:
        if isinstance(node, ScalarNode):
            _refuse_long(node)
        below = [self._extents[id(one)] for one in _children(node)]
        return 1 + sum(values for values, _ in below), 1 + max((depth for _, depth in below), default=0)

    @staticmethod
    def _refuse(values: int, depth: int, mark: Any) -> None:
        if values > MAX_VALUES:
            raise ExcessError(None, None, f"more than {MAX_VALUES} values, with every alias (*name) written out", mark)
        if depth > MAX_DEPTH:
            raise ExcessError(None, None, f"nested too deeply: more than {MAX_DEPTH} levels", mark)


def _children(node: Node) -> list[Node]:
    if isinstance(node, MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, SequenceNode) else []


def _refuse_long(node: ScalarNode) -> None:
    most, what = (MAX_DIGITS, "digits") if node.tag in _NUMBERS else (MAX_CHARACTERS, "characters")
    if len(node.value) > most:
        raise ExcessError(None, None, f"a value of {len(node.value)} {what}, expected at most {most}", node.start_mark)
