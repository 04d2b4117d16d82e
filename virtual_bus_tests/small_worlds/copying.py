"""Copies of a whole world, made as often as wanted from one snapshot.

Pickle copies all but closures and generators. So a closure is copied with its cells, and the boot of a drive, which is
the one generator, is gone through again with the answers that it got. What never changes is shared.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable
from contextlib import suppress
from enum import Enum
from functools import cache
from random import Random
from struct import Struct
from types import CellType, FunctionType, MappingProxyType
from typing import Any

import numpy as np

from canbase_driver.boot import node_boot
from canbase_driver.boot.sequence import boot
from canbase_driver.boot.steps import BootError, Step
from canbase_driver.cia301.sdo_client import SdoTimeout

_SHARED = (Enum, Random, Struct, MappingProxyType, np.ndarray)
"""Kinds that are never changed: of chance nothing is left in a small world."""
_things: list[Any] = []
"""What the snapshot that is being restored shares with its copies."""


class Snapshot:
    """How `thing`, and all that it refers to, is now."""

    def __init__(self, thing: Any) -> None:
        """Raises TypeError or pickle.PicklingError for what cannot be copied."""
        with io.BytesIO() as file:
            pickler = _Pickler(file)
            pickler.dump(thing)
            self._data, self._things = file.getvalue(), pickler.things

    def restore(self) -> Any:
        """A new copy."""
        global _things
        _things = self._things
        return pickle.loads(self._data)


class _Boot:
    """The steps of one boot, as canbase_driver.boot.sequence has them, with every answer."""

    def __init__(self, *of: Any, **named: Any) -> None:
        self._begin(of, named)

    def _begin(self, of: tuple[Any, ...], named: dict[str, Any]) -> None:
        self._of, self._named = of, named
        self._answers: list[Any] = []
        self._steps = boot(*of, **named)

    def send(self, answer: bytes | bool | None) -> Step:
        self._note(answer)
        return self._steps.send(answer)

    def throw(self, error: Exception) -> Step:
        self._note(error)
        return self._steps.throw(error)

    def _note(self, answer: Any) -> None:
        """A boot waits for ever for a drive that does not answer: its second round is its first one."""
        self._answers.append(answer)
        first, second = self._answers[1:3], self._answers[3:]
        if any(isinstance(each, SdoTimeout) for each in first) and repr(first) == repr(second):
            del self._answers[3:]

    def __getstate__(self) -> tuple[Any, Any, list[Any]]:
        return self._of, self._named, self._answers

    def __setstate__(self, state: tuple[Any, Any, list[Any]]) -> None:
        of, named, answers = state
        self._begin(of, named)
        for answer in answers:
            with suppress(StopIteration, BootError):
                self.throw(answer) if isinstance(answer, Exception) else self.send(answer)


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self.things: list[Any] = []
        self._places: dict[int, int] = {}

    def reducer_override(self, thing: Any) -> Any:
        kind: Any = type(thing)
        if kind is FunctionType:
            return self._function(thing)
        if kind is CellType:
            return _cell, (), (thing.cell_contents,), None, None, _fill
        if issubclass(kind, Exception):
            return _error, (kind, thing.args), vars(thing)
        return self._share(thing) if _is_shared(kind) else NotImplemented

    def _function(self, thing: FunctionType) -> Any:
        if thing.__closure__:
            return _function, (self._place(thing), thing.__closure__)
        return self._share(thing) if "<" in thing.__qualname__ else NotImplemented

    def _share(self, thing: Any) -> tuple[Callable[[int], Any], tuple[int]]:
        return _thing, (self._place(thing),)

    def _place(self, thing: Any) -> int:
        if id(thing) not in self._places:
            self._places[id(thing)] = len(self.things)
            self.things.append(thing)
        return self._places[id(thing)]


@cache
def _is_shared(kind: type[Any]) -> bool:
    return issubclass(kind, _SHARED) or kind.__module__.startswith("canbase_config")


def _thing(place: int) -> Any:
    return _things[place]


def _function(place: int, cells: tuple[CellType, ...]) -> FunctionType:
    of = _things[place]
    made = FunctionType(of.__code__, of.__globals__, of.__name__, of.__defaults__, cells)
    made.__kwdefaults__, made.__qualname__ = of.__kwdefaults__, of.__qualname__
    return made


def _error(kind: type[Exception], arguments: tuple[Any, ...]) -> Exception:
    return kind.__new__(kind, *arguments)


def _cell() -> CellType:
    return CellType()


def _fill(cell: CellType, contents: tuple[Any]) -> None:
    (cell.cell_contents,) = contents


setattr(node_boot, "boot", _Boot)  # noqa: B010 - what is replaced is a function
