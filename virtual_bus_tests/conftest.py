"""Fixtures of all tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def ordinary_priority() -> Iterator[None]:
    """Commands that a test calls inside its own process leave that one as it is: all it starts would inherit it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("canbase_cli.process.raise_priority", lambda part: None)
        yield
