"""`canbase demo`, as a newcomer runs it."""

from __future__ import annotations

import sys

import pytest

from ros.conftest import Spawn

pytestmark = [pytest.mark.ros, pytest.mark.timeout(200)]


def test_the_demo_holds_and_says_what_it_checked(spawn: Spawn) -> None:
    demo = spawn([sys.executable, "-m", "canbase_cli", "demo", "--speed", "0.5"], env={"COLUMNS": "120"})
    assert demo.wait(180.0) == 0, demo.log()
    for line in (
        "drive 1.0 succeeded",
        "ground truth: 1 m ± 10 mm",
        "Ctrl-C cancels the goal",
        "nothing moved after",
        "Next:",
    ):
        assert line in demo.log()
