"""Fixtures of all tests."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hypothesis import settings

# The same examples each time: a run judges the change before it. HYPOTHESIS_PROFILE=default looks for new ones.
settings.register_profile("same", derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.fixture(scope="session", autouse=True)
def ordinary_priority() -> Iterator[None]:
    """Commands that a test calls inside its own process leave that one as it is: all it starts would inherit it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("canbase_cli.process.raise_priority", lambda part: None)
        yield
