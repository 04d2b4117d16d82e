"""`canbase bus sdo` as a command, on a multicast bus with simulated drives."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import can
import pytest

from canbase_config.load import load_robot
from support.bus_tool import canbase, drives, write_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    file = write_robot(tmp_path_factory.mktemp("sdo"), free_udp_port())
    with drives(file):
        yield str(file)


def test_read_and_write_in_words(config: str) -> None:
    read = canbase("bus", "sdo", "read", "1", "6041", "-c", config)
    assert (read.returncode, read.stderr) == (0, "")
    assert read.stdout.startswith("node 1, 6041h:0 Axis 0 statusword: 0x")
    assert read.stdout.endswith("(u16): switch on disabled\n")
    written = canbase("bus", "sdo", "write", "1", "60FF", "-20", "-c", config)
    assert written.returncode == 0
    assert written.stdout.endswith("0x00000000 = 0 (i32) → 0xFFFFFFEC = -20 (i32)\n")
    assert canbase("bus", "sdo", "read", "1", "60FF", "-c", config, "--raw").stdout == "-20\n"


def test_refusals_name_the_abort_code_in_words_and_what_to_try(config: str) -> None:
    done = canbase("bus", "sdo", "read", "1", "5FFF", "-c", config)
    assert done.returncode == 1
    assert "0602 0000h the object does not exist; the drive has no such object" in done.stderr
    done = canbase("bus", "sdo", "read", "9", "1000", "-c", config, "--sdo-timeout", "0.05")
    assert done.returncode == 1
    assert "Nodes that answer SDO: 1, 2." in done.stderr


@pytest.mark.parametrize(
    "words", [("read", "1", "statusword"), ("read", "1", "6041", "--type", "word"), ("write", "1", "1017", "65536")]
)
def test_a_wrong_word_is_2_before_anything_is_sent(config: str, words: tuple[str, ...]) -> None:
    done = canbase("bus", "sdo", *words, "-c", config)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def test_write_is_refused_while_the_motor_has_power(config: str) -> None:
    for at, value in (("6060", "3"), ("6040", "6"), ("6040", "7"), ("6040", "15")):
        assert canbase("bus", "sdo", "write", "2", at, value, "-c", config).returncode == 0
    done = canbase("bus", "sdo", "write", "2", "60FF", "100", "-c", config)
    assert done.returncode == 1
    assert "6041h:0 reports that a motor has power" in done.stderr
    assert canbase("bus", "sdo", "write", "2", "6040", "0", "-c", config, "--force").returncode == 0


EDS = str(files("canbase_config").joinpath("eds/canbase_cia402.eds"))


def test_objects_have_their_names_from_the_eds_and_a_miss_proposes_the_nearest(config: str) -> None:
    by_name = canbase("bus", "sdo", "read", "1", "axis 0 Profile-Acceleration", "-c", config, "--eds", EDS)
    assert (by_name.returncode, by_name.stderr) == (0, "")
    assert by_name.stdout.startswith("node 1, 6083h:0 Axis 0 profile acceleration: 0x")
    assert by_name.stdout.endswith(" [rw, 1 to 4294967295]\n")
    assert "1018h:2 Product code: 0x000CB402" in canbase("bus", "sdo", "read", "1", "Identity:2", "-c", config).stdout
    miss = canbase("bus", "sdo", "read", "1", "profile accelleration", "-c", config, "--eds", EDS)
    assert miss.returncode == 2
    assert "Axis 0 profile acceleration (6083h:0)" in " ".join(miss.stderr.replace("│", " ").split())


def test_what_the_eds_denies_is_not_sent(config: str) -> None:
    for words, why in (
        (("6041", "0"), "it is read-only by the EDS"),
        (("605A", "9"), "9 is outside the range of the EDS, 0 to 8"),
    ):
        refused = canbase("bus", "sdo", "write", "1", *words, "-c", config, "--eds", EDS, "--force")
        assert refused.returncode == 2
        assert f"{why}. Nothing was sent" in refused.stderr
    sent = canbase("bus", "sdo", "write", "1", "605A", "9", "-c", config, "--eds", EDS, "--ignore-eds")
    assert sent.returncode == 1
    assert "0609 0031h value too high" in sent.stderr  # the drive's own answer


def test_beside_a_driver_nothing_is_written_and_the_sentence_says_what_would_become_of_it(config: str) -> None:
    with can.Bus(**load_robot(Path(config)).robot.bus.arguments()) as bus:
        bus.send_periodic(can.Message(arbitration_id=0x77F, data=[5], is_extended_id=False), 0.05)
        done = canbase("bus", "sdo", "write", "1", "1016:1", "0", "-c", config)
    assert done.returncode == 1
    said = " ".join(done.stderr.split())
    assert "canbase's driver runs on this bus. After a write to 1016h:1 the driver boots node 1 anew" in said
    assert said.endswith("End it first, or --force")
