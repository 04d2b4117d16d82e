"""`canbase setup init` as a command: from simulated drives that no robot.yaml describes to a file that drives them."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from canbase_config.load import load_robot
from support.bus_tool import canbase, drives, write_robot
from support.json_page import Page
from support.terminal import Terminal
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus

GEAR = "node1.gear_ratio: 20\nnode2.gear_ratio: 20\n"
"""What the simulated drives do not report."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The robot.yaml of simulated drives, which run."""
    config = write_robot(tmp_path_factory.mktemp("bench"), free_udp_port())
    with drives(config):
        yield config


def test_two_drives_become_a_robot_yaml_that_passes_the_check(bench: Path, tmp_path: Path) -> None:
    output, answers = tmp_path / "new.yaml", tmp_path / "answers.yaml"
    answers.write_text(GEAR + "name: fred\nscanner: no\nestop: no\n", encoding="utf-8")
    done = canbase("setup", "init", "--config", str(bench), "--output", str(output), "--answers", str(answers), "--yes")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "found node 1 (generic CiA 402 drive), profile generic" in done.stdout
    robot = load_robot(output).robot
    assert (robot.name, robot.bus) == ("fred", load_robot(bench).robot.bus)
    assert [(d.node_id, d.side, d.counts_per_motor_rev) for d in robot.drives] == [
        (1, "left", 4096),
        (2, "right", 4096),
    ]
    assert f"canbase setup commission --config {output}" in done.stdout
    assert canbase("config", "check", "--config", str(output)).returncode == 0


def test_a_question_without_an_answer_writes_nothing(bench: Path, tmp_path: Path) -> None:
    output = tmp_path / "new.yaml"
    done = canbase("setup", "init", "--config", str(bench), "--output", str(output), "--yes")
    assert done.returncode == 1
    assert "no answer to node1.gear_ratio: run it on a terminal, or give it in --answers" in done.stderr
    assert list(tmp_path.glob("new.yaml*")) == []


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


def answer_until_the_end(page: Page, first: Callable[[], object] = lambda: None) -> None:
    """Takes the proposed answers, and 20 where there is none; `first` is called before each answer."""
    answered: set[str] = set()

    def answer() -> bool:
        for question in page.questions:
            if question["ask"] not in answered:
                first()
                answered.add(question["ask"])
                page.say(answer="20" if question["default"] is None else "", key=question["ask"])
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


def test_a_file_that_exists_is_kept(tmp_path: Path) -> None:
    output = tmp_path / "robot.yaml"
    output.write_text("name: mine\n", encoding="utf-8")
    done = canbase("setup", "init", "--channel", "can0", "--output", str(output), "--yes")
    assert done.returncode == 2
    assert "is never overwritten" in done.stderr
    assert output.read_text(encoding="utf-8") == "name: mine\n"


def test_a_draft_that_a_person_has_corrected_is_kept_too(tmp_path: Path) -> None:
    output, draft = tmp_path / "robot.yaml", tmp_path / "robot.yaml.draft.yaml"
    draft.write_text("name: mine\n", encoding="utf-8")
    done = canbase("setup", "init", "--channel", "can0", "--output", str(output), "--yes")
    assert (done.returncode, draft.read_text(encoding="utf-8")) == (2, "name: mine\n")


def test_a_file_that_came_while_the_person_answered_is_kept(bench: Path, tmp_path: Path) -> None:
    output = tmp_path / "new.yaml"
    page = Page("setup", "init", "--config", str(bench), "--output", str(output), "--json")
    answer_until_the_end(page, lambda: output.write_text("name: mine\n", encoding="utf-8"))
    assert "File exists" in page.ends()
    assert page.process.returncode == 1
    assert output.read_text(encoding="utf-8") == "name: mine\n"


def test_an_empty_bus_is_1(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    words = ("--config", str(config), "--output", str(tmp_path / "new.yaml"))
    done = canbase("setup", "init", *words, "--yes", "--sdo-timeout", "0.05")
    assert done.returncode == 1
    assert "power, cable, termination, bit rate" in done.stderr
