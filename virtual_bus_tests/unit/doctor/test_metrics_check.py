"""`canbase doctor` about `canbase serve metrics`: a row where it runs or should, none where nobody asked for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from canbase_config.load import load_robot, sample
from canbase_doctor.check import Verdict, exit_code
from canbase_doctor.evidence import Endpoint, Evidence
from canbase_doctor.metrics_check import NODE, enabled_unit, metrics
from canbase_fleet import main as fleet

SEEN = Evidence(load_robot(sample("bench")).robot, "bench.yaml", 3.0)
UNIT = "canbase-metrics@robot.service"


def running(*nodes: str) -> Evidence:
    readers = ("/other/motor_watcher", *nodes)
    return replace(SEEN, subscribers={"motor_driver/status": tuple(Endpoint(node, "a type") for node in readers)})


def test_its_node_is_known_by_the_name_that_it_has() -> None:
    assert NODE == fleet.NODE


def test_a_robot_without_metrics_has_no_row() -> None:
    assert metrics(SEEN) == []
    assert metrics(running()) == []


def test_it_is_named_where_it_runs_with_or_without_a_unit() -> None:
    (row,) = metrics(running("/robot2/canbase_metrics"))
    assert (row.verdict, row.found) == (Verdict.OK, "/robot2/canbase_metrics runs")
    (row,) = metrics(replace(running("/canbase_metrics"), metrics_unit=UNIT))
    assert row.found == f"/canbase_metrics runs, by {UNIT}"


def test_a_unit_that_is_enabled_and_does_not_run_is_a_warning_and_no_failure_of_the_robot() -> None:
    rows = metrics(replace(running(), metrics_unit=UNIT))
    assert [row.verdict for row in rows] == [Verdict.WARN]
    assert f"systemctl status {UNIT}" in rows[0].advice
    assert exit_code(rows) == 0


def test_two_of_them_are_one_too_many() -> None:
    (row,) = metrics(running("/canbase_metrics", "/canbase_metrics"))
    assert row.verdict is Verdict.WARN


# systemctl enable canbase-metrics@robot: a link beside the target of that robot
def test_the_unit_is_found_by_the_installed_name_or_by_that_of_the_robot(tmp_path: Path) -> None:
    file = Path("/etc/canbase/robot.yaml")
    assert enabled_unit(file, "bench", tmp_path) == ""
    wants = tmp_path / "canbase@robot.target.wants"
    wants.mkdir()
    (wants / UNIT).symlink_to("/etc/systemd/system/canbase-metrics@.service")
    assert enabled_unit(file, "bench", tmp_path) == UNIT
    assert enabled_unit(Path("copy.yaml"), "robot", tmp_path) == UNIT
    assert enabled_unit(Path("copy.yaml"), "bench", tmp_path) == ""
