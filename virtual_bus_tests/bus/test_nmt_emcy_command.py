"""`canbase bus nmt` and `canbase bus emcy` as commands, on a multicast bus with simulated drives."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import load_robot
from canbase_runtime.single_instance import bus_name, take
from canbase_sim.control import SimControl
from support.bus_tool import canbase, drives, write_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, SimControl]]:
    file = write_robot(tmp_path_factory.mktemp("nmt"), free_udp_port())
    with drives(file) as control:
        yield str(file), control


@pytest.fixture
def config(rig: tuple[str, SimControl]) -> str:
    return rig[0]


def test_start_preop_and_reset_are_confirmed_by_the_node(config: str) -> None:
    assert canbase("bus", "sdo", "write", "1", "1017", "100", "-c", config).returncode == 0
    started = canbase("bus", "nmt", "1", "start", "-c", config)
    assert (started.returncode, started.stderr) == (0, "")
    assert "node 1: 6041h:0 switch on disabled; no power\nNMT start to node 1: it gives no power" in started.stdout
    assert started.stdout.endswith("node 1: operational\n")
    assert canbase("bus", "nmt", "1", "preop", "-c", config).stdout.endswith("node 1: pre-operational\n")
    reset = canbase("bus", "nmt", "all", "reset", "-c", config)
    assert reset.returncode == 0
    assert "NMT reset to all nodes (1, 2): the drive starts anew" in reset.stdout
    assert reset.stdout.endswith("node 1: pre-operational\nnode 2: pre-operational\n")


def test_a_stopped_node_is_asked_about_before_it_is_started_again(config: str) -> None:
    assert canbase("bus", "sdo", "write", "2", "1017", "100", "-c", config).returncode == 0
    assert canbase("bus", "nmt", "2", "stop", "-c", config).stdout.endswith("node 2: stopped\n")
    refused = canbase("bus", "nmt", "2", "preop", "-c", config)  # in NMT stopped it does not answer SDO
    assert refused.returncode == 1
    assert "power is unknown: it does not answer SDO" in refused.stdout
    assert "Nobody is here to answer: add --yes" in refused.stderr
    assert canbase("bus", "nmt", "2", "preop", "-c", config, "--yes").stdout.endswith("node 2: pre-operational\n")


def test_beside_a_driver_only_force_sends(config: str) -> None:
    with take("driver", bus_name(load_robot(config).robot.bus.arguments())):
        refused = canbase("bus", "nmt", "1", "preop", "-c", config)
        assert refused.returncode == 1
        assert "another driver has" in refused.stderr
        assert canbase("bus", "nmt", "1", "preop", "-c", config, "--force").returncode == 0


def test_a_node_that_is_not_there_does_not_obey(config: str) -> None:
    done = canbase("bus", "nmt", "9", "reset", "-c", config, "--yes", "--sdo-timeout", "0.05")
    assert done.returncode == 1
    assert done.stdout.endswith("node 9: no boot-up message\n")


def test_errors_in_words_and_forgotten_on_request(rig: tuple[str, SimControl]) -> None:
    config, control = rig
    control.fault(1, "fault", code=0x2310)
    shown = canbase("bus", "emcy", "1", "-c", config)
    assert (shown.returncode, shown.stderr) == (0, "")
    assert "errors in the history 1003h, the newest first\nnode 1:   1 2310h over-current\n" in shown.stdout
    asked = canbase("bus", "emcy", "1", "--clear", "-c", config)
    assert asked.returncode == 1
    assert "Nobody is here to answer: add --yes" in asked.stderr
    cleared = canbase("bus", "emcy", "1", "--clear", "--yes", "-c", config)
    assert (cleared.returncode, cleared.stdout) == (0, "node 1: the history is empty\n")
    assert "node 1: 0 errors in the history 1003h\n" in canbase("bus", "emcy", "1", "-c", config).stdout


def test_the_errors_of_a_node_that_robot_yaml_does_not_have(config: str) -> None:
    other = Path(config).with_name("other.yaml")
    other.write_text(Path(config).read_text(encoding="utf-8").replace("node_id: 1", "node_id: 11"), encoding="utf-8")
    shown = canbase("bus", "emcy", "1", "-c", str(other))
    assert (shown.returncode, shown.stderr) == (0, "")
    assert "error register 1001h: " in shown.stdout


@pytest.mark.parametrize("words", [("nmt", "0", "start"), ("nmt", "every", "start"), ("nmt", "1", "go"), ("emcy", "0")])
def test_wrong_words_are_2(words: tuple[str, ...]) -> None:
    assert CliRunner().invoke(app, list(words)).exit_code == 2
