"""`canbase setup init` as a command before simulated drives, in virtual time. A person: bus/test_init_command.py."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_config.load import load_robot
from canbase_driver.cia301.frame import Frame
from support.command_world import CommandWorld, canbase

GEAR = "node1.gear_ratio: 20\nnode2.gear_ratio: 20\nnode1.velocity_unit: 0.1rpm\nnode2.velocity_unit: 0.1rpm\n"
"""What the simulated drives do not report."""


@pytest.fixture
def output(tmp_path: Path) -> Path:
    return tmp_path / "new.yaml"


@pytest.fixture
def answers(tmp_path: Path) -> str:
    file = tmp_path / "answers.yaml"
    file.write_text(GEAR + "name: fred\nscanner: no\nestop: no\n", encoding="utf-8")
    return str(file)


def test_two_drives_become_a_robot_yaml_that_passes_the_check(world: CommandWorld, output: Path, answers: str) -> None:
    done = world.canbase("setup", "init", "--output", str(output), "--answers", answers, "--yes")
    assert done.exit_code == 0, done.stdout + done.stderr
    assert "found node 1 (generic CiA 402 drive), profile generic" in done.stdout
    robot = load_robot(output).robot
    assert (robot.name, robot.bus) == ("fred", load_robot(world.config).robot.bus)
    assert [(d.node_id, d.side, d.counts_per_motor_rev, d.velocity_unit) for d in robot.drives] == [
        (1, "left", 4096, "0.1rpm"),
        (2, "right", 4096, "0.1rpm"),
    ]
    assert "20 and 0.1rpm with --bench" in done.stdout
    assert f"canbase setup commission --config {output}" in done.stdout
    assert canbase("config", "check", "--config", str(output)).exit_code == 0


def test_a_question_without_an_answer_writes_nothing(world: CommandWorld, output: Path) -> None:
    done = world.canbase("setup", "init", "--output", str(output), "--yes")
    assert done.exit_code == 1
    missing = "node1.gear_ratio, node1.velocity_unit, node2.gear_ratio, node2.velocity_unit, scanner.x_m"
    assert f"no answer to {missing}: run it on a terminal, or give it in --answers" in done.stderr
    some = world.canbase("setup", "init", "--output", str(output)).stderr
    assert "no answer to name, node1.side, node1.gear_ratio, " in some
    assert some.endswith(f", estop: run it on a terminal, or give it in --answers; --yes answers all but {missing}\n")
    assert list(output.parent.glob("new.yaml*")) == []


@pytest.mark.parametrize("name", ["new.yaml", "new.yaml.draft.yaml"])
def test_a_file_that_exists_is_kept_and_a_draft_that_a_person_has_corrected(output: Path, name: str) -> None:
    mine = output.with_name(name)
    mine.write_text("name: mine\n", encoding="utf-8")
    done = canbase("setup", "init", "--channel", "can0", "--output", str(output), "--yes")
    assert done.exit_code == 2
    assert "is never overwritten" in done.stderr
    assert mine.read_text(encoding="utf-8") == "name: mine\n"


def test_a_file_that_came_while_the_person_answered_is_kept(world: CommandWorld, output: Path, answers: str) -> None:
    def somebody(_now_s: float) -> list[Frame]:
        output.write_text("name: mine\n", encoding="utf-8")
        return []

    world.others.append(somebody)
    done = world.canbase("setup", "init", "--output", str(output), "--answers", answers, "--yes")
    assert done.exit_code == 1
    assert "File exists" in done.stderr
    assert output.read_text(encoding="utf-8") == "name: mine\n"


def test_an_empty_bus_is_1(world: CommandWorld, output: Path) -> None:
    for node_id in (1, 2):
        world.suffer(node_id, "silent")
    done = world.canbase("setup", "init", "--output", str(output), "--yes", "--sdo-timeout", "0.05")
    assert done.exit_code == 1
    assert "power, cable, termination, bit rate" in done.stderr
