"""`canbase bus nmt` and `canbase bus emcy` as commands before simulated drives, in virtual time."""

from __future__ import annotations

import pytest

from canbase_base.single_instance import bus_name, take
from canbase_config.load import load_robot
from support.command_world import CommandWorld, canbase


def test_start_preop_and_reset_are_confirmed_by_the_node(world: CommandWorld) -> None:
    assert world.canbase("bus", "sdo", "write", "1", "1017", "100").exit_code == 0
    started = world.canbase("bus", "nmt", "1", "start")
    assert (started.exit_code, started.stderr) == (0, "")
    assert "node 1: 6041h:0 switch on disabled; no power\nNMT start to node 1: it gives no power" in started.stdout
    assert started.stdout.endswith("node 1: operational\n")
    assert world.canbase("bus", "nmt", "1", "preop").stdout.endswith("node 1: pre-operational\n")
    reset = world.canbase("bus", "nmt", "all", "reset")
    assert reset.exit_code == 0
    assert "NMT reset to all nodes (1, 2): the drive starts anew" in reset.stdout
    assert reset.stdout.endswith("node 1: pre-operational\nnode 2: pre-operational\n")


def test_a_stopped_node_is_asked_about_before_it_is_started_again(world: CommandWorld) -> None:
    assert world.canbase("bus", "sdo", "write", "2", "1017", "100").exit_code == 0
    assert world.canbase("bus", "nmt", "2", "stop").stdout.endswith("node 2: stopped\n")
    refused = world.canbase("bus", "nmt", "2", "preop")  # in NMT stopped it does not answer SDO
    assert refused.exit_code == 1
    assert "power is unknown: it does not answer SDO" in refused.stdout
    assert "Nobody is here to answer: add --yes" in refused.stderr
    assert world.canbase("bus", "nmt", "2", "preop", "--yes").stdout.endswith("node 2: pre-operational\n")


def test_beside_a_driver_only_force_sends(world: CommandWorld) -> None:
    with take("driver", bus_name(load_robot(world.config).robot.bus.arguments())):
        refused = world.canbase("bus", "nmt", "1", "preop")
        assert refused.exit_code == 1
        assert "another driver has" in refused.stderr
        assert world.canbase("bus", "nmt", "1", "preop", "--force").exit_code == 0


def test_a_node_that_is_not_there_does_not_obey(world: CommandWorld) -> None:
    done = world.canbase("bus", "nmt", "9", "reset", "--yes", "--sdo-timeout", "0.05")
    assert done.exit_code == 1
    assert done.stdout.endswith("node 9: no boot-up message\n")


def test_errors_in_words_and_forgotten_on_request(world: CommandWorld) -> None:
    world.suffer(1, "fault", code=0x2310)
    world.sleep(0.05)
    shown = world.canbase("bus", "emcy", "1")
    assert (shown.exit_code, shown.stderr) == (0, "")
    assert "errors in the history 1003h, the newest first\nnode 1:   1 2310h over-current\n" in shown.stdout
    asked = world.canbase("bus", "emcy", "1", "--clear")
    assert asked.exit_code == 1
    assert "Nobody is here to answer: add --yes" in asked.stderr
    cleared = world.canbase("bus", "emcy", "1", "--clear", "--yes")
    assert (cleared.exit_code, cleared.stdout) == (0, "node 1: the history is empty\n")
    assert "node 1: 0 errors in the history 1003h\n" in world.canbase("bus", "emcy", "1").stdout


def test_the_errors_of_a_node_that_robot_yaml_does_not_have(world: CommandWorld) -> None:
    robot_yaml = world.config.read_text(encoding="utf-8")
    world.config.write_text(robot_yaml.replace("node_id: 1", "node_id: 11"), encoding="utf-8")
    shown = world.canbase("bus", "emcy", "1")
    assert (shown.exit_code, shown.stderr) == (0, "")
    assert "error register 1001h: " in shown.stdout


@pytest.mark.parametrize("words", [("nmt", "0", "start"), ("nmt", "every", "start"), ("nmt", "1", "go"), ("emcy", "0")])
def test_wrong_words_are_2(words: tuple[str, ...]) -> None:
    assert canbase(*words).exit_code == 2
