"""The rows of the exit matrix that every change has to pass; with CANBASE_EXIT_MATRIX=all every row.

`make exit-matrix` runs every row too, and measures.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from exit_matrix.failures import ROWS, Row
from exit_matrix.runner import Runner

pytestmark = [pytest.mark.ros, pytest.mark.timeout(150)]


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    with Runner() as running:
        yield running


ALL = os.environ.get("CANBASE_EXIT_MATRIX") == "all"


@pytest.mark.parametrize("row", [row for row in ROWS if row.common or ALL], ids=lambda row: row.name)
def test_the_robot_stops_in_time_and_stays_at_rest(runner: Runner, row: Row) -> None:
    assert runner.run(row).problem == ""
