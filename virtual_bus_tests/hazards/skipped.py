"""Hook of pytest: a test that a row of hazards.yaml names proves nothing when it is skipped, so that fails it.

What needs root is skipped for another user, and proves nothing there: `.ci/run` runs it as root.
"""

from __future__ import annotations

from collections.abc import Generator
from functools import cache

import pytest

from canbase_hazards import catalogue
from hazards import proofs
from support.needs_root import lacks_root


@cache
def _names() -> frozenset[str]:
    return proofs.pytest_names(catalogue.load())


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
