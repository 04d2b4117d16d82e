"""Hooks of pytest for the tests that prove a row of hazards.yaml: each runs, and it passes at its first run.

A proof that is skipped fails: it proves nothing. What needs root is skipped for another user; `.ci/run` runs it as
root. A proof that fails does not run again, as other tests in real time do (`support/second_run.py`): a stop that holds
at the second try alone does not hold.
"""

from __future__ import annotations

from collections.abc import Generator
from functools import cache

import pytest

from canbase_hazards import catalogue
from hazards import proofs
from support.needs_root import lacks_root

EXIT_MATRIX = "ros/test_exit_matrix.py"
"""The rows name its failures one by one."""


@cache
def _names() -> frozenset[str]:
    return proofs.pytest_names(catalogue.load()) | {EXIT_MATRIX}


def pytest_itemcollected(item: pytest.Item) -> None:
    """A proof never runs a second time."""
    if proofs.is_proof(item.nodeid, _names()):
        item.add_marker(pytest.mark.flaky(reruns=0))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A skipped proof, or one that is expected to fail, is a failure."""
    report = yield
    if report.skipped and not lacks_root(item) and proofs.is_proof(item.nodeid, _names()):
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid} proves a row of hazards.yaml and was skipped: {report.longrepr}"
    return report
