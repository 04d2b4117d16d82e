"""`canbase bus jog` as a process on a terminal, and every way to end it while the wheel turns."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from canbase_sim.control import SimControl
from support.bus_tool import STANDS_S, drives, wheel_stands, write_robot
from support.terminal import Terminal
from support.udp_port import free_udp_port

pytestmark = [pytest.mark.bus, pytest.mark.timeout(120)]


@contextmanager
def jogging(config: Path, control: SimControl) -> Iterator[Terminal]:
    terminal = Terminal("jog", "left_wheel", "--config", str(config), "--yes", "--speed", "0.1")
    try:
        terminal.read_until("q ends")
        terminal.hold("w", lambda: control.truth().v_left_mps >= 0.08)
        yield terminal
    finally:
        terminal.close()


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, SimControl]]:
    config = write_robot(tmp_path_factory.mktemp("jog"), free_udp_port())
    with drives(config) as control:
        yield config, control


def test_released_it_stops_and_q_ends_it(bench: tuple[Path, SimControl]) -> None:
    config, control = bench
    with jogging(config, control) as terminal:
        wheel_stands(control, STANDS_S)
        terminal.press("q")
        assert terminal.wait() == 0


# SIGINT and SIGTERM, which the same code takes: test_commission_terminal.py, test_commission_json.py
@pytest.mark.parametrize(("number", "code"), [(signal.SIGHUP, 129), (signal.SIGKILL, -9)])
def test_a_signal_stops_the_wheel_and_sigkill_leaves_it_to_the_drive(
    bench: tuple[Path, SimControl], number: int, code: int
) -> None:
    config, control = bench
    with jogging(config, control) as terminal:
        terminal.process.send_signal(number)
        wheel_stands(control, STANDS_S)
        assert terminal.wait() == code


def test_a_terminal_that_goes_stops_the_wheel(bench: tuple[Path, SimControl]) -> None:
    config, control = bench
    with jogging(config, control) as terminal:
        terminal.hang_up()
        wheel_stands(control, STANDS_S)
        assert terminal.wait() != 0
