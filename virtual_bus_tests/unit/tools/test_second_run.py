"""Tests in real time that fail once run again: the run tells why, and allows few of them."""

from __future__ import annotations

import pytest

CONFTEST = """
from support.second_run import pytest_sessionfinish as pytest_sessionfinish
from support.second_run import pytest_terminal_summary as pytest_terminal_summary
"""
TESTS = """
import pytest
runs = {{}}

@pytest.mark.parametrize("number", range({unsteady}))
def test_unsteady(number):
    runs[number] = runs.get(number, 0) + 1
    assert runs[number] > 1, f"odometry of {{number}} came late"

def test_defect():
    assert {good}, "never passes"
"""


@pytest.mark.parametrize(
    ("unsteady", "good", "exit_code"),
    [
        pytest.param(0, True, pytest.ExitCode.OK, id="all pass at once"),
        pytest.param(2, True, pytest.ExitCode.OK, id="two pass the second time"),
        pytest.param(3, True, pytest.ExitCode.TESTS_FAILED, id="three are too many"),
        pytest.param(0, False, pytest.ExitCode.TESTS_FAILED, id="one fails twice"),
    ],
)
def test_a_run_allows_few_second_runs_and_prints_each_first_failure(
    pytester: pytest.Pytester, unsteady: int, good: bool, exit_code: pytest.ExitCode
) -> None:
    pytester.makeconftest(CONFTEST)
    pytester.makepyfile(TESTS.format(unsteady=unsteady, good=good))

    result = pytester.runpytest_inprocess("--reruns", "1", "-p", "no:randomly")

    assert result.ret == exit_code
    text = result.stdout.str()
    for number in range(unsteady):
        assert f"odometry of {number} came late" in text
    assert ("find the cause of each" in text) == (unsteady > 0 or not good)
