"""`canbase bus params` as a command before simulated drives, in virtual time."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import pytest

from canbase_base.single_instance import bus_name, take
from canbase_config.load import load_robot
from support.command_world import CommandWorld, canbase

EDS = str(files("canbase_config").joinpath("eds/canbase_cia402.eds"))


@pytest.fixture
def saved(world: CommandWorld) -> str:
    """The parameters of node 1 before anything was changed."""
    file = str(world.config.with_name("left.dcf"))
    done = world.canbase("bus", "params", "save", "1", file, "--eds", EDS)
    assert (done.exit_code, done.stderr) == (0, "")
    assert "31 without a value\n  0602 0000h the object does not exist: 6807h:0" in done.stdout
    return file


def set_acceleration(world: CommandWorld, value: int, node: int = 1) -> None:
    assert world.canbase("bus", "sdo", "write", str(node), "6083", str(value)).exit_code == 0


def test_saved_compared_restored_and_nothing_is_left_to_write(world: CommandWorld, saved: str) -> None:
    set_acceleration(world, 777)
    differ = world.canbase("bus", "params", "diff", saved, "1")
    assert differ.exit_code == 3
    assert "6083h:0 Axis 0 profile acceleration: 0x000003E8 → 0x00000309\n1 of" in differ.stdout
    restored = world.canbase("bus", "params", "restore", saved, "--yes")
    assert (restored.exit_code, restored.stderr) == (0, "")
    assert "1 objects written and read back" in restored.stdout
    assert world.canbase("bus", "params", "diff", saved, "1").exit_code == 0
    assert "nothing to write" in world.canbase("bus", "params", "restore", saved, "--yes").stdout


def test_the_other_wheel_gets_the_same_parameters_with_its_own_cob_ids(world: CommandWorld, saved: str) -> None:
    set_acceleration(world, 777, node=2)
    assert world.canbase("bus", "params", "diff", "1", "2", "--eds", EDS).exit_code == 3
    restored = world.canbase("bus", "params", "restore", saved, "--node", "2", "--yes")
    assert restored.exit_code == 0
    assert "1 objects written" in restored.stdout
    assert world.canbase("bus", "params", "diff", "1", "2", "--eds", EDS).exit_code == 0


def test_what_the_boot_would_set_needs_no_bus(world: CommandWorld, saved: str) -> None:
    done = world.canbase("bus", "params", "diff", saved, "boot")
    assert done.exit_code == 3
    assert "6060h:0 Axis 0 modes of operation: 0 → 3" in done.stdout
    assert "6040h" not in done.stdout


def test_without_an_answer_nothing_is_restored(world: CommandWorld, saved: str) -> None:
    set_acceleration(world, 777)
    refused = world.canbase("bus", "params", "restore", saved)
    assert refused.exit_code == 1
    assert "Nobody is here to answer: add --yes" in refused.stderr
    assert world.canbase("bus", "sdo", "read", "1", "6083", "--raw").stdout == "777\n"


def test_nothing_is_restored_while_a_motor_has_power(world: CommandWorld, saved: str) -> None:
    for at, value in (("6060", "3"), ("6040", "6"), ("6040", "7"), ("6040", "15")):
        assert world.canbase("bus", "sdo", "write", "2", at, value).exit_code == 0
    refused = world.canbase("bus", "params", "restore", saved, "--node", "2", "--yes")
    assert refused.exit_code == 1
    assert "nothing written: 6041h:0 shows operation enabled: a motor has power" in refused.stderr
    stored = world.canbase("bus", "params", "store", "2", "--yes")
    assert stored.exit_code == 1
    assert "nothing changed: 6041h:0 shows operation enabled" in stored.stderr


def test_beside_a_driver_drives_are_read_and_not_changed(world: CommandWorld, saved: str) -> None:
    with take("driver", bus_name(load_robot(world.config).robot.bus.arguments())):
        refused = world.canbase("bus", "params", "restore", saved, "--yes")
        assert refused.exit_code == 1
        assert "this bus is in use: another driver has" in refused.stderr
        assert world.canbase("bus", "params", "diff", saved, "1").exit_code in (0, 3)


def test_store_and_defaults(world: CommandWorld) -> None:
    stored = world.canbase("bus", "params", "store", "1", "--yes")
    assert (stored.exit_code, stored.stdout) == (0, "node 1: stored\n")
    ordered = world.canbase("bus", "params", "defaults", "1", "--yes")
    assert ordered.exit_code == 0
    assert "the defaults come with its next reset" in ordered.stdout


def test_a_node_that_is_not_there_gives_no_file(world: CommandWorld, tmp_path: Path) -> None:
    out = tmp_path / "none.dcf"
    done = world.canbase("bus", "params", "save", "9", str(out), "--eds", EDS, "--sdo-timeout", "0.05")
    assert done.exit_code == 1
    assert "canbase bus scan shows who answers" in done.stderr
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("diff", "200", "1"), "200 is no node id"),
        (("diff", "boot", "boot"), "boot has to be compared with a file or a node"),
        (("diff", "1", "2"), "--eds is missing"),
        (("diff", "nowhere.dcf", "1"), "nowhere.dcf: cannot be read"),
        (("restore", EDS), "it is an EDS, not a DCF"),
        (("save", "1", EDS, "--eds", EDS), "is there already"),
        (("save", "1", EDS, "--eds", EDS, "--overwrite"), "never over the EDS itself"),
    ],
)
def test_wrong_words_are_2_before_anything_is_sent(words: tuple[str, ...], why: str) -> None:
    done = canbase("bus", "params", *words)
    assert done.exit_code == 2
    assert why in done.stderr
