"""Fixtures of the tests in virtual time."""

from __future__ import annotations

import pytest

from support.chain_world import KINDS


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    """A test with a `kind` runs once for each kind of drive that has a profile, unless it names them itself."""
    return str(request.param)
