"""One bus opened at one bit rate after the other; in the end its interface is as it was, or at the new rate."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from canbase_commissioning.can_interface import Link, parse_link
from canbase_commissioning.guide import Ask, CommissionError
from canbase_commissioning.link_rate import as_text, commands
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.onbus.operator import Person, answered
from canbase_config.bit_rate import BIT_RATES, bus_at
from canbase_config.robot import Bus
from canbase_runtime.terminal import FAILED, fail

IP_S: Final = 5.0
THINKING_S: Final = 0.02
"""Between two looks whether the person has answered."""


class Cable:
    """`bus` has the bit rate that is wanted in the end. `rates`: those that it can be opened at [bit/s]."""

    def __init__(self, bus: Bus, person: Person, *, sets_link: bool) -> None:
        """`sets_link`: the command may call `ip link`; otherwise the person does. Exits with 1 where it cannot."""
        self.bus, self._person, self._sets_link = bus, person, sets_link
        self.link = read_link(bus.channel) if bus.interface == "socketcan" else None
        self.is_kept = False
        """The bit rate that it has now is the right one: it is not set back at the end."""
        self._rate = self.link.bitrate if self.link else 0
        if sets_link and self.link and os.geteuid() != 0:
            fail("--set-link calls ip link, which needs root: sudo canbase bus adopt …", FAILED)

    @property
    def has_rate(self) -> bool:
        """False for vcan: it has no bit rate, and whoever is on it has the same."""
        return self.link is None or self.link.kind != "vcan"

    @property
    def rates(self) -> tuple[int, ...]:
        """All of them, or the one that the interface has where only a person may change it."""
        if self.link is None or self._sets_link:
            return BIT_RATES
        return (self._rate or self.bus.bitrate,)

    @contextmanager
    def at(self, bitrate: int, *, listen_only: bool = False) -> Iterator[BusSession]:
        """The bus at this bit rate. Exits with 1 where it cannot be opened."""
        if self.link is not None and self.has_rate and (bitrate != self._rate or self._sets_link):
            self._set(self.link, bitrate, listen_only=listen_only and self._sets_link)
        with open_line(bus_at(self.bus, bitrate)) as line:
            yield line

    def give_back(self) -> None:
        """The interface as it was."""
        if self.link is not None and self._sets_link and not self.is_kept and self.link.bitrate:
            self._set(self.link, self.link.bitrate)

    def hint(self) -> str:
        """How to look at the other bit rates, where this command may not set them; empty: it did."""
        if self.link is None or self._sets_link or not self.has_rate:
            return ""
        shown = as_text(commands(self.link, BIT_RATES[4]))
        return f". Only {self._rate} bit/s was tried: add --set-link (root), or set another one and try again:\n{shown}"

    def _set(self, link: Link, bitrate: int, *, listen_only: bool = False) -> None:
        lines = commands(link, bitrate, listen_only=listen_only)
        if self._sets_link:
            for words in lines:
                _run(words)
        else:
            text = f"The interface needs {bitrate} bit/s. In another terminal:\n{as_text(lines)}\nDone?"
            answered(self._person, Ask("link", text, confirms=True), lambda: time.sleep(THINKING_S))
        there = read_link(link.name)
        if there is None or not there.is_up or there.bitrate != bitrate:
            found = "is not there" if there is None else f"has {there.bitrate} bit/s" if there.is_up else "is down"
            raise CommissionError(f"{link.name} {found}, {bitrate} bit/s is needed")
        self._rate = bitrate


def _run(words: tuple[str, ...]) -> None:
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=IP_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        fail(f"{' '.join(words)}: {error}", FAILED)
    if done.returncode:
        fail(f"{' '.join(words)}: {done.stderr.strip()}", FAILED)


def read_link(channel: str) -> Link | None:
    """What `ip` reports about an interface; None where there is none."""
    words = ["ip", "-details", "-statistics", "-json", "link", "show", channel]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=IP_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return parse_link(done.stdout)
