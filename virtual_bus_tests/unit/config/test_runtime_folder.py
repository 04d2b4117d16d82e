"""Where the bench's sockets go: a folder that belongs to the user alone."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from canbase_config.load import load_robot, sample
from canbase_config.runtime_folder import placed, with_runtime_folder

PATH = "$XDG_RUNTIME_DIR/canbase-bench/lease.sock"
NOBODY = 54321
"""A user without a folder in /run/user."""


def test_the_bench_uses_the_runtime_folder_of_its_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tmp_path.chmod(0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert load_robot(sample("bench")).robot.lease.socket == f"{tmp_path}/canbase-bench/lease.sock"


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o1777])
def test_a_folder_in_which_others_may_write_does_not_count(tmp_path: Path, mode: int) -> None:
    tmp_path.chmod(mode)
    assert not placed(PATH, {"XDG_RUNTIME_DIR": str(tmp_path)}, os.geteuid()).startswith(str(tmp_path))


@pytest.mark.parametrize("folder", ["", "run", "/does/not/exist", __file__])
def test_without_one_the_name_has_the_number_of_the_user(folder: str) -> None:
    assert placed(PATH, {"XDG_RUNTIME_DIR": folder}, NOBODY) == f"/tmp/user{NOBODY}-canbase-bench/lease.sock"


def test_a_folder_of_another_user_does_not_count(tmp_path: Path) -> None:
    tmp_path.chmod(0o700)
    assert placed(PATH, {"XDG_RUNTIME_DIR": str(tmp_path)}, NOBODY).startswith(f"/tmp/user{NOBODY}-")


def test_any_other_path_and_what_is_no_path_stay_as_they_are() -> None:
    assert placed("/run/canbase/lease.sock", {"XDG_RUNTIME_DIR": "/run/user/1"}, 1) == "/run/canbase/lease.sock"
    odd: list[dict[str, object]] = [{}, {"lease": 3}, {"lease": {"socket": 3}}, {"lease": {}}]
    for values in odd:
        assert with_runtime_folder(values, {}, NOBODY) == values
