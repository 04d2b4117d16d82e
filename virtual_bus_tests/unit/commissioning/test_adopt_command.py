"""`canbase bus adopt` as a command before simulated drives, in virtual time. On a bus: bus/test_adopt_command.py."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_commissioning.lss.protocol import REQUEST
from support.command_world import CommandWorld, canbase


def settings(world: CommandWorld) -> list[tuple[int, int]]:
    """Node id and bit rate of each drive."""
    return [(node.node_id, node.lss.bitrate) for node in world.bench.nodes.values()]


def test_the_bit_rate_is_found_and_the_answers_choose_the_node_ids(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = CommandWorld(tmp_path, monkeypatch, factory_fresh=True)
    answers = tmp_path / "answers.yaml"
    answers.write_text("start: yes\nserial_1: 2\nserial_2: 1\n", encoding="utf-8")
    done = world.canbase("bus", "adopt", "--answers", str(answers))
    assert done.exit_code == 0, done.stdout + done.stderr
    assert "drives answer at 125000 bit/s" in done.stdout
    assert "node 1: two drives or more have this node id" in done.stdout
    assert settings(world) == [(2, 500_000), (1, 500_000)]


def test_another_master_ends_it_before_any_lss(world: CommandWorld) -> None:
    world.repeat(0x080, b"", 0.02)
    done = world.canbase("bus", "adopt", "--yes")
    assert done.exit_code == 1
    assert "another master is on this bus (SYNC" in done.stderr
    assert [frame for frame in world.said if frame.cob_id == REQUEST] == []


def test_a_motor_with_power_ends_it(world: CommandWorld) -> None:
    for index, value in (("6060", "3"), ("6040", "6"), ("6040", "7"), ("6040", "15")):
        done = world.canbase("bus", "sdo", "write", "1", index, value, "--force")
        assert done.exit_code == 0, done.stderr
    done = world.canbase("bus", "adopt", "--yes", "--present-bitrate", "500000")
    assert done.exit_code == 1
    assert "node 1 is in operation enabled: its motor may have power" in done.stderr
    assert "Nothing was changed" in done.stderr
    assert [frame for frame in world.said if frame.cob_id == REQUEST] == []


def test_an_empty_cable_is_1(world: CommandWorld) -> None:
    for node_id in (1, 2):
        world.suffer(node_id, "silent")
    done = world.canbase("bus", "adopt", "--yes")
    assert done.exit_code == 1
    assert "no drive answers at any bit rate; check power, cable, termination" in done.stderr


def test_a_bit_rate_that_canopen_does_not_have_is_2() -> None:
    done = canbase("bus", "adopt", "--channel", "can0", "--bitrate", "123456")
    assert done.exit_code == 2
    assert "expected one of 1000000" in done.stderr


def test_one_drive_too_many_and_one_without_lss_end_it_before_any_node_id_is_taken(world: CommandWorld) -> None:
    second = world.bench.nodes[2]
    second.lss.on_frame = lambda data, now_s: None  # type: ignore[method-assign]
    second._route()
    done = world.canbase("bus", "adopt", "--yes", "--present-bitrate", "500000")
    assert done.exit_code == 1
    assert "node 2 answers SDO and takes no LSS" in done.stderr
    assert "Nothing was changed" in done.stderr
    text = world.config.read_text(encoding="utf-8")
    world.config.write_text(text.replace("  node_id: 2", "  node_id: 1\n  axis: 1"), encoding="utf-8")
    done = world.canbase("bus", "adopt", "--yes", "--present-bitrate", "500000")
    assert "robot.yaml has 1 nodes, 2 found" in done.stderr
    assert "Nothing was changed" in done.stderr
    assert settings(world) == [(1, 500_000), (2, 500_000)]


@pytest.mark.parametrize(
    ("few", "said"),
    [("", "no answer to few"), ("few: no\n", "not confirmed; stopped here"), ("few: yes\n", "")],
)
def test_that_drives_are_missing_is_confirmed_by_a_person_and_not_by_yes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, few: str, said: str
) -> None:
    """The one that answers would get the node id of the other side."""
    world = CommandWorld(tmp_path, monkeypatch, factory_fresh=True)
    world.suffer(2, "silent")
    answers = tmp_path / "answers.yaml"
    answers.write_text(f"start: yes\n{few}", encoding="utf-8")
    done = world.canbase("bus", "adopt", "--yes", "--answers", str(answers))
    assert ("robot.yaml has 2 nodes, 1 found" in done.stdout) is (few != "")
    assert said in done.stderr
    assert ("node id [1] 1" in done.stdout) is (said == "")
