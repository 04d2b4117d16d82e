"""Fixtures of all tests."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, Phase, settings

from canbase_config.load import sample
from canbase_runtime.which_robot import VARIABLE
from hazards.proof_rules import pytest_itemcollected as pytest_itemcollected
from hazards.proof_rules import pytest_runtest_makereport as pytest_runtest_makereport
from hazards.tested import pytest_collection_modifyitems as pytest_collection_modifyitems
from support.needs_root import pytest_runtest_setup as pytest_runtest_setup
from support.second_run import pytest_sessionfinish as pytest_sessionfinish
from support.second_run import pytest_terminal_summary as pytest_terminal_summary

# What runs or is installed on this computer is no robot of the tests.
os.environ[VARIABLE] = str(sample("bench"))
# The same examples each time, on a slow machine too: a run judges the change before it, and says what failed as it was
# drawn. HYPOTHESIS_PROFILE=default looks for new examples and makes a failing one as short as it can.
settings.register_profile(
    "same",
    derandomize=True,
    deadline=None,
    max_examples=50,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)
# `make nightly`: new examples of a seed that is printed.
settings.register_profile(
    "nightly", deadline=None, max_examples=300, print_blob=True, database=None,
    suppress_health_check=[HealthCheck.too_slow],
)  # fmt: skip
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.fixture(scope="session", autouse=True)
def ordinary_priority() -> Iterator[None]:
    """Commands that a test calls inside its own process leave that one as it is: all it starts would inherit it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("canbase_cli.services.raise_priority", lambda part: None)
        yield


@pytest.fixture(autouse=True)
def short_pauses(request: pytest.FixtureRequest) -> None:
    """What lives until the end of the run is not looked through again while a test in real time runs, as the services
    do at their start: by the end of a run Python's collector stood still for 0.1 s, and safety code notices that."""
    if {"bus", "ros"} & {mark.name for mark in request.node.iter_markers()}:
        gc.collect()
        gc.freeze()
