"""`canbase setup commission` before a person at a terminal: questions and answers, and every way to stop wheels that
turn."""

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

TURNS_MPS = 0.02


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, SimControl]]:
    config = write_robot(tmp_path_factory.mktemp("terminal"), free_udp_port())
    with drives(config) as control:
        yield config, control


@contextmanager
def commissioning(config: Path) -> Iterator[Terminal]:
    """At its first question."""
    terminal = Terminal("commission", "--config", str(config), "--steps", "directions")
    try:
        terminal.read_until("Confirm [yes/no]")
        yield terminal
    finally:
        terminal.close()


def turning(terminal: Terminal, control: SimControl) -> None:
    """Confirmed, and the first wheel turns."""
    terminal.press("yes\n")
    terminal.hold("", lambda: control.truth().v_left_mps > TURNS_MPS)


def report(config: Path) -> str:
    """The newest one: each run has a file of its own."""
    return max(config.parent.glob("commissioning-*.md"), key=lambda path: path.stat().st_mtime_ns).read_text("utf-8")


def test_any_line_stops_the_wheel_and_the_report_says_so(bench: tuple[Path, SimControl]) -> None:
    config, control = bench
    before = config.read_text(encoding="utf-8")
    with commissioning(config) as terminal:
        turning(terminal, control)
        terminal.press("stop!!\n")  # who would look for the right key
        wheel_stands(control, STANDS_S)
        assert terminal.wait() == 1
        assert "stopped by Enter" in terminal.shown
    assert "It did not come to its end: stopped by Enter" in report(config)
    assert config.read_text(encoding="utf-8") == before


def test_an_answer_without_sense_is_asked_again_and_the_next_wheel_is_stopped_by_enter(
    bench: tuple[Path, SimControl],
) -> None:
    config, control = bench
    with commissioning(config) as terminal:
        turning(terminal, control)
        terminal.read_until("Which way")
        wheel_stands(control, STANDS_S)
        terminal.press("sideways\n")
        terminal.read_until("expected one of forward, backward, nothing, other; try again")
        terminal.press("f\n")
        terminal.hold("", lambda: abs(control.truth().v_right_mps) > TURNS_MPS)
        terminal.press("\n")
        assert terminal.wait() == 1
        assert abs(control.truth().v_right_mps) < 0.001
        assert "stopped by Enter" in terminal.shown


def test_what_is_neither_yes_nor_no_is_asked_again(bench: tuple[Path, SimControl]) -> None:
    config, control = bench
    path_m = control.truth().path_m
    with commissioning(config) as terminal:
        terminal.press("0,5 m\n")
        terminal.read_until("'0,5 m' is neither yes nor no; try again")
        terminal.press("no\n")
        assert terminal.wait() == 1
        assert "not confirmed; stopped here" in terminal.shown
    assert control.truth().path_m == path_m


def test_ctrl_c_stops_the_wheel_and_the_report_says_so(bench: tuple[Path, SimControl]) -> None:
    config, control = bench
    with commissioning(config) as terminal:
        turning(terminal, control)
        terminal.process.send_signal(signal.SIGINT)
        wheel_stands(control, STANDS_S)
        assert terminal.wait() == 1
    assert "stopped by SIGINT" in report(config)


def test_a_terminal_that_goes_stops_the_wheel_and_leaves_a_report(bench: tuple[Path, SimControl]) -> None:
    config, control = bench
    for old in config.parent.glob("commissioning-*.md"):
        old.unlink()
    with commissioning(config) as terminal:
        turning(terminal, control)
        terminal.hang_up()
        wheel_stands(control, STANDS_S)
        assert terminal.wait() != 0
    assert "the terminal was closed" in report(config)


def test_killed_it_leaves_the_wheel_to_the_drive(bench: tuple[Path, SimControl]) -> None:
    config, control = bench
    with commissioning(config) as terminal:
        turning(terminal, control)
        terminal.process.kill()
        wheel_stands(control, STANDS_S)
