"""`canbase prove qualify`: what it refuses, and one run as a log. What it runs: bus/test_qualify_processes.py."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_cli.qualify import payload_range
from canbase_config.load import sample
from canbase_qualification import folder
from canbase_qualification.job import FAILURES
from support.robot_files import write

pytestmark = pytest.mark.timeout(120)
ESTOP = next(place for place, each in enumerate(FAILURES) if each.key == ("emergency stop", "pressed"))


def called(*arguments: str) -> tuple[int, str]:
    told = CliRunner().invoke(app, ["prove", "qualify", *arguments])
    return told.exit_code, " ".join(told.output.split())


@pytest.mark.parametrize(("text", "found"), [("0.5..2", (0.5, 2.0)), ("1.5", (1.5, 1.5)), ("1..1", (1.0, 1.0))])
def test_a_range_of_payloads(text: str, found: tuple[float, float]) -> None:
    assert payload_range(text) == found


@pytest.mark.parametrize("text", ["", "2..1", "0..1", "1...2", "a..b", "1..", "nan", "1..1e9", "-1..2", "1,5"])
def test_what_is_no_range_of_payloads_is_refused(text: str) -> None:
    with pytest.raises(typer.BadParameter, match=r"FROM\.\.TO, each from 0\.1 to 20"):
        payload_range(text)


def test_a_file_that_is_not_there_or_is_wrong_is_told_as_everywhere(tmp_path: Path) -> None:
    code, text = called(str(tmp_path / "none.yaml"))
    assert (code, "no such file" in text) == (2, True)
    code, text = called(str(write(tmp_path, {2: "  interfase: virtual"})))
    assert (code, "interfase" in text) == (2, True)


def test_a_robot_that_cannot_be_simulated_is_refused_with_its_key(tmp_path: Path) -> None:
    file = write(tmp_path, {7: "    node_id: 1\n    profile: kinco"})
    code, text = called(str(file), "--out", str(tmp_path / "q"))
    assert code == 2
    assert "cannot be qualified: drives: generic and kinco" in text
    assert not (tmp_path / "q").exists()


def test_results_that_are_there_are_kept_and_nothing_to_resume_is_refused(tmp_path: Path) -> None:
    file = str(sample("bench"))
    (tmp_path / folder.NAME).write_text("{}")
    code, text = called(file, "--out", str(tmp_path))
    assert (code, "has results already" in text) == (2, True)
    code, text = called(file, "--out", str(tmp_path / "none"), "--resume")
    assert (code, "is no folder of canbase prove qualify" in text) == (2, True)


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    code, text = called(str(sample("bench")), "--out", str(tmp_path / "file" / "q"))
    assert (code, "cannot be written: Not a directory" in text) == (2, True)


def test_a_scenario_is_told_with_its_robot_its_plan_and_what_every_part_did() -> None:
    code, text = called(str(sample("bench")), "--scenario", "17")
    assert code == 0, text
    for words in ("seed 17:", "kg ×", "fault begins", "driver is ENABLED", "truth", "0 violations"):
        assert words in text


def test_a_stop_is_told_until_the_base_stands() -> None:
    code, text = called(str(sample("bench")), "--stop", str(ESTOP), "--payload", "2", "--frames")
    assert code == 0, text
    assert f"stop {ESTOP}: emergency stop: pressed" in text
    assert "× 2, slope" in text
    assert "driver 080" in text
    assert "from 0.800 m/s: at standstill after 0.5" in text
    assert "safety filter: estop" in text
