"""Fixtures of the tests of commissioning."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.command_world import CommandWorld


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CommandWorld:
    """Two drives as robot.yaml has them, and the commands before them."""
    return CommandWorld(tmp_path, monkeypatch)
