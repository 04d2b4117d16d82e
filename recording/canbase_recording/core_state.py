"""Puts the recorded state of mux and filter into new ones. Pure; canbase_velocity.core_state writes it.

A recording may come from anybody. Nothing of it is called: an object is one of the classes that CLASSES names, made
without its constructor, and gets attributes that its class has. What belongs to the configuration stays as the new
core has it.
"""

from __future__ import annotations

import base64
import binascii
from collections import deque
from collections.abc import Mapping
from enum import Enum
from typing import Any, Final

import numpy as np

from canbase_base import latch_record
from canbase_recording.input_lines import NoInputsError
from canbase_runtime.driver_state import DriverState
from canbase_runtime.source_standing import SourceStanding
from canbase_runtime.stop_cause import StopCause
from canbase_velocity import (
    base_ready,
    clearance,
    decision,
    delay,
    estop,
    filter_state,
    frozen,
    glitch,
    lock,
    motion,
    mux,
    neutral,
    placement,
    ramp,
    sole_publisher,
    twist,
    unexpected_publishers,
)

_MODULES: Final = (
    base_ready, clearance, decision, delay, estop, filter_state, frozen, glitch, lock, motion, mux, neutral, placement,
    ramp, sole_publisher, twist, unexpected_publishers, latch_record,
)  # fmt: skip
CLASSES: Final = {
    f"{kind.__module__}:{kind.__qualname__}": kind
    for kind in [
        *(each for module in _MODULES for each in vars(module).values() if isinstance(each, type)),
        *(DriverState, SourceStanding, StopCause),
    ]
    if kind.__module__.startswith(("canbase_velocity.", "canbase_runtime.", "canbase_base."))
}
"""Of the pure cores: none of them opens or starts anything."""
BROKEN: Final = (
    KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError, AssertionError, binascii.Error,
)  # fmt: skip
"""What values that do not fit raise, here and in a core."""
_KINDS: Final = ("<f8", "<f4", "<i8", "<i4", "|b1")
_DEEPEST: Final = 40


def restore(state: Any, like: Any, before: Any = None) -> Any:
    """`like`: new cores, which get the state. `before`: new cores of the recorded configuration; None: `like` are.

    What the state has as `before` has it follows from the configuration: there `like` keeps its own. Raises
    NoInputsError for what is no state.
    """
    try:
        return _Decoder().value(state, like, like if before is None else before, 0)
    except BROKEN as error:
        raise NoInputsError(f"no state of mux and filter: {str(error)[:80]}") from error


def array(values: Mapping[str, Any]) -> Any:
    """Raises ValueError, KeyError or TypeError for what is none."""
    kind = values["kind"]
    if kind not in _KINDS:
        raise ValueError(f"{str(kind)[:20]} is no kind of number here")
    data = base64.b64decode(values["array"], validate=True)
    return np.frombuffer(data, dtype=kind).reshape([int(size) for size in values["shape"]])


class _Decoder:
    """Remembers the objects by their numbers."""

    def __init__(self) -> None:
        self._made: dict[int, Any] = {}

    def value(self, told: Any, like: Any, before: Any, depth: int) -> Any:
        if depth > _DEEPEST:
            raise ValueError("too deep")
        if isinstance(told, list):
            return [self.value(each, None, None, depth + 1) for each in told]
        if not isinstance(told, dict):
            return told
        if "of" in told:
            return self._object(told, like, before, depth)
        if "dict" in told:
            return self._dict(told["dict"], like, before, depth)
        return self._plain(told, like, before, depth)

    def _plain(self, told: Mapping[str, Any], like: Any, before: Any, depth: int) -> Any:
        if "same" in told:
            return self._made[told["same"]]
        if "config" in told:
            return like
        if "float" in told:
            return float(told["float"])
        if "bytes" in told:
            return base64.b64decode(told["bytes"], validate=True)
        if "array" in told:
            return array(told)
        if "enum" in told:
            return _enum(told)
        return self._sequence(told, like, before, depth)

    def _sequence(self, told: Mapping[str, Any], like: Any, before: Any, depth: int) -> Any:
        name, kind = next(((name, kind) for name, kind in _SEQUENCES.items() if name in told), ("", tuple))
        likes = list(like) if isinstance(like, (tuple, deque)) else []
        befores = list(before) if isinstance(before, (tuple, deque)) else []
        found = [
            self.value(each, _at(likes, place), _at(befores, place), depth + 1) for place, each in enumerate(told[name])
        ]
        return deque(found, told["maxlen"]) if kind is deque else kind(found)

    def _dict(self, pairs: Any, like: Any, before: Any, depth: int) -> dict[Any, Any]:
        like, before = like if isinstance(like, dict) else {}, before if isinstance(before, dict) else {}
        if any(isinstance(value, dict) and "of" in value for _, value in pairs):
            return self._named(pairs, like, before, depth)
        return {
            self.value(key, None, None, depth + 1): self.value(value, None, None, depth + 1) for key, value in pairs
        }

    def _named(self, pairs: Any, like: dict[Any, Any], before: dict[Any, Any], depth: int) -> dict[Any, Any]:
        """Sources, locks and scanners: those that the new configuration has."""
        known = {
            key: self.value(value, like.get(key, before.get(key)), before.get(key), depth + 1) for key, value in pairs
        }
        return {key: known.get(key, value) for key, value in like.items()}

    def _object(self, told: Mapping[str, Any], like: Any, before: Any, depth: int) -> Any:
        kind = CLASSES[told["of"]]
        thing = like if type(like) is kind and not _is_frozen(kind) else object.__new__(kind)
        self._made[told["number"]] = thing
        for name, value in told["state"].items():
            if name not in _names(kind, like):
                raise ValueError(f"{kind.__name__} has no {str(name)[:40]}")
            old, first = getattr(like, name, None), getattr(before, name, None)
            new = self.value(value, old, first, depth + 1)
            if not (like is not None and like is not before and _is_same(new, first)):
                object.__setattr__(thing, name, new)
            elif thing is not like:
                object.__setattr__(thing, name, old)
        return thing


_SEQUENCES: Final[Mapping[str, Any]] = {"tuple": tuple, "frozenset": frozenset, "deque": deque}


def _at(values: list[Any], place: int) -> Any:
    return values[place] if place < len(values) else None


def _enum(told: Mapping[str, Any]) -> Any:
    kind = CLASSES[told["enum"]]
    if not issubclass(kind, Enum):
        raise TypeError(f"{kind.__name__} is no enum")
    return kind[told["name"]]


def _is_frozen(kind: type) -> bool:
    parameters = getattr(kind, "__dataclass_params__", None)
    return parameters is not None and parameters.frozen


def _names(kind: type, like: Any) -> set[str]:
    """Attributes that an object of this class has. A plain class shows them on an object alone."""
    slots = {name for each in kind.__mro__ for name in getattr(each, "__slots__", ())}
    own = set(vars(like)) if hasattr(like, "__dict__") else set()
    return slots | own | _PLAIN.get(kind, set())


def _is_same(one: Any, two: Any) -> bool:
    simple = (bool, int, float, str, type(None))
    return isinstance(one, simple) and isinstance(two, simple) and one == two


_PLAIN: Final[Mapping[type, set[str]]] = {}
"""Classes without slots whose objects come to be only later: none today."""
