"""Anchors of YAML that are defined again: the later one counts, and nobody is warned a thousand times."""

from __future__ import annotations

import warnings
from pathlib import Path

from canbase_config.yaml_file import read_yaml


def test_an_anchor_that_is_defined_again_is_no_warning(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text("".join(f"key{number}: &a {number}\n" for number in range(500)) + "last: *a\n", encoding="utf-8")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert read_yaml(file).values["last"] == 499
    assert caught == []
