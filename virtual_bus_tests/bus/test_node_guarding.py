"""Node guarding over a bus in real time: the watchdog's own handle, and simulated drives that answer its requests."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from canbase_config.derive import watchdog_config
from canbase_config.robot import Bus
from canbase_sim.cia301.life_guarding import Life
from canbase_sim.control_server import ControlServer
from canbase_sim.loop import Loop
from canbase_sim.rated_bus import RatedBus
from canbase_sim.world.bench import Bench
from canbase_sim.world.trace import Trace
from canbase_watchdog.bus_port import BusPort
from canbase_watchdog.frames import guard_request
from support.crews import robot_with

pytestmark = pytest.mark.bus
PATIENCE_S = 20.0


@pytest.fixture(params=["virtual", "udp_multicast"])
def config(request: pytest.FixtureRequest, tmp_path: Path) -> Bus:
    if request.param == "virtual":
        return Bus(interface="virtual", channel=str(tmp_path), extra={})
    return Bus(interface="udp_multicast", channel="239.74.163.2", extra={"port": 43971})


@pytest.fixture
def arguments(config: Bus) -> dict[str, Any]:
    return config.arguments()


@pytest.fixture
def bench(config: Bus, tmp_path: Path) -> Iterator[Bench]:
    """Two guarded drives on that bus."""
    bench, stop = Bench(robot_with("technosoft"), time.monotonic()), threading.Event()
    trace = Trace(bench, time.monotonic())
    server = ControlServer(tmp_path / "sim", bench, trace)
    with closing(RatedBus(config)) as bus:
        loop = Loop(bus, config.bitrate, bench, trace, server)
        thread = threading.Thread(target=loop.run, args=(stop.is_set,))
        thread.start()
        yield bench
        stop.set()
        thread.join(PATIENCE_S)
    server.close()


def answers(port: BusPort, cob_id: int, wanted: int) -> list[bytes]:
    """So many answers, each to a request that is repeated until it comes."""
    found: list[bytes] = []
    end_s = time.monotonic() + PATIENCE_S
    while len(found) < wanted:
        assert time.monotonic() < end_s, f"{len(found)} answers to requests {cob_id:03X}h"
        port.send(guard_request(cob_id & 0x7F))
        time.sleep(0.02)
        found += [data for each, data, _ in port.receive(time.monotonic()) if each == cob_id and data != b"\0"]
    return found


def test_the_drives_answer_requests_with_state_and_toggle_bit(bench: Bench, arguments: dict[str, Any]) -> None:
    with BusPort(arguments) as port:
        left, right = answers(port, 0x701, 4), answers(port, 0x702, 2)
        assert {data[0] & 0x7F for data in (*left, *right)} == {0x7F}
        assert all(one[0] ^ next_[0] == 0x80 for one, next_ in pairwise(left))
        assert port.request_problem == ""
        assert port.health.send_errors == 0
    assert bench.nodes[1].guarding.life is Life.GUARDED


def test_the_configuration_of_the_watchdog_names_who_is_guarded() -> None:
    assert [drive.guarded for drive in watchdog_config(robot_with("technosoft")).drives] == [True, True]
    assert not any(drive.guarded for drive in watchdog_config(robot_with("generic")).drives)
