"""`canbase bus params` as a command, on a multicast bus with simulated drives."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import load_robot
from canbase_runtime.single_instance import bus_name, take
from support.bus_tool import canbase, drives, write_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus
EDS = str(files("canbase_config").joinpath("eds/canbase_cia402.eds"))


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    file = write_robot(tmp_path_factory.mktemp("params"), free_udp_port())
    with drives(file):
        yield str(file)


@pytest.fixture(scope="module")
def saved(config: str) -> str:
    """The parameters of node 1 before anything was changed."""
    file = str(Path(config).with_name("left.dcf"))
    done = canbase("bus", "params", "save", "1", file, "--eds", EDS, "-c", config)
    assert (done.returncode, done.stderr) == (0, "")
    assert "31 without a value\n  0602 0000h the object does not exist: 6807h:0" in done.stdout
    return file


def set_acceleration(config: str, value: int, node: int = 1) -> None:
    assert canbase("bus", "sdo", "write", str(node), "6083", str(value), "-c", config).returncode == 0


def test_saved_compared_restored_and_nothing_is_left_to_write(config: str, saved: str) -> None:
    set_acceleration(config, 777)
    differ = canbase("bus", "params", "diff", saved, "1", "-c", config)
    assert differ.returncode == 3
    assert "6083h:0 Axis 0 profile acceleration: 0x000003E8 → 0x00000309\n1 of" in differ.stdout
    restored = canbase("bus", "params", "restore", saved, "--yes", "-c", config)
    assert (restored.returncode, restored.stderr) == (0, "")
    assert "1 objects written and read back" in restored.stdout
    assert canbase("bus", "params", "diff", saved, "1", "-c", config).returncode == 0
    assert "nothing to write" in canbase("bus", "params", "restore", saved, "--yes", "-c", config).stdout


def test_the_other_wheel_gets_the_same_parameters_with_its_own_cob_ids(config: str, saved: str) -> None:
    set_acceleration(config, 777, node=2)
    assert canbase("bus", "params", "diff", "1", "2", "--eds", EDS, "-c", config).returncode == 3
    restored = canbase("bus", "params", "restore", saved, "--node", "2", "--yes", "-c", config)
    assert restored.returncode == 0
    assert "1 objects written" in restored.stdout
    assert canbase("bus", "params", "diff", "1", "2", "--eds", EDS, "-c", config).returncode == 0


def test_what_the_boot_would_set_needs_no_bus(config: str, saved: str) -> None:
    done = CliRunner().invoke(app, ["bus", "params", "diff", saved, "boot", "-c", config])
    assert done.exit_code == 3
    assert "6060h:0 Axis 0 modes of operation: 0 → 3" in done.stdout
    assert "6040h" not in done.stdout


def test_without_an_answer_nothing_is_restored(config: str, saved: str) -> None:
    set_acceleration(config, 777)
    refused = canbase("bus", "params", "restore", saved, "-c", config)
    assert refused.returncode == 1
    assert "Nobody is here to answer: add --yes" in refused.stderr
    assert canbase("bus", "sdo", "read", "1", "6083", "-c", config, "--raw").stdout == "777\n"


def test_nothing_is_restored_while_a_motor_has_power(config: str, saved: str) -> None:
    for at, value in (("6060", "3"), ("6040", "6"), ("6040", "7"), ("6040", "15")):
        assert canbase("bus", "sdo", "write", "2", at, value, "-c", config).returncode == 0
    try:
        refused = canbase("bus", "params", "restore", saved, "--node", "2", "--yes", "-c", config)
        assert refused.returncode == 1
        assert "nothing written: 6041h:0 shows operation enabled: a motor has power" in refused.stderr
        stored = canbase("bus", "params", "store", "2", "--yes", "-c", config)
        assert stored.returncode == 1
        assert "nothing changed: 6041h:0 shows operation enabled" in stored.stderr
    finally:
        canbase("bus", "sdo", "write", "2", "6040", "0", "-c", config, "--force")


def test_beside_a_driver_drives_are_read_and_not_changed(config: str, saved: str) -> None:
    with take("driver", bus_name(load_robot(config).robot.bus.arguments())):
        refused = canbase("bus", "params", "restore", saved, "--yes", "-c", config)
        assert refused.returncode == 1
        assert "this bus is in use: another driver has" in refused.stderr
        assert canbase("bus", "params", "diff", saved, "1", "-c", config).returncode in (0, 3)


def test_store_and_defaults(config: str) -> None:
    stored = canbase("bus", "params", "store", "1", "--yes", "-c", config)
    assert (stored.returncode, stored.stdout) == (0, "node 1: stored\n")
    ordered = canbase("bus", "params", "defaults", "1", "--yes", "-c", config)
    assert ordered.returncode == 0
    assert "the defaults come with its next reset" in ordered.stdout


def test_a_node_that_is_not_there_gives_no_file(config: str, tmp_path: Path) -> None:
    out = tmp_path / "none.dcf"
    done = canbase("bus", "params", "save", "9", str(out), "--eds", EDS, "-c", config, "--sdo-timeout", "0.05")
    assert done.returncode == 1
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
    done = CliRunner().invoke(app, ["bus", "params", *words], env={"COLUMNS": "200"})
    assert done.exit_code == 2
    assert why in done.stderr
