"""`canbase doctor` before drives alone, on a multicast bus: it needs neither driver nor ROS 2 there."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from support.bus_tool import canbase, drives, write_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus


def test_drives_alone_are_read_and_one_that_goes_is_named(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    with drives(config) as control:
        well = canbase("doctor", "--config", str(config), "--json")
        control.fault(2, "cut")
        broken = canbase("doctor", "--config", str(config))
    assert well.returncode == 0, well.stdout + well.stderr
    rows = {row["name"]: row for row in json.loads(well.stdout)}
    assert {row["verdict"] for row in rows.values()} == {"ok"}
    assert rows["node 1 (left_wheel)"]["found"] == "0:CB402:10000:1, profile generic"
    assert "by heartbeat of the watchdog" in rows["node 2 (right_wheel): stops by itself"]["found"]
    assert broken.returncode == 1
    assert "The first check that fails: node 2 (right_wheel)" in broken.stdout
    assert "\x1b[" not in broken.stdout
