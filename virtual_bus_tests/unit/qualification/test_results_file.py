"""results.jsonl: cut off anywhere it is read up to there; sorted it is the same, whoever was faster."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from canbase_qualification.outcome import SCENARIO, STOP, Outcome
from canbase_qualification.results_file import NAME, ResultsError, ResultsFile, read

OUTCOMES = [Outcome(SCENARIO, seed, "ä", 1.0, 0.0) for seed in range(4)]


def written(folder: Path, outcomes: list[Outcome]) -> Path:
    with ResultsFile(folder) as results:
        results.append(outcomes)
    return folder / NAME


def test_a_file_that_is_cut_off_anywhere_is_read_up_to_there_and_goes_on_from_there(tmp_path: Path) -> None:
    whole = written(tmp_path, OUTCOMES).read_bytes()
    for length in range(len(whole) + 1):
        (tmp_path / NAME).write_bytes(whole[:length])
        count = whole[:length].count(b"\n")
        with ResultsFile(tmp_path) as results:
            assert list(results.before) == OUTCOMES[:count]
            assert results.done == {(SCENARIO, seed) for seed in range(count)}
            results.append(OUTCOMES[count:])
        assert (tmp_path / NAME).read_bytes() == whole


def test_it_is_sorted_by_kind_and_seed(tmp_path: Path) -> None:
    stop = replace(OUTCOMES[0], kind=STOP, seed=9)
    with ResultsFile(tmp_path) as results:
        results.append([OUTCOMES[2], OUTCOMES[0], stop, OUTCOMES[1]])
        results.sort()
    assert list(read(tmp_path / NAME)) == [stop, *OUTCOMES[:3]]
    assert [path.name for path in tmp_path.iterdir()] == [NAME]


def test_a_line_in_the_middle_that_is_none_is_named_with_its_number(tmp_path: Path) -> None:
    path = written(tmp_path, OUTCOMES)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:2], b"\0\0\0\n", *lines[2:]]))
    with pytest.raises(ResultsError, match=f"{NAME}:3: no outcome of a run"):
        ResultsFile(tmp_path)


def test_two_cannot_write_at_the_same_time(tmp_path: Path) -> None:
    with ResultsFile(tmp_path), pytest.raises(ResultsError, match="another canbase prove qualify writes there"):
        ResultsFile(tmp_path)
    with ResultsFile(tmp_path):
        pass
