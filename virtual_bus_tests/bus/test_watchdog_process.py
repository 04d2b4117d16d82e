"""The real process `python -m canbase_watchdog` over udp_multicast and its lease socket, killed and asked to end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.frames import Frame
from support.ros_harness import clear_records
from support.watchdog_story import config
from support.watched_process import Watched, watched_process
from unit.runtime.test_output import full_pipe

pytestmark = pytest.mark.bus

NOT_A_CONFIGURATION = (TypeError, ValueError, KeyError, AttributeError)
"""What main.py takes for one."""
QUICK_STOP = Frame(0x501, bytes.fromhex("02 00"))


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[Watched]:
    with watched_process(tmp_path) as it:
        yield it


# last lease ── 0.25 s ── quick stop on the bus
def test_leases_end_at_speed(watched: Watched) -> None:
    watched.robot.drive_at(300)
    begin = time.monotonic()
    watched.robot.filter = False
    at, frame = watched.robot.first(0x501, begin)
    assert frame == QUICK_STOP
    assert 0.249 <= at - watched.robot.last_lease < 0.4
    assert watched.robot.wait_until_still() - begin < 1.0
    code, log = watched.end(signal.SIGTERM)
    assert (code, "tripped: lease lost" in log) == (0, True)


def test_the_driver_dies_at_speed(watched: Watched) -> None:
    watched.robot.drive_at(300)
    begin = time.monotonic()
    watched.robot.driver = False
    at, _ = watched.robot.first(0x501, begin)
    assert 0.28 <= at - watched.robot.last_heartbeat < 0.45
    assert watched.robot.wait_until_still() - begin < 1.0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_asked_to_end_at_speed_it_stops_first_and_then_ends_well(watched: Watched, number: signal.Signals) -> None:
    watched.robot.drive_at(300)
    begin = time.monotonic()
    code, log = watched.end(number)
    assert code == 0
    assert watched.robot.first(0x501, begin)[1] == QUICK_STOP
    assert "tripped: ended" in log
    assert f"ended by {number.name}" in log
    watched.robot.wait_until_still(timeout_s=0.1)


def test_interrupted_with_the_driver_it_stays_until_the_power_is_off(watched: Watched) -> None:
    """Enabled at rest ── SIGINT ── 0.4 s later the driver takes the power ── it ends ── the next one is clear."""
    watched.robot.word = 0x0F
    watched.robot.wait_for(lambda: all(drive.words[0] & 0x6F == 0x27 for drive in watched.robot.drives), 3.0)
    time.sleep(0.2)
    watched.process.send_signal(signal.SIGINT)
    time.sleep(0.4)
    assert watched.process.poll() is None
    watched.robot.word = 0x00
    code, log = watched.process.wait(2.0), watched.process.communicate()[1]
    assert (code, "tripped" in log) == (0, False)
    begin = time.monotonic()
    watched.start()
    watched.robot.first(0x1FE, begin, timeout_s=10.0)
    assert "tripped" not in watched.end(signal.SIGTERM)[1]


# a driver that hangs, or nobody but it was interrupted: it leaves the power on, and says so at its next start
def test_interrupted_alone_it_ends_after_a_second_and_the_next_one_is_latched(watched: Watched) -> None:
    watched.robot.word = 0x0F
    watched.robot.wait_for(lambda: all(drive.words[0] & 0x6F == 0x27 for drive in watched.robot.drives), 3.0)
    time.sleep(0.2)
    asked_s = time.monotonic()
    assert watched.end(signal.SIGINT)[0] == 0
    assert 1.0 <= time.monotonic() - asked_s < 3.0
    begin = time.monotonic()
    watched.start()
    watched.robot.first(0x1FE, begin, timeout_s=10.0)
    assert "tripped: power at end" in watched.end(signal.SIGTERM)[1]


def test_systemd_is_told_ready_alive_and_the_state_and_asked_to_end_at_rest_it_just_ends(watched: Watched) -> None:
    time.sleep(1.0)
    lines = watched.notified()
    assert lines[0] == "READY=1"
    assert "STATUS=watching" in lines
    assert 3 <= lines.count("WATCHDOG=1") <= 8
    begin = time.monotonic()
    code, log = watched.end(signal.SIGTERM)
    assert (code, "tripped" in log) == (0, False)
    assert [frame for at, frame in watched.robot.heard if at > begin and frame.cob_id == 0x501] == []
    assert not Path(watched.config.lease_socket).exists()
    assert "STOPPING=1" in watched.notified()


def test_stopped_and_continued_at_speed_it_trips_because_it_was_away(watched: Watched) -> None:
    watched.robot.drive_at(300)
    watched.process.send_signal(signal.SIGSTOP)
    time.sleep(0.15)
    begin = time.monotonic()
    watched.process.send_signal(signal.SIGCONT)
    assert watched.robot.first(0x501, begin)[0] - begin < 0.3
    assert watched.end(signal.SIGTERM)[1].count("own loop did not run") == 1


# nobody reads its log ── quick stop ── 0.5 s later its heartbeat still comes
def test_a_log_that_nobody_reads_does_not_hold_up_the_stop(tmp_path: Path) -> None:
    with full_pipe() as (_, stderr):
        it = Watched(tmp_path, stderr)
        try:
            with it.robot:
                it.robot.first(0x1FE, 0.0, timeout_s=10.0)
                it.robot.drive_at(300)
                begin = time.monotonic()
                it.robot.filter = False
                assert it.robot.first(0x501, begin)[1] == QUICK_STOP
                tripped = time.monotonic()
                it.robot.first(0x77E, tripped + 0.5)  # its line is long due: it lives and goes on
        finally:
            it.process.kill()
            it.process.communicate()
            it.systemd.close()


def test_a_second_watchdog_on_the_same_bus_leaves_the_first_alone(watched: Watched) -> None:
    second = subprocess.run(
        [sys.executable, "-m", "canbase_watchdog", "--config-json", watched.config.to_json()],
        capture_output=True,
        text=True,
        timeout=10.0,
        check=False,
    )
    assert (second.returncode, f"process {watched.process.pid} of user" in second.stderr) == (1, True)
    begin = time.monotonic()
    watched.robot.first(0x1FE, begin)


# another computer's watchdog on the bus ── 0.16 s of listening ── ended, without a frame
def test_a_watchdog_that_hears_another_one_never_sends(watched: Watched) -> None:
    """On another computer the name of the first one is not taken: here it is left out."""
    code = (
        "import sys; from canbase_base import single_instance; from canbase_watchdog import main; "
        "single_instance.take = lambda *_: open('/dev/null'); "
        "sys.exit(main.main(sys.argv[1:]))"
    )
    other = replace(watched.config, lease_socket=f"{watched.config.lease_socket}2")
    command = [sys.executable, "-c", code, "--config-json", other.to_json()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=False)
    assert (done.returncode, "another watchdog is on the bus" in done.stderr) == (1, True), done.stderr


# --- starting badly


def test_a_bus_that_cannot_be_opened_is_waited_for_until_the_end(tmp_path: Path) -> None:
    bad = replace(config(), bus_arguments={"interface": "nonsense"}, lease_socket=str(tmp_path / "lease"))
    command = [sys.executable, "-m", "canbase_watchdog", "--config-json", bad.to_json()]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=os.environ | clear_records(tmp_path))
    assert process.stderr is not None
    line = process.stderr.readline()
    process.send_signal(signal.SIGTERM)
    _, rest = process.communicate(timeout=20.0)
    assert "Check `bus` in robot.yaml" in line
    assert "Trying again every 1 s; meanwhile no drive gets power" in line
    assert (process.returncode, "ended by SIGTERM" in rest, "Traceback" in rest) == (0, True, False)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"drives": []}', '{"drives": [1]}'])
def test_what_is_no_configuration_is_none(text: str) -> None:
    with pytest.raises(NOT_A_CONFIGURATION):
        WatchdogConfig.from_json(text)


def test_without_a_configuration_it_is_2() -> None:
    command = [sys.executable, "-m", "canbase_watchdog", "--config-json", '{"drives": [1]}']
    done = subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=False)
    assert (done.returncode, "no watchdog configuration" in done.stderr) == (2, True)
    assert "Traceback" not in done.stderr


def test_the_process_loads_nothing_but_the_standard_library_python_can_its_base_and_the_dataclass() -> None:
    loaded = subprocess.run(
        [sys.executable, "-c", "import sys, canbase_watchdog.main; print(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"},
    ).stdout.split()
    own = ("canbase_watchdog", "canbase_base")
    ours = {name for name in loaded if name.startswith("canbase") and not name.startswith(own)}
    assert ours == {"canbase_config", "canbase_config.watchdog"}
    packages = {name.partition(".")[0] for name in loaded}
    assert "can" in packages
    assert packages & {"rclpy", "canopen", "pydantic", "ruamel", "numpy", "typer", "rich", "sdnotify"} == set()
