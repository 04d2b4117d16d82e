"""Only types that are installed are imported, whatever a recording or another process calls a type."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from canbase_recording.ros_types import message_class, whole_definition


@pytest.fixture
def trap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package whose import leaves a file; it is on the path of modules and in no ament index."""
    for name in ("msg", "srv"):
        folder = tmp_path / "trap" / name
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text(f"open({str(tmp_path / 'sprung')!r}, 'w').close()\nclass Odometry: pass\n")
    (tmp_path / "trap" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path / "sprung"


@pytest.mark.parametrize(
    "name",
    ["trap/msg/Odometry", "trap/srv/Odometry", "../trap/msg/Odometry", "os/path/join", "nav_msgs/msg/Nothing",
     "nav_msgs/msg/../x", "nav_msgs.trap/msg/Odometry", "nav_msgs/msg", "", "a/b/c/d"],
)  # fmt: skip
def test_a_type_that_the_index_does_not_list_is_not_imported(name: str, trap: Path) -> None:
    before = set(sys.modules)
    for read in (message_class, whole_definition):
        with pytest.raises(ModuleNotFoundError):
            read(name)
    assert not trap.exists()
    assert set(sys.modules) == before


@pytest.mark.parametrize(
    "name", ["nav_msgs/msg/Odometry", "canbase/msg/DriverStatus", "canbase/action/DriveDistance_FeedbackMessage"]
)
def test_an_installed_type_is_known(name: str) -> None:
    assert message_class(name).get_fields_and_field_types()
    assert whole_definition(name)
