"""The simulator as a process of its own over udp_multicast: start, control socket, every way to end it."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import pytest

from canbase_config.robot import Robot
from canbase_sim.control import ControlError, SimControl, control_path
from support.sim_rig import robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus


def _robot(folder: Path, **bus: Any) -> Robot:
    """The small robot on a UDP port that nobody else uses now, with its sockets in `folder`."""
    extra = {"port": free_udp_port(), "hop_limit": 0}
    udp = {"interface": "udp_multicast", "channel": "239.74.163.2", "extra": extra}
    return robot(bus=udp | bus, lease={"socket": str(folder / "lease.sock")})


def _start(folder: Path, of: Robot, name: str = "robot.yaml") -> subprocess.Popen[str]:
    file = folder / name
    file.write_text(json.dumps(of.model_dump(mode="json")), encoding="utf-8")
    command = [sys.executable, "-m", "canbase_sim", str(file)]
    environment = os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)


@contextmanager
def _running(folder: Path, of: Robot) -> Iterator[tuple[subprocess.Popen[str], SimControl]]:
    process = _start(folder, of)
    try:
        with _connect(control_path(of)) as control:
            yield process, control
    finally:
        process.kill()
        process.communicate()


def _connect(path: Path) -> SimControl:
    end = time.monotonic() + 20.0
    while True:
        try:
            return SimControl(path)
        except ControlError:
            assert time.monotonic() < end, "the simulator does not come up"
            time.sleep(0.05)


def test_it_boots_answers_and_tells_the_truth_with_monotonic_stamps(tmp_path: Path) -> None:
    of = _robot(tmp_path)
    with can.Bus(**of.bus.arguments()) as bus, _running(tmp_path, of) as (_, control):
        seen = _frames(bus, 0.5)
        assert {0x701: b"\0", 0x702: b"\0"}.items() <= seen.items()
        bus.send(can.Message(arbitration_id=0x601, data=bytes.fromhex("4000100000000000"), is_extended_id=False))
        assert _frames(bus, 0.2)[0x581] == bytes.fromhex("4300100092010200")
        before = time.monotonic()
        truth = control.truth()
        assert before - 0.1 <= truth.time_s <= time.monotonic()
        assert (truth.x_m, truth.linear_mps) == (0.0, 0.0)
        assert control.trace(before - 0.1)


def test_an_interrupt_of_all_parts_leaves_the_drives_to_the_driver_that_stops_them(tmp_path: Path) -> None:
    """SYNC every 0.1 s ── SIGINT of the terminal, and 1.2 s later of a slow launch ── a drive still answers ── no SYNC
    any more ── they end."""
    of = _robot(tmp_path)
    ask = can.Message(arbitration_id=0x601, data=bytes.fromhex("4000100000000000"), is_extended_id=False)
    with can.Bus(**of.bus.arguments()) as bus, _running(tmp_path, of) as (process, _):
        for cycle in range(16):
            bus.send(can.Message(arbitration_id=0x80, is_extended_id=False))
            if cycle in (1, 13):
                process.send_signal(signal.SIGINT)
            _frames(bus, 0.1)
        bus.send(ask)
        assert 0x581 in _frames(bus, 0.2)
        assert process.wait(5.0) == 0


def _frames(bus: can.BusABC, seconds: float) -> dict[int, bytes]:
    """The last frame of each identifier."""
    seen: dict[int, bytes] = {}
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        message = bus.recv(left)
        if message is not None:
            seen[message.arbitration_id] = bytes(message.data)
    return seen


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_0_and_without_a_trace_on_disk(tmp_path: Path, number: signal.Signals) -> None:
    of = _robot(tmp_path)
    with _running(tmp_path, of) as (process, control):
        time.sleep(0.3)  # booted
        control.fault(1, "fault", code=0x2310)
        time.sleep(0.05)
        process.send_signal(number)
        _, told = process.communicate(timeout=5.0)
    assert process.returncode == 0
    assert "node 1 axis 0: SWITCH_ON_DISABLED → FAULT_REACTION_ACTIVE (13)" in told
    assert not control_path(of).exists()


def test_requests_that_make_no_sense_are_answered_with_what_was_expected(tmp_path: Path) -> None:
    of = _robot(tmp_path)
    with _running(tmp_path, of) as (_, control), socket.socket(socket.AF_UNIX) as raw:
        raw.settimeout(2.0)
        raw.connect(str(control_path(of)))
        answers = raw.makefile()
        for request in (b"nonsense\n", b'{"get": "everything"}\n', b"[]\n", b'{"get": "trace"}\n', b"\xff\n"):
            raw.sendall(request)
            assert "expected" in json.loads(answers.readline())["error"]
        raw.sendall(b'{"get": "truth"}\n{"get": "truth"}\n')
        assert [list(json.loads(answers.readline())) for _ in range(2)] == [["truth"], ["truth"]]
        raw.sendall(b"x" * 10_000)
        assert _hangs_up(raw)
        with pytest.raises(ControlError, match="no node 3"):
            control.fault(3, "silent")


def _hangs_up(raw: socket.socket) -> bool:
    try:
        return raw.recv(1) == b""
    except ConnectionResetError:
        return True


def test_a_second_simulator_at_the_same_socket_is_refused_and_a_dead_ones_is_replaced(tmp_path: Path) -> None:
    of = _robot(tmp_path)
    with _running(tmp_path, of) as (first, _):
        second = _start(tmp_path, of)
        _, told = second.communicate(timeout=20.0)
        assert second.returncode == 1
        assert "another simulator serves at" in told
        first.kill()
        first.wait()
    assert control_path(of).exists()
    with _running(tmp_path, of) as (_, control):
        assert control.truth().path_m == 0.0


def test_a_bus_that_is_not_there_is_a_message_and_1(tmp_path: Path) -> None:
    process = _start(tmp_path, _robot(tmp_path, interface="socketcan", channel="can77", extra={}))
    _, told = process.communicate(timeout=20.0)
    assert process.returncode == 1
    assert "CAN bus socketcan can77" in told
    assert "Traceback" not in told


def test_a_wrong_robot_file_is_2(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text("name: 7\n", encoding="utf-8")
    done = subprocess.run([sys.executable, "-m", "canbase_sim", str(file)], capture_output=True, text=True, timeout=20)
    assert done.returncode == 2
    assert "robot.yaml" in done.stderr


def test_without_a_simulator_the_client_says_how_to_start_one(tmp_path: Path) -> None:
    with pytest.raises(ControlError, match="canbase serve sim"):
        SimControl(tmp_path / "sim.sock")


LAUNCH = """
import os, subprocess, sys, time
child = subprocess.Popen([sys.executable, *sys.argv[1:]], env=os.environ | {"CANBASE_PARENT": str(os.getpid())})
print(child.pid, flush=True)
time.sleep(60)
"""
"""Starts one executable as robot.launch.py does."""


def test_what_ros2_launch_started_ends_with_it_even_when_that_is_killed(tmp_path: Path) -> None:
    """Of the drives: after the driver, which ends by the same signal."""
    of = _robot(tmp_path)
    (tmp_path / "robot.json").write_text(json.dumps(of.model_dump(mode="json")), encoding="utf-8")
    (tmp_path / "sim").symlink_to(Path(__file__).parents[2] / "deploy" / "bin" / "node")
    command = [sys.executable, "-c", LAUNCH, str(tmp_path / "sim"), "--config", str(tmp_path / "robot.json")]
    with (
        can.Bus(**of.bus.arguments()) as bus,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as launch,
    ):
        assert launch.stdout is not None
        part = int(launch.stdout.readline())
        _connect(control_path(of)).close()
        for cycle in range(6):
            bus.send(can.Message(arbitration_id=0x80, is_extended_id=False))
            if cycle == 1:
                launch.kill()
            _frames(bus, 0.1)
        _connect(control_path(of)).close()
        try:
            launch.communicate(timeout=5.0)  # until the part, too, has closed its end
        except subprocess.TimeoutExpired:
            os.kill(part, signal.SIGKILL)
            raise


def test_ctrl_c_does_not_end_the_watchdog_of_ros2_launch(tmp_path: Path) -> None:
    """It watches until the driver has stopped the base; then launch sends SIGTERM."""
    of = _robot(tmp_path)
    (tmp_path / "robot.json").write_text(json.dumps(of.model_dump(mode="json")), encoding="utf-8")
    (tmp_path / "watchdog").symlink_to(Path(__file__).parents[2] / "deploy" / "bin" / "node")
    command = [sys.executable, str(tmp_path / "watchdog"), "--config", str(tmp_path / "robot.json")]
    own = {"CANBASE_PARENT": str(os.getpid()), "XDG_STATE_HOME": str(tmp_path)}
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=os.environ | own) as watchdog:
        try:
            end = time.monotonic() + 20.0
            while not Path(of.lease.socket).exists():
                assert time.monotonic() < end, "the watchdog does not come up"
                time.sleep(0.05)
            watchdog.send_signal(signal.SIGINT)
            with pytest.raises(subprocess.TimeoutExpired):
                watchdog.wait(0.7)
            watchdog.terminate()
            assert watchdog.wait(5.0) == 0
        finally:
            watchdog.kill()
