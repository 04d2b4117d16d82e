"""Store and restore parameters, 1010h and 1011h (CiA 301): each takes its signature, and reads 1 afterwards."""

from __future__ import annotations

from collections.abc import Callable

from canopen import SdoAbortedError

from canbase_sim.cia301 import abort
from canbase_sim.cia301.dictionary import Dictionary, key

STORE, RESTORE = 0x1010, 0x1011
SAVE, LOAD = 0x65766173, 0x64616F6C
"""The signatures "save" and "load"."""


class StoreService:
    """Lets 1010h:1 keep the writable values of `dictionary`, and 1011h:1 forget them."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        dictionary.guard(STORE, lambda subindex, value: _check(value, SAVE))
        dictionary.guard(RESTORE, lambda subindex, value: _check(value, LOAD))
        dictionary.on_write(STORE, lambda subindex, value: self._act(dictionary.save))
        dictionary.on_write(RESTORE, lambda subindex, value: self._act(dictionary.forget))

    def _act(self, act: Callable[[], None]) -> None:
        act()
        self._dictionary.values[key(STORE, 1)] = self._dictionary.values[key(RESTORE, 1)] = 1


def _check(value: int, signature: int) -> None:
    if value != signature:
        raise SdoAbortedError(abort.CANNOT_STORE)
