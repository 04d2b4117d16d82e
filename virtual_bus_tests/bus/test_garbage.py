"""A simulated bus is a UDP port: what is no frame is dropped and counted by whoever reads it, and ends nobody."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path
from typing import Any

import can
import pytest

from canbase_config.load import load_robot, sample
from canbase_config.robot import Bus
from canbase_driver.cia301.frame import Frame
from canbase_driver.runtime import bus_port as of_the_driver
from canbase_sim.loop import Loop
from canbase_sim.rated_bus import RatedBus
from canbase_watchdog import bus_port as of_the_watchdog
from support import garbage
from support.bus_tool import ENVIRONMENT, argv, canbase, drives, write_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus
MANY = 100
"""As many as fit into a socket's buffer."""
GOOD = can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False)


def arguments(port: int) -> dict[str, Any]:
    """As robot.yaml without `extra` gives them."""
    bus = load_robot(sample("bench")).robot.bus.model_copy(update={"extra": {"port": port}})
    return bus.arguments()


def test_without_extra_no_frame_leaves_the_computer() -> None:
    bus = load_robot(sample("bench")).robot.bus

    assert bus.model_copy(update={"extra": {}}).arguments()["hop_limit"] == 0
    assert bus.model_copy(update={"extra": {"hop_limit": 2}}).arguments()["hop_limit"] == 2


def test_the_driver_drops_and_counts_it_and_takes_the_frame_behind_it() -> None:
    """The tools have the same handle."""
    port = free_udp_port()
    bus, other = of_the_driver.BusPort(arguments(port)), can.Bus(**arguments(port))
    garbage.send(port, MANY)
    other.send(GOOD)

    found = next(filter(None, (bus.receive(0.2) for _ in range(MANY + 1))), None)

    assert found == Frame(0x181, b"\1")
    assert bus.receive(0.2) is None, "nothing waits behind it"
    assert (bus.report.dropped, bus.report.receive_errors, bus.report.failures, bus.problem) == (MANY, 0, 0, "")
    bus.close()
    other.shutdown()


def test_the_watchdog_drops_and_counts_it_and_takes_the_frame_behind_it() -> None:
    port = free_udp_port()
    with of_the_watchdog.BusPort(arguments(port)) as bus, can.Bus(**arguments(port)) as other:
        garbage.send(port, MANY)
        other.send(GOOD)
        time.sleep(0.05)

        seen = [frame[:2] for _ in range(MANY) for frame in bus.receive(time.monotonic())]

        assert seen == [(0x181, b"\1")]
        assert (bus.health.receive_errors, bus.health.failed_since) == (0, float("inf"))
        assert bus.datagrams_dropped > MANY // 2  # the others were frames, of kinds that CANopen does not use


def test_a_bus_that_fails_is_no_garbage(monkeypatch: pytest.MonkeyPatch) -> None:
    port = free_udp_port()
    with of_the_watchdog.BusPort(arguments(port)) as bus:
        monkeypatch.setattr(bus._bus, "read", _network_is_down)
        assert list(bus.receive(time.monotonic())) == []
        assert (bus.health.receive_errors, bus.datagrams_dropped) == (1, 0)
    driver = of_the_driver.BusPort(arguments(port))
    monkeypatch.setattr(driver._bus, "read", _network_is_down)
    assert driver.receive(0.0) is None
    assert (driver.report.receive_errors, driver.report.dropped) == (1, 0)
    driver.close()
    loop = Loop.__new__(Loop)
    loop._bus = RatedBus(Bus(interface="udp_multicast", channel="239.74.163.2", extra={"port": port}))
    monkeypatch.setattr(loop._bus, "receive", _network_is_down)
    with pytest.raises(can.CanOperationError):
        loop._receive()
    loop._bus.close()


def _network_is_down(_timeout: float) -> None:
    raise can.CanOperationError("receiving failed") from OSError("network is down")


def test_the_simulator_lives_and_answers_a_tool_meanwhile(tmp_path: Path) -> None:
    port = free_udp_port()
    config = write_robot(tmp_path, port)
    with drives(config) as control:
        garbage.send(port, MANY)
        told = canbase("bus", "sdo", "read", "1", "0x1000", "--config", str(config))
        garbage.send(port, MANY)
        time.sleep(0.1)
        assert control.truth().linear_mps == 0.0

    assert told.returncode == 0, told.stderr


def test_the_watchdog_lives_and_says_how_many(tmp_path: Path) -> None:
    port = free_udp_port()
    config = write_robot(tmp_path, port)
    command = argv("serve", "watchdog", "--config", str(config))
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT)
    limit = time.monotonic() + 20.0
    while not (tmp_path / "lease.sock").exists() and time.monotonic() < limit:
        time.sleep(0.05)
    garbage.send(port, MANY)
    time.sleep(0.5)
    process.terminate()
    _, log = process.communicate(timeout=10.0)

    assert process.returncode == 0, log
    assert "datagrams that are no frame: " in log
    assert "receive errors" not in log
    assert "ended by SIGTERM" in log
