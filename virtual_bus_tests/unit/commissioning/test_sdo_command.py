"""`canbase bus sdo` as a command before simulated drives, in virtual time."""

from __future__ import annotations

from importlib.resources import files

import pytest

from support.command_world import CommandWorld

EDS = str(files("canbase_config").joinpath("eds/canbase_cia402.eds"))


def test_read_and_write_in_words(world: CommandWorld) -> None:
    read = world.canbase("bus", "sdo", "read", "1", "6041")
    assert (read.exit_code, read.stderr) == (0, "")
    assert read.stdout.startswith("node 1, 6041h:0 Axis 0 statusword: 0x")
    assert read.stdout.endswith("(u16): switch on disabled\n")
    written = world.canbase("bus", "sdo", "write", "1", "60FF", "-20")
    assert written.exit_code == 0
    assert written.stdout.endswith("0x00000000 = 0 (i32) → 0xFFFFFFEC = -20 (i32)\n")
    assert world.canbase("bus", "sdo", "read", "1", "60FF", "--raw").stdout == "-20\n"


def test_refusals_name_the_abort_code_in_words_and_what_to_try(world: CommandWorld) -> None:
    done = world.canbase("bus", "sdo", "read", "1", "5FFF")
    assert done.exit_code == 1
    assert "0602 0000h the object does not exist; the drive has no such object" in done.stderr
    done = world.canbase("bus", "sdo", "read", "9", "1000", "--sdo-timeout", "0.05")
    assert done.exit_code == 1
    assert "Nodes that answer SDO: 1, 2." in done.stderr


@pytest.mark.parametrize(
    "words", [("read", "1", "statusword"), ("read", "1", "6041", "--type", "word"), ("write", "1", "1017", "65536")]
)
def test_a_wrong_word_is_2_before_anything_is_sent(world: CommandWorld, words: tuple[str, ...]) -> None:
    done = world.canbase("bus", "sdo", *words)
    assert done.exit_code == 2
    assert world.said == []


def test_write_is_refused_while_the_motor_has_power(world: CommandWorld) -> None:
    for at, value in (("6060", "3"), ("6040", "6"), ("6040", "7"), ("6040", "15")):
        assert world.canbase("bus", "sdo", "write", "2", at, value).exit_code == 0
    done = world.canbase("bus", "sdo", "write", "2", "60FF", "100")
    assert done.exit_code == 1
    assert "6041h:0 reports that a motor has power" in done.stderr
    assert world.canbase("bus", "sdo", "write", "2", "6040", "0", "--force").exit_code == 0


def test_objects_have_their_names_from_the_eds_and_a_miss_proposes_the_nearest(world: CommandWorld) -> None:
    by_name = world.canbase("bus", "sdo", "read", "1", "axis 0 Profile-Acceleration", "--eds", EDS)
    assert (by_name.exit_code, by_name.stderr) == (0, "")
    assert by_name.stdout.startswith("node 1, 6083h:0 Axis 0 profile acceleration: 0x")
    assert by_name.stdout.endswith(" [rw, 1 to 4294967295]\n")
    assert "1018h:2 Product code: 0x000CB402" in world.canbase("bus", "sdo", "read", "1", "Identity:2").stdout
    miss = world.canbase("bus", "sdo", "read", "1", "profile accelleration", "--eds", EDS)
    assert miss.exit_code == 2
    assert "Axis 0 profile acceleration (6083h:0)" in " ".join(miss.stderr.replace("│", " ").split())


def test_what_the_eds_denies_is_not_sent(world: CommandWorld) -> None:
    for words, why in (
        (("6041", "0"), "it is read-only by the EDS"),
        (("605A", "9"), "9 is outside the range of the EDS, 0 to 8"),
    ):
        refused = world.canbase("bus", "sdo", "write", "1", *words, "--eds", EDS, "--force")
        assert refused.exit_code == 2
        assert f"{why}. Nothing was sent" in refused.stderr
    sent = world.canbase("bus", "sdo", "write", "1", "605A", "9", "--eds", EDS, "--ignore-eds")
    assert sent.exit_code == 1
    assert "0609 0031h value too high" in sent.stderr  # the drive's own answer


def test_beside_a_driver_nothing_is_written_and_the_sentence_says_what_would_become_of_it(world: CommandWorld) -> None:
    world.repeat(0x77F, b"\x05", 0.05)
    done = world.canbase("bus", "sdo", "write", "1", "1016:1", "0")
    assert done.exit_code == 1
    said = " ".join(done.stderr.split())
    assert "canbase's driver runs on this bus. After a write to 1016h:1 the driver boots node 1 anew" in said
    assert said.endswith("End it first, or --force")
    assert world.said == []
