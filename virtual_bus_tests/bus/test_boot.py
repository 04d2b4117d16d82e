"""Boots in real time on python-can's virtual bus: against canopen's SDO server, and against the simulated drives."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from typing import Any

import can
import canopen
import pytest

from canbase_config.drive import Drive
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.cia301.frame import Frame
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.world.bench import Bench
from support.crews import Crew
from support.drive_rig import Surroundings

pytestmark = pytest.mark.bus
BOOTED_WITHIN_S = 5.0
EDS = str(files("canbase_config").joinpath("eds/canbase_cia402.eds"))


@pytest.fixture
def robot() -> Robot:
    return load_robot(sample("bench")).robot


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return f"boot-{request.node.name}"


def open_bus(channel: str) -> can.BusABC:
    return can.Bus(interface="virtual", channel=channel)


def message(cob_id: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)


def run(channel: str, boots: list[NodeBoot], limit_s: float) -> float:
    """As `run_on`, on a virtual bus."""
    with open_bus(channel) as bus:
        return run_on(bus, boots, limit_s)


def run_on(bus: can.BusABC, boots: list[NodeBoot], limit_s: float) -> float:
    """Runs the boots to their end, at most `limit_s`; how long they took."""
    start = time.monotonic()
    while not all(boot.done for boot in boots) and time.monotonic() < start + limit_s:
        received = bus.recv(0.005)
        now_s = time.monotonic()
        for boot in boots:
            if received is not None:
                boot.on_frame(Frame(received.arbitration_id, bytes(received.data)), now_s)
            for frame in boot.tick(now_s):
                bus.send(message(frame.cob_id, frame.data))
    return time.monotonic() - start


@contextmanager
def canopen_node(channel: str) -> Iterator[canopen.LocalNode]:
    """Node 1 of the library: an SDO server and NMT slave that is not ours. It does not boot up anew by itself."""
    with open_bus(channel) as bus:
        network = canopen.Network(bus)
        network.NOTIFIER_CYCLE = 0.05  # it looks so often whether it is to end
        network.connect()
        node = network.create_node(1, EDS)

        def on_nmt(_: int, data: bytearray, __: float) -> None:
            if data[0] == 0x82:
                network.send_message(0x701, b"\0")

        network.subscribe(0x000, on_nmt)
        try:
            yield node
        finally:
            node.set_data(0x1017, 0, bytes(2))  # ends its heartbeat
            network.disconnect()


def numbers(node: canopen.LocalNode, *objects: tuple[int, int]) -> list[int]:
    return [int.from_bytes(node.get_data(index, sub), "little") for index, sub in objects]


@contextmanager
def simulated_drives(channel: str, robot: Robot) -> Iterator[None]:
    """The bench in a thread of its own."""
    end = threading.Event()
    thread = threading.Thread(target=simulate, args=(channel, robot, end))
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join(timeout=5.0)


def simulate(channel: str, robot: Robot, end: threading.Event) -> None:
    with open_bus(channel) as bus:
        bench = Bench(robot, time.monotonic())
        while not end.is_set():
            received = bus.recv(0.002)
            now_s = time.monotonic()
            if received is not None:
                bench.on_frame(BenchFrame(received.arbitration_id, bytes(received.data)), now_s)
            for frame in bench.tick(now_s):
                bus.send(message(frame.cob_id, frame.data))


def test_the_sdo_server_of_canopen_takes_the_whole_boot(channel: str, robot: Robot) -> None:
    with canopen_node(channel) as node:
        node.set_data(0x6041, 0, bytes.fromhex("40 02"))
        boot = NodeBoot(1, robot.drives[:1], robot)
        run(channel, [boot], limit_s=10.0)
        assert boot.error is None
        assert boot.report is not None
        assert boot.report.stops_by_itself
        assert numbers(node, (0x6060, 0), (0x6007, 0), (0x605A, 0), (0x605E, 0), (0x60FF, 0)) == [3, 3, 2, 2, 0]
        assert numbers(node, (0x1016, 1), (0x1016, 2)) == [0x007E_012C, 0x007F_012C]
        assert numbers(node, (0x1600, 0), (0x1600, 1), (0x1600, 2)) == [2, 0x6040_0010, 0x60FF_0020]
        assert numbers(node, (0x1A00, 0), (0x1A00, 1), (0x1A00, 2)) == [2, 0x6041_0010, 0x6064_0020]
        assert numbers(node, (0x1403, 2), (0x1603, 0), (0x1603, 1)) == [255, 1, 0x6040_0010]
        valid = [number >> 31 for number in numbers(node, (0x1400, 1), (0x1401, 1), (0x1402, 1), (0x1403, 1))]
        assert valid == [0, 1, 1, 0]
        assert node.nmt.state == "PRE-OPERATIONAL"


def test_two_simulated_drives_boot_within_a_second_of_power_on(channel: str, robot: Robot) -> None:
    with simulated_drives(channel, robot):
        boots = [NodeBoot(drive.node_id, (drive,), robot) for drive in robot.drives]
        duration_s = run(channel, boots, limit_s=10.0)
    assert [boot.error for boot in boots] == [None, None]
    reports = [boot.report for boot in boots if boot.report]
    assert [(report.node_id, report.stops_by_itself, report.notes) for report in reports] == [
        (1, True, ()),
        (2, True, ()),
    ]
    assert duration_s <= 1.0


@pytest.mark.real_bus
def test_drives_of_each_kind_boot_beside_each_other(
    crew: Crew, arguments: dict[str, Any], around: Surroundings
) -> None:
    """Simulated ones from power on; Nanotec's boot loader, Technosoft's late boot-up and Kinco's SDOs take longest."""
    nodes: dict[int, tuple[Drive, ...]] = {}
    for drive in crew.robot.drives:
        nodes[drive.node_id] = (*nodes.get(drive.node_id, ()), drive)
    boots = [NodeBoot(node_id, drives, crew.robot) for node_id, drives in nodes.items()]
    with can.Bus(**arguments) as bus:
        duration_s = run_on(bus, boots, limit_s=8.0)
    assert [boot.error for boot in boots] == [None] * len(boots)
    assert [boot.report is not None for boot in boots] == [True] * len(boots), [boot.waiting_for for boot in boots]
    assert duration_s <= BOOTED_WITHIN_S


def test_a_drive_that_is_switched_on_later_is_waited_for(channel: str, robot: Robot) -> None:
    boot = NodeBoot(1, robot.drives[:1], robot)
    run(channel, [boot], limit_s=0.5)
    assert boot.waiting_for == "waiting for node 1 (left_wheel): the answer to 1000h:0"
    with simulated_drives(channel, robot):
        run(channel, [boot], limit_s=5.0)
    assert boot.report is not None
