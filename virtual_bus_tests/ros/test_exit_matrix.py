"""The rows of the exit matrix that every change has to pass; with CANBASE_EXIT_MATRIX=all every row.

`make exit-matrix` runs every row too, and measures.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from signal import SIGKILL

import pytest

from exit_matrix.failures import DRIVER, ROWS, Row
from exit_matrix.runner import Runner

pytestmark = [pytest.mark.ros, pytest.mark.timeout(150)]


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    with Runner() as running:
        yield running


ALL = os.environ.get("CANBASE_EXIT_MATRIX") == "all"
CHOSEN = sorted((row for row in ROWS if row.common or ALL), key=lambda row: row.ended == (DRIVER, -SIGKILL))
"""A killed driver comes last: for 20 s DDS takes it for alive, and the robot accepts no goal."""


@pytest.mark.parametrize("row", CHOSEN, ids=lambda row: row.name)
def test_the_robot_stops_in_time_and_stays_at_rest(runner: Runner, row: Row) -> None:
    assert runner.run(row).problem == ""
