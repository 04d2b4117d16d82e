"""The report of a folder: made again from its results alone, and never about another robot or more than was run."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.fingerprint import configuration_sha256
from canbase_config.load import Loaded, load_robot, sample
from canbase_qualification import folder, results_file
from canbase_qualification.job import Amount, Load
from canbase_qualification.outcome import Outcome
from canbase_qualification.report_files import read_report, write_report
from canbase_qualification.simulated_robot import simulated
from canbase_qualification.software import Software
from canbase_qualification.verdict import Grade
from support.made_results import KILLED, driving, passed, scenario, stops

BENCH = load_robot(sample("bench"))
FAILURES = len(simulated(BENCH.robot).failures)


def made(path: Path, outcomes: list[Outcome], *, amount: Amount | None = None, loaded: Loaded = BENCH) -> Path:
    """A folder with these results, in which just so much was asked for."""
    software = Software("0.1.0", "abc", "3.11.2", "2.1.0")
    amount = amount or Amount(scenarios=30, stops=1, drives=2)
    about = folder.About(
        loaded.robot.name,
        str(loaded.path),
        configuration_sha256(loaded.robot),
        software,
        Load(),
        amount,
        0.8,
        ("It is dry.",),
        (),
    )
    folder.write(path, about, loaded.path.read_bytes())
    (path / results_file.NAME).write_text("".join(f"{outcome.line()}\n" for outcome in outcomes), encoding="utf-8")
    return path


def test_three_files_with_the_same_verdict(tmp_path: Path) -> None:
    report, paths = write_report(made(tmp_path, passed()), BENCH)
    assert report.grade is Grade.PASSED
    assert sorted(path.name for path in paths) == ["report.html", "report.json", "report.md"]
    assert all(report.verdict in path.read_text(encoding="utf-8") for path in paths)
    found = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert found["configuration_sha256"] == configuration_sha256(BENCH.robot)
    assert found["versions"]["canbase"] == "0.1.0, sources abc"
    assert found["assumed"] == ["It is dry."]


def test_the_same_results_make_the_same_files(tmp_path: Path) -> None:
    _, paths = write_report(made(tmp_path, passed()), BENCH)
    before = [path.read_bytes() for path in paths]
    write_report(tmp_path, BENCH)
    assert [path.read_bytes() for path in paths] == before


def test_what_was_asked_for_and_is_missing_makes_it_incomplete(tmp_path: Path) -> None:
    outcomes = [scenario(0), driving(0, lease_s=0.05), *stops(KILLED, FAILURES - 1)]
    report = read_report(made(tmp_path, outcomes, amount=Amount(scenarios=1, stops=1, drives=1)), BENCH)
    assert report.grade is Grade.INCOMPLETE
    assert f"{FAILURES - 1} of {FAILURES} stops" in report.verdict


def test_a_file_that_was_cut_off_is_read_up_to_there_and_is_not_passed(tmp_path: Path) -> None:
    path = made(tmp_path, passed()) / results_file.NAME
    whole = path.read_bytes()
    path.write_bytes(whole + whole[:50])
    report = read_report(tmp_path, BENCH)
    assert report.grade is Grade.INCOMPLETE
    assert "middle of a line" in report.verdict
    assert report.collected.runs.total() == len(passed())


def test_no_results_yet(tmp_path: Path) -> None:
    (made(tmp_path, []) / results_file.NAME).unlink()
    assert read_report(tmp_path, BENCH).grade is Grade.INCOMPLETE


def test_another_configuration_is_refused(tmp_path: Path) -> None:
    other = load_robot(sample("example_can0"))
    with pytest.raises(folder.FolderError, match="another configuration"):
        read_report(made(tmp_path, passed()), other)


def test_a_line_in_the_middle_that_is_no_outcome_is_named(tmp_path: Path) -> None:
    path = made(tmp_path, passed()) / results_file.NAME
    path.write_text("{}\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(results_file.ResultsError, match=r"results\.jsonl:1: "):
        read_report(tmp_path, BENCH)


def test_without_plotly_there_is_no_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "canbase_qualification.report_page", raising=False)
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    _, paths = write_report(made(tmp_path, passed()), BENCH)
    assert sorted(path.name for path in paths) == ["report.json", "report.md"]


def test_the_command_makes_it_again(tmp_path: Path) -> None:
    made(tmp_path, passed())
    words = ["qualify", str(sample("bench")), "--report", "--out", str(tmp_path)]
    told = CliRunner().invoke(app, words, catch_exceptions=False)
    assert told.exit_code == 0
    assert "No violation in 1,135 stops" in told.output
    assert (tmp_path / "report.html").exists()


@pytest.mark.parametrize(("amount", "code"), [(Amount(scenarios=31, stops=1, drives=2), 1), (None, 0)])
def test_exit_code_0_is_for_what_was_run_whole(amount: Amount | None, code: int, tmp_path: Path) -> None:
    made(tmp_path, passed(), amount=amount)
    words = ["qualify", str(sample("bench")), "--report", "--out", str(tmp_path)]
    assert CliRunner().invoke(app, words, catch_exceptions=False).exit_code == code


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    told = CliRunner().invoke(app, ["prove", "qualify", str(sample("bench")), "--report", "--out", str(tmp_path)])
    assert told.exit_code == 2
    assert "no folder of canbase prove qualify" in told.output
