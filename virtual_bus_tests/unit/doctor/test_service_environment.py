"""The environment of a robot's services, as a program beside them has to take it to find them."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from canbase_config.load import load_robot, sample
from canbase_deploy.execute import Executor
from canbase_deploy.host import read_templates
from canbase_deploy.plan import Request, install_plan
from canbase_doctor.bundle_contents import Command, commands
from canbase_doctor.service_environment import arguments, service_environment
from canbase_doctor.support_bundle import Bundle, doctor_environment

ENV = "# kept\nROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET\nROS_DOMAIN_ID=42\nCANBASE_OPTIONS=--namespace robot1\n"


def test_the_services_environment_wins_and_root_has_no_say_in_ros() -> None:
    own = {"HOME": "/root", "ROS_DOMAIN_ID": "0", "ROS_STATIC_PEERS": "10.0.0.1", "RMW_IMPLEMENTATION": "x"}

    seen = service_environment(own, [], ENV)

    assert seen == {
        "HOME": "/root",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "ROS_DOMAIN_ID": "42",
        "CANBASE_OPTIONS": "--namespace robot1",
    }


def test_a_file_wins_over_drop_ins_and_a_later_drop_in_over_an_earlier_one() -> None:
    drop_ins = ["[Service]\nEnvironment=A=1 B=1 ROS_DOMAIN_ID=1\n", '[Service]\nEnvironment="B=a 100%% \\"x\\""\n']

    assert service_environment({}, drop_ins, "; no\nROS_DOMAIN_ID='5'\n") == {
        "A": "1",
        "B": 'a 100% "x"',
        "ROS_DOMAIN_ID": "5",
    }


@pytest.mark.parametrize(
    ("environment", "words"),
    [
        ({}, ()),
        ({"CANBASE_OPTIONS": "--namespace robot1 --other 3"}, ("--namespace", "robot1")),
        ({"CANBASE_OPTIONS": "--other --namespace=robot2"}, ("--namespace", "robot2")),
        ({"CANBASE_OPTIONS": "--namespace"}, ()),
        ({"ROS_SECURITY_ENABLE": "true"}, ("--ros-args", "--enclave", "/canbase/operator")),
    ],
)
def test_the_doctor_looks_where_the_services_are(environment: dict[str, str], words: tuple[str, ...]) -> None:
    assert arguments(environment) == words
    doctor = commands(Path("r.yaml"), "-1h", environment)[-1]
    assert doctor.argv[-len(words) - 1 :] == ("r.yaml", *words)
    assert doctor.environment == environment


def test_an_installed_robot_is_found_with_what_install_wrote(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = sample("example_can0")
    templates = read_templates(Path(__file__).parents[3] / "deploy" / "systemd")
    ros = {"AMENT_PREFIX_PATH": "/opt/my ws:/opt/ros/jazzy"}
    request = Request("carrier", load_robot(path).robot, path.read_text(), "/opt/python", templates, sourced=ros)
    Executor(tmp_path, lambda _: None).carry_out(install_plan(request, {}))
    monkeypatch.setenv("ROS_DOMAIN_ID", "77")
    etc, units = tmp_path / "etc/canbase", tmp_path / "etc/systemd/system"
    (etc / "carrier.env").write_text(ENV)

    seen = doctor_environment(etc / "carrier.yaml", "other", etc, units)

    assert seen is not None
    assert (seen["ROS_DOMAIN_ID"], seen["AMENT_PREFIX_PATH"]) == ("42", "/opt/my ws:/opt/ros/jazzy")
    assert doctor_environment(Path("/x/robot.yaml"), "carrier", etc, units) == seen
    assert doctor_environment(Path("/x/robot.yaml"), "nobody", etc, units) is None


def test_a_program_runs_with_the_environment_it_is_given_or_else_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "77")
    asks = (sys.executable, "-c", "import os; print('domain', os.environ.get('ROS_DOMAIN_ID'))")
    bundle = Bundle()

    bundle.output(Command("theirs", asks, environment={**os.environ, "ROS_DOMAIN_ID": "42"}))
    bundle.output(Command("ours", asks))

    assert (bundle.files["theirs"], bundle.files["ours"]) == (b"domain 42\n", b"domain 77\n")
