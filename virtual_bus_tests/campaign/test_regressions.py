"""What has violated a property once: regressions.yaml."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign import regressions
from campaign.regressions import Regression

pytestmark = pytest.mark.campaign


@pytest.mark.parametrize("row", regressions.load(), ids=lambda row: str(row.seed))
def test_it_holds_now_or_is_still_open(row: Regression) -> None:
    """A row that is open and holds is not open any more."""
    violated = {violation.name for violation in row.run().violations}
    assert violated == ({row.violated} if row.open else set())


def test_a_row_with_an_unknown_property_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "regressions.yaml"
    file.write_text("- {name: something, seed: 1, violated: nonsense}\n")
    monkeypatch.setattr(regressions, "FILE", file)
    with pytest.raises(ValueError, match="seed 1 names a property or a fault that does not exist"):
        regressions.load()
