"""`canbase setup init` before simulated drives on a bus: on a terminal, and before another program.

What it writes and refuses is held in virtual time: unit/commissioning/test_init_command.py.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from canbase_config.load import load_robot
from support.bus_tool import drives, write_robot
from support.json_page import Page
from support.terminal import Terminal
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The robot.yaml of simulated drives, which run."""
    config = write_robot(tmp_path_factory.mktemp("bench"), free_udp_port())
    with drives(config):
        yield config


def test_a_person_is_asked_again_after_a_typing_mistake_and_ctrl_c_writes_nothing(bench: Path, tmp_path: Path) -> None:
    output = tmp_path / "new.yaml"
    terminal = Terminal("init", "--config", str(bench), "--output", str(output))
    try:
        terminal.read_until("Name of the robot [robot]")
        terminal.press("my robot\n")
        terminal.read_until("try again")
        terminal.press("\n")
        terminal.read_until("(left, right, none)? [left]")
        terminal.press("\n")
        terminal.read_until("Motor revolutions for one revolution of the wheel")
        terminal.process.send_signal(signal.SIGINT)
        assert terminal.process.wait(10.0) != 0
    finally:
        terminal.close()
    assert list(tmp_path.glob("new.yaml*")) == []


def answer_until_the_end(page: Page) -> None:
    """Takes the proposed answers, and its own where there is none."""
    answered: set[str] = set()

    def answer() -> bool:
        for question in page.questions:
            if question["ask"] not in answered:
                answered.add(question["ask"])
                known = {"gear_ratio": "20", "velocity_unit": "0.1rpm", "x_m": "0.2"}
                own = known.get(question["ask"].rpartition(".")[2], "")
                page.say(answer=own if question["default"] is None else "", key=question["ask"])
        return page.process.poll() is not None

    page.live_until(answer)


def test_another_program_asks_in_place_of_the_terminal(bench: Path, tmp_path: Path) -> None:
    output = tmp_path / "new.yaml"
    page = Page("setup", "init", "--config", str(bench), "--output", str(output), "--json")
    answer_until_the_end(page)
    assert page.ends() == ""
    assert page.process.returncode == 0
    assert load_robot(output).robot.drives[1].gear_ratio == 20.0
    assert page.told[-1]["tell"].startswith(f"wrote {output}")
