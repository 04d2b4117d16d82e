"""The state of mux and filter as plain values for JSON: what a recording begins with. No clock, no file.

`canbase record replay` puts it into new cores (canbase_recording.core_state). What belongs to the configuration is
left out: the new cores have it already, or another one.
"""

from __future__ import annotations

import base64
import math
from collections import deque
from collections.abc import Iterator
from enum import Enum
from typing import Any, Final

import numpy as np

OURS: Final = ("canbase_velocity.", "canbase_runtime.", "canbase_base.")
CONFIG: Final = "canbase_config."


def plain(thing: Any) -> Any:
    """Raises TypeError for what is no state of a core: a function, a handle."""
    return _Encoder().plain(thing)


class _Encoder:
    """What is referred to twice is written once."""

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}
        self._kept: list[Any] = []

    def plain(self, thing: Any) -> Any:
        if thing is None or isinstance(thing, (bool, str)) or type(thing) is int:
            return thing
        if isinstance(thing, Enum):
            return {"enum": _name(type(thing)), "name": thing.name}
        if isinstance(thing, float):
            return thing if math.isfinite(thing) else {"float": str(thing)}
        if isinstance(thing, bytes):
            return {"bytes": base64.b64encode(thing).decode()}
        if isinstance(thing, np.ndarray):
            return array(thing)
        return self._compound(thing)

    def _compound(self, thing: Any) -> Any:
        if type(thing) is list:
            return [self.plain(each) for each in thing]
        if type(thing) is dict:
            return {"dict": [[self.plain(key), self.plain(value)] for key, value in thing.items()]}
        if isinstance(thing, deque):
            return {"deque": [self.plain(each) for each in thing], "maxlen": thing.maxlen}
        if type(thing) in (tuple, frozenset):
            return {type(thing).__name__: [self.plain(each) for each in thing]}
        return self._object(thing)

    def _object(self, thing: Any) -> Any:
        module = type(thing).__module__
        if module.startswith(CONFIG):
            return {"config": type(thing).__name__}
        if not module.startswith(OURS):
            raise TypeError(f"{type(thing).__name__} is no state of a core")
        if id(thing) in self._numbers:
            return {"same": self._numbers[id(thing)]}
        self._numbers[id(thing)] = number = len(self._kept)
        self._kept.append(thing)
        return {
            "of": _name(type(thing)),
            "number": number,
            "state": {name: self.plain(value) for name, value in attributes(thing)},
        }


def attributes(thing: Any) -> Iterator[tuple[str, Any]]:
    """Of an object with slots, with a __dict__, or with both."""
    for kind in type(thing).__mro__:
        slots = kind.__dict__.get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name not in ("__dict__", "__weakref__") and hasattr(thing, name):
                yield name, getattr(thing, name)
    yield from getattr(thing, "__dict__", {}).items()


def array(values: Any) -> dict[str, Any]:
    """Numbers of one kind: exact, and short."""
    data = np.asarray(values)
    return {"array": base64.b64encode(data.tobytes()).decode(), "kind": data.dtype.str, "shape": list(data.shape)}


def _name(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"
