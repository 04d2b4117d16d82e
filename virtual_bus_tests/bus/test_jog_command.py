"""`canbase bus jog` as a process on a terminal, and every way to end it while the wheel turns."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from canbase_sim.control import SimControl
from support.bus_tool import STANDS_S, canbase, drives, write_robot
from support.terminal import Terminal
from support.udp_port import free_udp_port

pytestmark = [pytest.mark.bus, pytest.mark.timeout(120)]


def jog(config: Path) -> tuple[str, ...]:
    return "jog", "left_wheel", "--config", str(config), "--yes", "--speed", "0.1"


@contextmanager
def jogging(config: Path, control: SimControl) -> Iterator[Terminal]:
    terminal = Terminal(*jog(config))
    try:
        terminal.read_until("q ends")
        terminal.hold("w", lambda: control.truth().v_left_mps >= 0.08)
        yield terminal
    finally:
        terminal.close()


def stands(control: SimControl) -> None:
    end = time.monotonic() + STANDS_S
    while abs(control.truth().v_left_mps) > 0.001:
        assert time.monotonic() < end, "the wheel still turns"
        time.sleep(0.01)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, SimControl]]:
    config = write_robot(tmp_path_factory.mktemp("jog"), free_udp_port())
    with drives(config) as control:
        yield config, control


def test_released_it_stops_and_q_ends_it(bench: tuple[Path, SimControl]) -> None:
    config, control = bench
    with jogging(config, control) as terminal:
        stands(control)
        terminal.press("q")
        assert terminal.wait() == 0


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129), (signal.SIGKILL, -9)],
)
def test_every_signal_stops_the_wheel_and_sigkill_leaves_it_to_the_drive(
    bench: tuple[Path, SimControl], number: int, code: int
) -> None:
    config, control = bench
    with jogging(config, control) as terminal:
        terminal.process.send_signal(number)
        stands(control)
        assert terminal.wait() == code


def test_a_terminal_that_goes_stops_the_wheel(bench: tuple[Path, SimControl]) -> None:
    config, control = bench
    with jogging(config, control) as terminal:
        terminal.hang_up()
        stands(control)
        assert terminal.wait() != 0


def test_beside_a_driver_it_is_refused_and_without_a_terminal_too(tmp_path: Path) -> None:
    port = free_udp_port()
    config = write_robot(tmp_path, port)
    assert canbase("bus", "jog", "left_wheel", "--config", str(config)).returncode == 2
    assert canbase("bus", "jog", "wheel", "--config", str(config)).returncode == 2
    with can.Bus("239.74.163.2", "udp_multicast", port=port, hop_limit=0) as other:
        terminal = Terminal(*jog(config))
        try:
            while terminal.process.poll() is None:
                other.send(can.Message(arbitration_id=0x77F, data=b"\x05", is_extended_id=False))
                time.sleep(0.1)
            assert terminal.process.returncode == 1
            terminal.read_until("canbase's motor driver")
        finally:
            terminal.close()
