"""Stop frames from a process of their own: `python -m canbase_watchdog.post_stop`, on a real bus."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import pytest

from canbase_base.single_instance import bus_name, take
from canbase_config.load import load_robot
from canbase_config.watchdog import WatchdogConfig, WatchedLayout
from canbase_watchdog.post_stop import LIMIT_S, main, plan
from support.bus_tool import write_robot
from support.udp_port import free_udp_port
from support.watchdog_story import config

pytestmark = pytest.mark.bus

QUICK_STOPS = [(0x501, "0200"), (0x502, "0200")]
PRE_OPERATIONAL = [(0x000, "8001"), (0x000, "8002")]


@pytest.fixture
def bus_arguments() -> dict[str, Any]:
    return {"interface": "udp_multicast", "channel": "239.74.163.2", "port": free_udp_port(), "hop_limit": 0}


@pytest.fixture
def listener(bus_arguments: dict[str, Any]) -> Iterator[can.BusABC]:
    with can.Bus(**bus_arguments) as bus:
        yield bus


def stop_file(folder: Path, told: WatchdogConfig) -> Path:
    path = folder / "stop.json"
    path.write_text(told.to_json())
    return path


def run(path: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "canbase_watchdog.post_stop", str(path)],
        env=os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"},
        capture_output=True,
        text=True,
        timeout=LIMIT_S + 10,
        check=False,
    )


def frames_on(bus: can.BusABC) -> list[tuple[int, str]]:
    found = []
    while (message := bus.recv(0.2)) is not None:
        found.append((message.arbitration_id, bytes(message.data).hex()))
    return found


def test_quick_stops_first_and_pre_operational_after_them(
    listener: can.BusABC, bus_arguments: dict[str, Any], tmp_path: Path
) -> None:
    ended = run(stop_file(tmp_path, replace(config(), bus_arguments=bus_arguments)))

    assert frames_on(listener) == QUICK_STOPS * 3 + PRE_OPERATIONAL
    assert (ended.returncode, ended.stderr) == (0, "stop frames sent\n")


WAITING = """
import sys, time
from canbase_cli.services import start_post_stop
from canbase_config.load import load_robot
start_post_stop(load_robot(sys.argv[1]).robot)
print("started", flush=True)
time.sleep(60)
"""
"""A process as driver and watchdog are: it has the stop frames sent after its end."""


# started ── 0.5 s: SIGINT and SIGTERM to the process that waits ── SIGKILL of the one that it waits for ── stop frames
def test_after_the_end_of_a_process_that_nobody_supervises(tmp_path: Path) -> None:
    robot = write_robot(tmp_path, free_udp_port())
    bus = load_robot(robot).robot.bus
    with can.Bus(**bus.arguments()) as listener:
        process = subprocess.Popen([sys.executable, "-c", WAITING, str(robot)], stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        (waiting,) = children(process.pid)
        assert listener.recv(0.5) is None
        for number in (signal.SIGINT, signal.SIGTERM):
            os.kill(waiting, number)
        assert listener.recv(0.1) is None
        process.kill()
        process.communicate()
        assert frames_on(listener) == QUICK_STOPS * 3 + PRE_OPERATIONAL


def children(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


# a watchdog holds the bus ── a second `canbase serve watchdog` ends ── no stop frames
def test_a_second_watchdog_stops_no_robot_by_its_end(tmp_path: Path) -> None:
    robot = write_robot(tmp_path, free_udp_port())
    arguments = load_robot(robot).robot.bus.arguments()
    with can.Bus(**arguments) as listener, take("watchdog", bus_name(arguments)):
        command = [sys.executable, "-m", "canbase_cli", "serve", "watchdog", "--config", str(robot)]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert ended.returncode == 1
        assert "watchdog" in ended.stderr
        assert frames_on(listener) == []


def test_both_axes_of_one_node_are_stopped_by_one_frame() -> None:
    both = tuple(replace(drive, node_id=5, axis=axis) for axis, drive in enumerate(config().drives))

    rounds = plan(replace(config(), drives=both))

    assert [[(f.cob_id, f.data.hex()) for f in frames] for frames in rounds] == [
        *([[(0x505, "02000200")]] * 3),
        [(0x000, "8005")],
    ]


def test_a_bus_that_is_not_there(tmp_path: Path) -> None:
    nowhere = {"interface": "socketcan", "channel": "nocan7"}

    ended = run(stop_file(tmp_path, replace(config(), bus_arguments=nowhere)))

    assert ended.returncode == 1
    assert "nocan7" in ended.stderr


@pytest.mark.parametrize("text", ["", "{}", '{"drives": 3}', "[]"])
def test_a_file_that_tells_nothing(tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "stop.json"
    path.write_text(text)

    assert main([str(path)]) == 2
    assert str(path) in capsys.readouterr().err


def test_a_missing_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none")]) == 2
    assert "none" in capsys.readouterr().err


def test_an_adapter_that_blocks_ends_in_bounded_time(tmp_path: Path) -> None:
    fifo = tmp_path / "blocks"
    os.mkfifo(fifo)  # opening it waits for a writer that never comes, like a driver that hangs in the kernel

    assert run(fifo).returncode == -14


def test_two_motors_behind_one_controlword_get_one_word() -> None:
    """The quick stop PDO of such a node carries 6040h once; a longer frame may be refused."""
    told = config()
    shared = WatchedLayout(sub_index=True, shared_controlword=True, packed_statusword=True)
    drives = tuple(replace(drive, node_id=1, axis=i, layout=shared) for i, drive in enumerate(told.drives))
    first_round = plan(replace(told, drives=drives))[0]
    assert [(frame.cob_id, frame.data.hex()) for frame in first_round] == [(0x501, "0200")]
