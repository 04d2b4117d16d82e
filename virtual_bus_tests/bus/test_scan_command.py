"""`canbase bus scan` as a command, on a multicast bus with simulated drives."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import can
import pytest

from canbase_config.bit_rate import bus_at
from canbase_config.load import load_robot
from support.bus_tool import canbase, drives, write_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus


def test_it_finds_both_drives_and_says_what_they_are(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    with drives(config):
        done = canbase("bus", "scan", "--config", str(config), "--seconds", "0.3", "--json")
        table = canbase("bus", "scan", "--config", str(config), "--seconds", "0.3")
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    assert [(row["node_id"], row["profile"], row["in_robot"]) for row in rows] == [
        (1, "generic", "left_wheel"),
        (2, "generic", "right_wheel"),
    ]
    assert rows[0]["heartbeat"] == "off (1017h = 0)"
    assert "canbase simulated drive" in table.stdout
    assert "\x1b[" not in table.stdout


def test_two_drives_with_one_node_id_are_named_at_once(tmp_path: Path) -> None:
    port = free_udp_port()
    config = write_robot(tmp_path, port)
    factory = bus_at(load_robot(config).robot.bus, 125_000).extra["port"]
    at_the_rate_of_the_drives = write_robot(tmp_path, factory, "factory.yaml")
    with drives(config, "--factory-fresh"):
        done = canbase("bus", "scan", "--config", str(at_the_rate_of_the_drives), "--seconds", "0.3", "--json")
    assert done.returncode == 1
    assert "node 1: two drives or more answer. canbase bus adopt gives each drive a separate node id" in done.stderr
    row = json.loads(done.stdout)[0]
    assert (row["node_id"], row["serial"]) == (1, None)


def test_drives_that_answer_and_send_nothing_are_explained(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    with drives(config):
        done = canbase("bus", "scan", "--config", str(config), "--seconds", "0.3")
    assert done.returncode == 0
    assert "node 1, 2: answers SDO and sends nothing; its heartbeat is off (1017h = 0)" in done.stderr


def test_a_drive_of_robot_yaml_that_does_not_answer_is_1_and_its_node_is_named(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    with drives(config) as control:
        control.fault(2, "cut")
        done = canbase("bus", "scan", "--config", str(config), "--seconds", "0.3")
    assert done.returncode == 1
    assert "node 2 of robot.yaml is not on the bus" in done.stderr


def test_where_another_master_speaks_it_only_listens_unless_told_otherwise(tmp_path: Path) -> None:
    port = free_udp_port()
    config = write_robot(tmp_path, port)
    with drives(config), can.Bus("239.74.163.2", "udp_multicast", port=port, hop_limit=0) as other:
        message = can.Message(arbitration_id=0x080, is_extended_id=False)
        stopped = threading.Event()
        thread = threading.Thread(target=_repeat, args=(other, message, stopped))
        thread.start()
        quiet = canbase("bus", "scan", "--config", str(config), "--seconds", "0.3", "--json")
        asking = canbase("bus", "scan", "--config", str(config), "--seconds", "0.3", "--json", "--yes")
        stopped.set()
        thread.join()
    assert "another master is on this bus:\n  SYNC" in quiet.stderr
    assert "use --yes to read anyway" in quiet.stderr
    assert [row["vendor_id"] for row in json.loads(quiet.stdout)] == [None, None]
    assert asking.returncode == 0
    assert [row["profile"] for row in json.loads(asking.stdout)] == ["generic", "generic"]


def _repeat(bus: can.BusABC, message: can.Message, stopped: threading.Event) -> None:
    while not stopped.wait(0.02):
        bus.send(message)


def test_a_bus_that_cannot_be_opened_is_1_with_advice_and_no_traceback() -> None:
    done = canbase("bus", "scan", "--channel", "can77")
    assert done.returncode == 1
    assert "can77" in done.stderr
    assert "ip -details link show" in done.stderr
    assert "Traceback" not in done.stderr


def test_an_empty_bus_is_1(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    done = canbase("bus", "scan", "--config", str(config), "--seconds", "0.1")
    assert done.returncode == 1
    assert "power, cable, termination, bit rate" in done.stderr


def test_help_has_examples() -> None:
    done = canbase("bus", "scan", "--help")
    assert done.returncode == 0
    assert "canbase bus scan --channel can0" in done.stdout
