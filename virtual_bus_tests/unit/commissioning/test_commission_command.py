"""`canbase setup commission` as a command before simulated drives, in virtual time: robot.yaml, report, exit code."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_config.commissioned import identities, mark
from canbase_config.load import load_robot
from canbase_config.scale_objects import Expected
from support.command_world import CommandWorld


def write_answers(folder: Path, **answers: str) -> str:
    file = folder / "answers.yaml"
    file.write_text("".join(f"{key.replace('__', '.')}: {value}\n" for key, value in answers.items()), encoding="utf-8")
    return str(file)


def only_report(folder: Path) -> str:
    (found,) = folder.glob("commissioning-*.md")
    return found.read_text(encoding="utf-8")


def test_a_wrong_count_is_measured_again_and_changes_nothing(world: CommandWorld, tmp_path: Path) -> None:
    """Somebody types 3 revolutions where the wheel made 0.3; by that scale it makes 0.03 the second time."""
    before = world.config.read_text(encoding="utf-8")
    counts = {f"revolutions__{joint}": "0.3" for joint in ("left_wheel", "right_wheel")}
    answers = write_answers(
        tmp_path, **(counts | {"revolutions__left_wheel": "3", "revolutions__left_wheel__again": "0.05"})
    )
    options = ("--answers", answers, "--yes", "--steps", "scale,proof", "--revolutions", "0.3")
    done = world.canbase("setup", "commission", *options)
    assert abs(world.truth.v_left_mps) < 0.001
    assert done.exit_code == 1, done.stdout + done.stderr
    assert "robot.yaml is wrong: drives[0].gear_ratio" in done.stdout
    assert "the second measurement contradicts the first" in done.stderr
    assert "trial 1" not in done.stdout  # no proof with a scale in doubt
    assert world.config.read_text(encoding="utf-8") == before
    assert "the second measurement contradicts the first" in only_report(tmp_path)


def test_what_the_numbers_of_each_drive_mean_is_noted_for_later_boots(world: CommandWorld, tmp_path: Path) -> None:
    answers = write_answers(
        tmp_path,
        direction__left_wheel="forward",
        direction__right_wheel="forward",
        revolutions__left_wheel="0.3",
        revolutions__right_wheel="0.3",
    )
    options = ("--answers", answers, "--yes", "--steps", "directions,scale", "--revolutions", "0.3")
    done = world.canbase("setup", "commission", *options)
    assert done.exit_code == 0, done.stdout + done.stderr
    robot = load_robot(world.config).robot
    for drive in robot.drives:
        counts = Expected(index=0x608F, sub=1, value=drive.counts_per_motor_rev)
        assert drive.expects == (counts, Expected(index=0x608F, sub=2, value=1))
    assert f"changed drives[0].expects: none → {counts}, 608Fh:2 = 1" in done.stdout
    assert robot.commissioned.scale == mark(robot, "scale")


def test_a_report_is_never_overwritten(world: CommandWorld, tmp_path: Path) -> None:
    old = tmp_path / "proven.md"
    old.write_text("PROVEN", encoding="utf-8")
    done = world.canbase("setup", "commission", "--report", str(old), "--dry-run", "--yes")
    assert done.exit_code == 2
    assert "a report is never overwritten" in done.stderr
    assert old.read_text(encoding="utf-8") == "PROVEN"
    assert world.said == []


def test_a_wrong_direction_is_corrected_and_the_self_stop_proven(world: CommandWorld, tmp_path: Path) -> None:
    text = world.config.read_text(encoding="utf-8").replace("direction: -1 ", "direction: 1 ")
    world.config.write_text(text, encoding="utf-8")
    answers = write_answers(
        tmp_path,
        direction__left_wheel="forward",
        direction__right_wheel="backward",
        direction__right_wheel__again="forward",
    )
    done = world.canbase("setup", "commission", "--answers", answers, "--yes", "--steps", "directions,proof")
    assert done.exit_code == 0, done.stdout + done.stderr
    assert "PROVEN: every drive stopped by itself" in done.stdout
    assert "changed drives[1].direction: 1 → -1" in done.stdout
    commissioned = load_robot(world.config).robot
    assert commissioned.drives[1].direction == -1
    assert [drive.identity.serial for drive in commissioned.drives] == [1, 2]
    marks = commissioned.commissioned
    assert (marks.directions, marks.proof) == (mark(commissioned, "directions"), mark(commissioned, "proof"))
    assert marks.identities == identities(commissioned)
    assert (marks.scale, marks.floor) == (None, None)
    assert {drive.identity.product_code for drive in commissioned.drives} == {0xCB402}
    assert "# mounted mirrored" in world.config.read_text(encoding="utf-8")
    assert load_robot(tmp_path / "robot.yaml.before").robot.drives[1].direction == 1
    report = only_report(tmp_path)
    assert report.count("| this computer stopped sending |") == 2
    assert report.count("| the watchdog's heartbeat stopped, with setpoints still sent |") == 2


def test_a_drive_that_does_not_stop_by_itself_is_not_proven_and_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = CommandWorld(tmp_path, monkeypatch, profile="tmcm1636", velocity_unit=None)
    done = world.canbase("setup", "commission", "--yes", "--steps", "proof,floor")
    world.sleep(0.5)
    assert abs(world.truth.v_left_mps) < 0.001
    assert done.exit_code == 1, done.stdout + done.stderr
    assert "left_wheel DID NOT STOP when this computer stopped sending" in done.stdout
    assert "NOT PROVEN: left_wheel, right_wheel did not stop by itself" in done.stdout
    assert "the measured drive on the floor is left out" in done.stdout
    assert "**did not stop**" in only_report(tmp_path)


def test_beside_another_master_nothing_is_sent(world: CommandWorld) -> None:
    world.repeat(0x77E, b"\x05", 0.1)
    done = world.canbase("setup", "commission", "--yes")
    assert done.exit_code == 1
    assert "canbase's watchdog" in done.stderr
    assert world.said == []


def test_without_an_answer_or_a_robot_it_ends_with_advice(world: CommandWorld) -> None:
    assert world.canbase("setup", "commission", "--steps", "dance").exit_code == 2
    done = world.canbase("setup", "commission")
    assert done.exit_code == 1
    assert "no answer to wheels_up: run it on a terminal, with --yes, or give it in --answers" in done.stderr
    world.config.unlink()
    assert world.canbase("setup", "commission").exit_code == 2
