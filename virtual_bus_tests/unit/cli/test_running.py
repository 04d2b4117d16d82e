"""`canbase doctor` beside parts that were started with another robot.yaml, or before it was changed."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest

from canbase_base.single_instance import bus_name, take
from canbase_cli.running import Changed, Running, changes, running, running_checks
from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_doctor.check import Verdict

STARTED_S = 1_000_000.0
FILE = "/etc/canbase/robot.yaml"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(sample("bench")).robot


def verdicts(robot: Robot, part: Running, *changed: Changed) -> list[tuple[Verdict, str]]:
    return [(row.verdict, row.found) for row in running_checks(robot, (part,), changed)]


def driver(*words: str) -> Running:
    return Running("driver", 7, STARTED_S, ("python", "-m", "canbase_cli", *words))


@pytest.mark.parametrize(
    ("after_s", "fits"), [(-86_400.0, True), (0.0, True), (1.9, True), (2.1, False), (86_400.0, False)]
)
def test_a_file_that_was_changed_after_the_start_is_not_what_runs(robot: Robot, after_s: float, fits: bool) -> None:
    ((verdict, told),) = verdicts(robot, driver(), Changed(FILE, STARTED_S + after_s))
    assert verdict is (Verdict.OK if fits else Verdict.FAIL)
    assert told == ("this robot.yaml" if fits else f"process 7: {FILE} was changed after its start")


def test_a_watchdog_of_another_robot_yaml_is_found_by_its_command_line(robot: Robot) -> None:
    faster = robot.model_copy(update={"limits": robot.limits.model_copy(update={"linear_mps": 0.5})})
    same = Running("watchdog", 8, STARTED_S, ("python", "--config-json", watchdog_config(robot).to_json(), ""))
    other = Running("watchdog", 8, STARTED_S, ("python", "--config-json", watchdog_config(faster).to_json(), ""))
    assert verdicts(robot, same) == [(Verdict.OK, "this robot.yaml")]
    ((verdict, told),) = verdicts(robot, other)
    assert verdict is Verdict.FAIL
    assert "it runs with another robot.yaml, or an earlier one (" in told
    assert "linear_mps" in told


def test_whose_lease_socket_it_is_follows_from_who_starts_it(robot: Robot) -> None:
    service = robot.model_copy(update={"lease": robot.lease.model_copy(update={"socket": "/run/canbase/lease"})})
    words = ("python", "--config-json", watchdog_config(service).to_json(), "")
    assert verdicts(robot, Running("watchdog", 8, STARTED_S, words)) == [(Verdict.OK, "this robot.yaml")]


def test_what_runs_is_found_with_its_start(robot: Robot, tmp_path: Path) -> None:
    own = robot.model_copy(update={"bus": robot.bus.model_copy(update={"channel": str(tmp_path)})})
    own = own.model_copy(update={"lease": own.lease.model_copy(update={"socket": str(tmp_path / "lease")})})
    assert running(own) == ()
    with take("driver", bus_name(own.bus.arguments())):
        (found,) = running(own)
    assert (found.part, found.pid) == ("driver", os.getpid())
    assert time.time() - 86_400.0 < found.started_s <= time.time() + 2.0
    assert [word for word in found.words if word] == [word for word in sys.orig_argv if word]


def test_its_files_are_looked_at(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(sample("bench").read_text())
    os.utime(file, (5.0, 5.0))
    assert Changed(str(file), 5.0) in changes(load_robot(file))
