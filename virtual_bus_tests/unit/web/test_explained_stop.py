"""The recordings of the page `Stops` explained: only files that stop events name, and only recordings."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_config.load import load_robot, sample
from canbase_web.explained_stop import explained, link, missing, named

DATA = Path(__file__).parent.parent / "recording" / "data"
CABLE = str(DATA / "cable_of_left_wheel_cut.asc")
BENCH = load_robot(sample("bench")).robot


def test_a_recording_that_a_stop_event_names_is_explained() -> None:
    assert link(CABLE) == "/explained/cable_of_left_wheel_cut.asc"
    path = named(["", "/elsewhere/stop.asc", CABLE], "cable_of_left_wheel_cut.asc")
    assert path == Path(CABLE)
    status, text = explained(path, BENCH, "bench.yaml")
    assert status == 200
    assert "node 1 (left_wheel) sends nothing after 4.622 s" in text


@pytest.mark.parametrize("name", ["robot.yaml", "../data/cable_of_left_wheel_cut.asc", "", "..", CABLE])
def test_any_other_name_is_no_file(name: str) -> None:
    assert named([CABLE, ""], name) is None


def test_a_file_that_is_gone_or_is_no_recording(tmp_path: Path) -> None:
    assert link(str(tmp_path / "gone.asc")) == ""
    assert link("") == ""
    assert explained(tmp_path / "gone.asc", BENCH, "")[0] == 404
    (tmp_path / "secret.txt").write_text("(1.0) can0 181#00\n")
    status, text = explained(tmp_path / "secret.txt", BENCH, "")
    assert (status, "is no recording of a stop" in text) == (404, True)
    (tmp_path / "empty.asc").write_text("nothing")
    assert explained(tmp_path / "empty.asc", BENCH, "")[0] == 404


def test_a_name_is_escaped() -> None:
    assert "<img" not in missing("<img src=x>")


def test_a_file_name_stays_inside_the_address_of_its_link(tmp_path: Path) -> None:
    """A local user may name a file anything, and publish a stop event with it."""
    hostile = tmp_path / 'a" onclick="alert(1).asc'
    hostile.write_text("")
    assert link(str(hostile)) == "/explained/a%22%20onclick%3D%22alert%281%29.asc"
