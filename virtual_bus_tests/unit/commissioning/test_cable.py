"""The bit rate of a SocketCAN interface, set and given back: with a made-up `ip`, as no interface is at hand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from canbase_commissioning.can_interface import Link
from canbase_commissioning.guide import CommissionError
from canbase_commissioning.onbus import cable
from canbase_commissioning.onbus.cable import Cable
from canbase_commissioning.onbus.operator import Operator
from canbase_config.robot import Bus
from canbase_runtime.terminal import CommandError

CAN0 = Bus(interface="socketcan", channel="can0", bitrate=500_000, extra={})


class Ip:
    """One interface; `deaf`: it does not obey."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, kind: str = "can") -> None:
        self.link = Link("can0", kind, is_up=True, bitrate=500_000, restart_ms=100, queue_length=10)
        self.said: list[str] = []
        self.deaf = False
        monkeypatch.setattr(cable, "read_link", lambda channel: self.link)
        monkeypatch.setattr(cable, "_run", self._run)
        monkeypatch.setattr(cable, "open_line", self._open)
        monkeypatch.setattr("os.geteuid", lambda: 0)

    def _run(self, words: tuple[str, ...]) -> None:
        self.said.append(" ".join(words))
        if "bitrate" in words and not self.deaf:
            self.link = replace(self.link, bitrate=int(words[words.index("bitrate") + 1]))

    @contextmanager
    def _open(self, bus: Bus) -> Iterator[Bus]:
        self.said.append("open")
        yield bus


def test_it_listens_only_and_gives_the_interface_back_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    ip = Ip(monkeypatch)
    wire = Cable(CAN0, Operator(None, yes=True), sets_link=True)
    with wire.at(125_000, listen_only=True):
        assert ip.link.bitrate == 125_000
    assert ip.said == [
        "ip link set can0 down",
        "ip link set can0 type can bitrate 125000 restart-ms 0 listen-only on",
        "ip link set can0 txqueuelen 10 up",
        "open",
    ]
    wire.give_back()
    assert ip.said[-2] == "ip link set can0 type can bitrate 500000 restart-ms 100 listen-only off"


def test_the_new_bit_rate_is_kept_when_the_drives_have_it(monkeypatch: pytest.MonkeyPatch) -> None:
    ip = Ip(monkeypatch)
    wire = Cable(CAN0, Operator(None, yes=True), sets_link=True)
    with wire.at(250_000):
        wire.is_kept = True
    wire.give_back()
    assert ip.link.bitrate == 250_000


def test_an_interface_that_does_not_take_the_bit_rate_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    ip = Ip(monkeypatch)
    ip.deaf = True
    wire = Cable(CAN0, Operator(None, yes=True), sets_link=True)
    with pytest.raises(CommissionError, match="can0 has 500000 bit/s, 125000 bit/s is needed"), wire.at(125_000):
        pass
    assert "open" not in ip.said


def test_without_set_link_one_bit_rate_is_tried_and_the_commands_for_the_others_are_printed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ip = Ip(monkeypatch)
    wire = Cable(CAN0, Operator(None, yes=True), sets_link=False)
    assert wire.rates == (500_000,)
    with wire.at(500_000):
        assert ip.said == ["open"]
    assert "add --set-link (root)" in wire.hint()
    assert "sudo ip link set can0 type can bitrate 125000" in wire.hint()
    with pytest.raises(CommissionError, match="can0 has 500000 bit/s"), wire.at(125_000):
        pass  # --yes says that the person has set it, and the interface says that nobody has


def test_vcan_has_no_bit_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    ip = Ip(monkeypatch, "vcan")
    wire = Cable(CAN0, Operator(None, yes=True), sets_link=False)
    assert not wire.has_rate
    with wire.at(125_000):
        assert ip.said == ["open"]


def test_to_set_the_interface_one_has_to_be_root(monkeypatch: pytest.MonkeyPatch) -> None:
    Ip(monkeypatch)
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    with pytest.raises(CommandError, match="needs root"):
        Cable(CAN0, Operator(None, yes=True), sets_link=True)
