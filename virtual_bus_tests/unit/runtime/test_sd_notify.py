"""What a process tells systemd: one datagram socket stands in for it."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from canbase_base.sd_notify import ALIVE_PERIOD_S, Service


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(tmp_path / "notify"))
        receiver.setblocking(False)
        yield receiver


def heard(systemd: socket.socket) -> list[str]:
    lines = []
    while True:
        try:
            lines.append(systemd.recv(1024).decode())
        except BlockingIOError:
            return lines


def service_of(systemd: socket.socket) -> Service:
    return Service({"NOTIFY_SOCKET": systemd.getsockname()})


def test_the_first_turn_of_the_loop_says_ready(systemd: socket.socket) -> None:
    service_of(systemd).alive("BOOTING", 5.0)

    assert heard(systemd) == ["READY=1\nSTATUS=BOOTING\nWATCHDOG=1"]


def test_a_loop_that_turns_fast_tells_so_five_times_a_second(systemd: socket.socket) -> None:
    service = service_of(systemd)
    for turn in range(129):
        service.alive("ENABLED", 5.0 + turn / 128)

    assert heard(systemd)[1:] == ["WATCHDOG=1"] * 4  # at 0, 26, 52, 78, 104 of 128


@pytest.mark.parametrize(("later_s", "told"), [(ALIVE_PERIOD_S - 0.001, []), (ALIVE_PERIOD_S, ["WATCHDOG=1"])])
def test_a_sign_of_life_is_due_after_its_period(systemd: socket.socket, later_s: float, told: list[str]) -> None:
    service = service_of(systemd)
    service.alive("ENABLED", 0.0)
    heard(systemd)

    service.alive("ENABLED", later_s)

    assert heard(systemd) == told


def test_a_new_state_is_told_at_once_and_once(systemd: socket.socket) -> None:
    service = service_of(systemd)
    service.alive("ENABLED", 0.0)
    heard(systemd)

    service.alive("LATCHED: watchdog tripped", 0.01)
    service.alive("LATCHED: watchdog tripped", 0.02)

    assert heard(systemd) == ["STATUS=LATCHED: watchdog tripped"]


def test_an_orderly_end_is_told(systemd: socket.socket) -> None:
    service_of(systemd).stopping()

    assert heard(systemd) == ["STOPPING=1"]


def test_a_socket_in_the_abstract_namespace() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind("")  # the system chooses an abstract name
        name = receiver.getsockname().decode()
        receiver.setblocking(False)
        Service({"NOTIFY_SOCKET": "@" + name[1:]}).stopping()

        assert heard(receiver) == ["STOPPING=1"]


def test_without_systemd_nothing_happens() -> None:
    service = Service({})

    service.alive("ENABLED", 0.0)
    service.stopping()


def test_a_systemd_that_does_not_read_stops_nobody(systemd: socket.socket) -> None:
    service = service_of(systemd)
    for turn in range(2000):
        service.alive("ENABLED", float(turn))  # its queue has been full for long; without an exception, without waiting

    assert 0 < len(heard(systemd)) < 2000


def test_a_systemd_that_is_gone_stops_nobody(tmp_path: Path) -> None:
    Service({"NOTIFY_SOCKET": str(tmp_path / "nobody")}).alive("ENABLED", 0.0)
