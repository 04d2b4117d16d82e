"""`canbase bus adopt` as a process: drives fresh from the box, both node 1 at 125 kbit/s, on a bus with bit rates.

What it decides is held in virtual time: unit/commissioning/test_adopt_command.py.
"""

from __future__ import annotations

import json
import re
import signal
import subprocess
import time
from pathlib import Path

import can
import pytest

from canbase_config.bit_rate import bus_at
from canbase_config.load import load_robot
from canbase_sim.control import SimControl
from support.bus_tool import ENVIRONMENT, argv, canbase, drives, write_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus

FRESH = "--factory-fresh"
PATIENCE_S = 150.0
"""For a loaded computer."""


def test_two_drives_fresh_from_the_box_are_ready_and_stay_so_over_a_power_cycle(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    with drives(config, FRESH) as control:
        words = ("--config", str(config), "--yes", "--present-bitrate", "125000")
        done = canbase("bus", "adopt", *words, timeout_s=PATIENCE_S)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "node 1: two drives or more have this node id" in done.stdout
        assert re.findall(r"ready: node (\d), 500000 bit/s, serial (\d)h", done.stdout) == [("1", "1"), ("2", "2")]
        power_cycle(control)
        found = canbase("bus", "scan", "--config", str(config), "--seconds", "0.2", "--json")
    assert found.returncode == 0, found.stderr
    assert [(row["node_id"], row["serial"]) for row in json.loads(found.stdout)] == [(1, 1), (2, 2)]


def power_cycle(control: SimControl) -> None:
    """Both drives off and on; they boot again in half a second."""
    for node in (1, 2):
        control.fault(node, "power_cycle")
    time.sleep(1.0)


def test_ctrl_c_leaves_the_drives_waiting(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    factory = bus_at(load_robot(config).robot.bus, 125_000).arguments()
    words = argv("bus", "adopt", "--config", str(config), "--yes", "--present-bitrate", "125000")
    with drives(config, FRESH):
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT)
        assert process.stderr is not None
        spy = can.BufferedReader()
        with can.Bus(**factory) as bus, can.Notifier(bus, [spy], timeout=0.05):
            for line in process.stderr:
                if "fastscan, drive 2" in line:
                    break
            process.send_signal(signal.SIGINT)
            _, told = process.communicate(timeout=PATIENCE_S)
            requests = _requests(spy)
        assert process.returncode == 130
        assert "stopped by SIGINT. The drives are in LSS waiting. Nothing was stored" in told
        assert requests[-1] == bytes((4, 0, 0, 0, 0, 0, 0, 0))


def _requests(spy: can.BufferedReader) -> list[bytes]:
    """The LSS requests that have come so far."""
    found = []
    while (message := spy.get_message(0.2)) is not None:
        if message.arbitration_id == 0x7E5:
            found.append(bytes(message.data))
    return found
