"""The simulated drives against an independent master, the package canopen, in real time on python-can's virtual bus."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import canopen
import pytest
from canopen import SdoAbortedError
from canopen.emcy import EmcyError

from canbase_sim.control import SimControl
from canbase_sim.control_server import ControlServer
from canbase_sim.loop import Loop
from canbase_sim.rated_bus import RatedBus
from canbase_sim.world.bench import Bench
from canbase_sim.world.trace import Trace
from support.sim_rig import MPS, robot

pytestmark = pytest.mark.bus

EDS = str(files("canbase_config").joinpath("eds/canbase_cia402.eds"))
CYCLE_S = 0.05
"""It looks so often whether it is to end [s]."""
ENABLED, QUICK_STOP, SOD = 0x27, 0x07, 0x40


class Master:
    """The master's network with both drives, the boot-ups that it heard, and the simulator's control socket."""

    control: SimControl

    def __init__(self, channel: str) -> None:
        self.network = canopen.Network()
        self.network.NOTIFIER_CYCLE = CYCLE_S
        self.nodes = [self.network.add_node(node_id, EDS) for node_id in (1, 2)]
        self.left, self.right = self.nodes
        self.booted: set[int] = set()
        for cob_id in (0x701, 0x702):
            self.network.subscribe(cob_id, self._on_boot_up)
        self.network.connect(interface="virtual", channel=channel)

    def _on_boot_up(self, cob_id: int, data: bytearray, timestamp: float) -> None:
        if bytes(data) == b"\0":
            self.booted.add(cob_id - 0x700)

    def enable(self, mps: float = 0.5) -> None:
        """Both drives to OPERATION ENABLED by SDO with ramps of 1 m/s², both targets forward."""
        for node, sign in ((self.left, 1), (self.right, -1)):
            for index, value in ((0x6060, 3), (0x6083, MPS), (0x6084, MPS), (0x6085, 2 * MPS)):
                node.sdo[index].raw = value
            node.sdo[0x60FF].raw = round(sign * mps * MPS)
            for word in (0x06, 0x07, 0x0F):
                node.sdo[0x6040].raw = word
            assert node.sdo[0x6041].raw & 0x6F == ENABLED


@contextmanager
def simulator(channel: str, control: Path) -> Iterator[SimControl]:
    """Simulated drives in a thread on a virtual channel; a connection to their control socket."""
    stop = threading.Event()
    of = robot()
    with closing(RatedBus(of.bus.model_copy(update={"channel": channel}))) as bus:
        bench = Bench(of, time.monotonic())
        trace = Trace(bench, time.monotonic())
        with closing(ControlServer(control, bench, trace)) as server:
            thread = threading.Thread(target=Loop(bus, of.bus.bitrate, bench, trace, server).run, args=(stop.is_set,))
            thread.start()
            try:
                with closing(SimControl(control)) as client:
                    yield client
            finally:
                stop.set()
                thread.join(2.0)
                assert not thread.is_alive()


@pytest.fixture
def master(tmp_path: Path) -> Iterator[Master]:
    channel = f"sim-{tmp_path.name}"
    master = Master(channel)
    try:
        with simulator(channel, tmp_path / "sim.sock") as master.control:
            _until(lambda: master.booted == {1, 2})
            yield master
    finally:
        master.network.disconnect()


def _until(holds: Callable[[], bool], timeout_s: float = 2.0) -> None:
    end = time.monotonic() + timeout_s
    while not holds():
        assert time.monotonic() < end, "not in time"
        time.sleep(0.005)


def test_boot_up_and_identity(master: Master) -> None:
    assert master.left.sdo[0x1000].raw & 0xFFFF == 402
    assert master.left.sdo[0x1018][2].raw == 0xCB402
    assert [node.sdo[0x1018][4].raw for node in master.nodes] == [1, 2]


def test_segmented_and_refused_sdo(master: Master) -> None:
    assert master.left.sdo[0x1008].raw == "canbase simulated drive"
    with pytest.raises(SdoAbortedError, match="0x06090030"):
        master.left.sdo[0x6060].raw = 1
    master.left.sdo.download(0x6084, 0, (1234).to_bytes(4, "little"), force_segment=True)
    assert master.left.sdo[0x6084].raw == 1234


def test_canopens_own_remapping_is_accepted_and_drives_on_sync(master: Master) -> None:
    """RPDO1 6040h + 60FFh and TPDO1 6041h + 6064h of type 1, set up by canopen, then 100 Hz of SYNC."""
    for node in master.nodes:
        node.sdo[0x6060].raw = 3
        for index in (0x6083, 0x6084):
            node.sdo[index].raw = MPS
        for pdo, objects in ((node.rpdo[1], (0x6040, 0x60FF)), (node.tpdo[1], (0x6041, 0x6064))):
            pdo.read()
            pdo.clear()
            for index in objects:
                pdo.add_variable(index)
            pdo.trans_type, pdo.enabled = 1, True
            pdo.save()
        for unused in (node.rpdo[2], node.rpdo[3], node.tpdo[2], node.tpdo[3]):
            unused.read()
            unused.enabled = False
            unused.save()
    master.network.nmt.state = "OPERATIONAL"
    _cycles(master, 0x06, 0, 3)
    _cycles(master, 0x07, 0, 3)
    _cycles(master, 0x0F, MPS // 2, 100)
    assert master.left.tpdo[1][0x6041].raw & 0x6F == ENABLED
    truth = master.control.truth()
    assert truth.linear_mps == pytest.approx(0.5, abs=0.01)
    assert abs(truth.y_m) < 0.002
    assert master.left.tpdo[1][0x6064].raw > 123_456


def _cycles(master: Master, word: int, target: int, count: int) -> None:
    due = time.monotonic()
    for _ in range(count):
        for node, sign in ((master.left, 1), (master.right, -1)):
            node.rpdo[1][0x6040].raw, node.rpdo[1][0x60FF].raw = word, sign * target
            node.rpdo[1].transmit()
        master.network.sync.transmit()
        due += 0.01
        time.sleep(max(0.0, due - time.monotonic()))


def test_quick_stop_by_sdo_and_the_trace_of_it(master: Master) -> None:
    """From 0.5 m/s at 2 m/s²: 0.25 s, seen in the trace's stamps."""
    master.enable(0.5)
    _until(lambda: master.control.truth().linear_mps > 0.49)
    start = time.monotonic()
    for node in master.nodes:
        node.sdo[0x6040].raw = 0x02
    _until(lambda: master.left.sdo[0x6041].raw & 0x4F == SOD)
    time.sleep(0.1)
    rows = master.control.trace(start - 0.05)
    moving = [row[0] for row in rows if abs(row[4]) > 0.005]
    assert 0.2 <= moving[-1] - start <= 0.4
    assert [b[0] - a[0] for a, b in pairwise(rows)] == pytest.approx([0.01] * (len(rows) - 1))


def test_loss_of_the_masters_heartbeat_stops_the_wheels(master: Master) -> None:
    """1016h: node 127 with 300 ms; 6007h = 1: fault and quick-stop ramp. Everything stands within 0.8 s."""
    emergencies: list[EmcyError] = []
    master.left.emcy.add_callback(emergencies.append)
    for node in master.nodes:
        node.sdo[0x1016][1].raw = 127 << 16 | 300
    beat = master.network.send_periodic(0x77F, b"\x05", 0.1)
    master.enable(0.5)
    _until(lambda: master.control.truth().linear_mps > 0.49)
    beat.stop()
    start = time.monotonic()
    _until(lambda: master.control.truth().standing_s > 0.1)
    moving = [row[0] for row in master.control.trace(start) if abs(row[4]) > 0.005]
    assert 0.3 <= moving[-1] - start <= 0.8
    assert [error.code for error in emergencies] == [0x8130]
    assert master.left.sdo[0x603F].raw == 0x8130


def test_faults_by_the_control_socket(master: Master) -> None:
    master.control.fault(1, "fault", code=0x2310)
    _until(lambda: master.left.sdo[0x603F].raw == 0x2310)
    assert master.right.sdo[0x6041].raw & 0x4F == SOD
    master.control.fault(1, "cut")
    with pytest.raises(canopen.SdoCommunicationError):
        _ = master.left.sdo[0x1000].raw
    master.control.fault(1, "heal")
    assert master.left.sdo[0x1000].raw == 0x20192
