"""Marker `needs_root("give a file to another user")`: for another user than root the test is skipped, with this reason.

A skipped test proves no row of hazards.yaml. `.ci/run` runs these as root and all others as a user who is not.
"""

from __future__ import annotations

import os

import pytest

MARK = "needs_root"


def lacks_root(item: pytest.Item) -> bool:
    """Whether this test needs root and this user is another."""
    return os.geteuid() != 0 and item.get_closest_marker(MARK) is not None


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skips the test before its fixtures begin."""
    if lacks_root(item):
        (purpose,) = item.get_closest_marker(MARK).args  # type: ignore[union-attr]
        pytest.skip(f"NOT CHECKED: needs root, to {purpose} (make test-root)")
