"""Robots whose truth is drawn: `canbase doctor` leads to it and accuses nothing that is well. More: doctor_score."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import pytest

from campaign import scores
from campaign.doctor_score import Answer, answers, judge_fault, names, told
from campaign.scores import CANNOT_TELL, RIGHT, WRONG
from canbase_campaign.scenario import Start
from canbase_doctor.check import Check, fail, warn
from support.doctor_look import doctor

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]
WERE_WRONG = (870040, 870042)
"""A second master beside the driver, and a well drive that stopped by itself as the heartbeat was withheld."""


def test_what_is_well_is_not_accused_and_advice_leads_to_what_is_wrong() -> None:
    found = list(answers(WERE_WRONG))
    assert len(found) == 2 * len(WERE_WRONG)
    assert [told(answer) for answer in found if answer.score == WRONG] == []
    assert any(answer.rows for answer in found)


def test_a_healthy_robot_has_good_rows_alone() -> None:
    assert [row for row in doctor(Start().world) if row.advice] == []


@pytest.mark.parametrize(
    ("wheel", "rows", "score"),
    [
        (2, [fail("watchdog", "drive silent of node 2", "look")], RIGHT),
        (2, [fail("watchdog", "drive silent of node 1", "look")], WRONG),
        (2, [fail("x", "node 2", "look"), fail("drive left_wheel (node 1)", "fault", "look")], WRONG),
        (2, [warn("x", "another program", "end it"), fail("x", "right_wheel", "look")], RIGHT),
        (2, [fail("watchdog", "base motion not as ordered", "look")], CANNOT_TELL),
        (2, [], CANNOT_TELL),
    ],
)
def test_the_first_advice_counts_and_each_drive_that_is_accused(wheel: int, rows: list[Check], score: str) -> None:
    assert judge_fault(1, "", names(wheel), wheel, rows).score == score


def test_a_robot_that_is_well_is_right_without_a_row_and_wrong_with_an_accusation() -> None:
    def healthy(rows: list[Check]) -> Answer:
        return judge_fault(1, "", "nothing is wrong", 0, rows)

    assert healthy([]).score == RIGHT
    assert healthy([warn("masters", "SYNC", "another program commands this bus: end it")]).score == WRONG


@pytest.mark.parametrize(("wrong", "code"), [(1, 0), (2, 1)])
def test_more_than_one_wrong_answer_of_a_hundred_fails_and_the_score_is_kept(
    wrong: int, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scores, "FILE", tmp_path / "scores.json")

    def hundred(seeds: Iterable[int]) -> list[Answer]:
        return [Answer(seed, "", ("accused",) if at < wrong else ()) for at, seed in enumerate(seeds)]

    assert scores.main("doctor", "robots", "", 100, hundred, told, ["--keep"]) == code
    kept = {"doctor": f"{100 - wrong} right, 0 cannot tell, {wrong} wrong of 100 robots"}
    assert json.loads(scores.FILE.read_text(encoding="utf-8")) == kept
