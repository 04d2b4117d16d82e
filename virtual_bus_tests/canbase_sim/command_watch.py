"""The manufacturer's own watchdog of some drives, beside CiA 301: motors that get no commands for too long stop."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from canbase_sim.cia301.dictionary import Dictionary
from canbase_sim.cia301.rpdo import Rpdo


class CommandWatch:
    """Counts from the last RPDO. Its time is fixed, or in ms in an object (0: off), by the personality."""

    def __init__(self, dictionary: Dictionary, rpdos: Sequence[Rpdo]) -> None:
        self._values, self._rpdos = dictionary.values, rpdos
        self._fixed_s = dictionary.personality.command_timeout_s
        self._object = dictionary.personality.command_timeout_object
        self._told = -inf

    def ran_out(self, now_s: float) -> bool:
        """True once for each last command that is older than the time; without one there is nothing to stop."""
        timeout_s = self._fixed_s if self._object is None else self._values[self._object] / 1000.0
        if not timeout_s:
            return False
        last = max(rpdo.received_at for rpdo in self._rpdos)
        if last == self._told or now_s - last <= timeout_s:
            return False
        self._told = last
        return last != -inf
