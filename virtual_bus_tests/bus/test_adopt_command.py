"""`canbase bus adopt` as a command: drives fresh from the box, both node 1 at 125 kbit/s, on a bus with bit rates."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import threading
import time
from contextlib import closing
from pathlib import Path

import can
import pytest

from canbase_commissioning.onbus import adopt_command
from canbase_config.bit_rate import bus_at
from canbase_config.load import load_robot
from canbase_config.robot import Bus
from canbase_sim.cia402.states import POWERED
from canbase_sim.control import SimControl
from canbase_sim.control_server import ControlServer
from canbase_sim.loop import Loop
from canbase_sim.rated_bus import RatedBus
from canbase_sim.world.bench import Bench, BenchParameters
from canbase_sim.world.trace import Trace
from support.bus_tool import ENVIRONMENT, argv, canbase, drives, write_robot
from support.sim_rig import robot as small_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus

FRESH = "--factory-fresh"
PATIENCE_S = 150.0
"""For a loaded computer."""


def nodes(config: Path) -> list[tuple[int, int | None]]:
    """Node id and serial number of each node that `canbase bus scan` finds."""
    done = canbase("bus", "scan", "--config", str(config), "--seconds", "0.2", "--json")
    assert done.returncode == 0, done.stderr
    return [(row["node_id"], row["serial"]) for row in json.loads(done.stdout)]


def test_two_drives_fresh_from_the_box_are_ready_and_stay_so_over_a_power_cycle(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    with drives(config, FRESH) as control:
        assert canbase("bus", "scan", "--config", str(config), "--seconds", "0.2").returncode == 1
        done = canbase("bus", "adopt", "--config", str(config), "--yes", timeout_s=PATIENCE_S)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "drives answer at 125000 bit/s" in done.stdout
        assert "node 1: two drives or more have this node id" in done.stdout
        assert re.findall(r"ready: node (\d), 500000 bit/s, serial (\d)h", done.stdout) == [("1", "1"), ("2", "2")]
        assert nodes(config) == [(1, 1), (2, 2)]
        power_cycle(control)
        assert nodes(config) == [(1, 1), (2, 2)]
        assert states(config).isdisjoint({state.name for state in POWERED})


def power_cycle(control: SimControl) -> None:
    """Both drives off and on; they boot again in half a second."""
    for node in (1, 2):
        control.fault(node, "power_cycle")
    time.sleep(1.5)


def states(config: Path) -> set[str]:
    """The CiA 402 states of both drives, as `canbase bus sdo` has them."""
    texts = [canbase("bus", "sdo", "read", str(node), "6041", "--config", str(config)).stdout for node in (1, 2)]
    return {text.rpartition(": ")[2].strip().upper().replace(" ", "_") for text in texts}


def test_on_virtual_channels_in_one_process_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    channel = Bus(interface="virtual", channel=f"adopt-{tmp_path.name}", bitrate=250_000, extra={})
    robot = small_robot().model_copy(update={"bus": channel})
    stop = threading.Event()
    bench = Bench(robot, time.monotonic(), parameters=BenchParameters(factory_fresh=True))
    trace = Trace(bench, time.monotonic())
    with closing(RatedBus(channel)) as bus, closing(ControlServer(tmp_path / "sim.sock", bench, trace)) as server:
        thread = threading.Thread(target=Loop(bus, channel.bitrate, bench, trace, server).run, args=(stop.is_set,))
        thread.start()
        try:
            adopt_command.run(channel, robot, None, None, yes=True, sets_link=False)
        finally:
            stop.set()
            thread.join(5.0)
    assert [(node.node_id, node.lss.bitrate) for node in bench.nodes.values()] == [(1, 250_000), (2, 250_000)]
    assert "ready: node 2, 250000 bit/s" in capsys.readouterr().out


def test_answers_choose_the_node_ids(tmp_path: Path) -> None:
    config, answers = write_robot(tmp_path, free_udp_port()), tmp_path / "answers.yaml"
    answers.write_text("start: yes\nserial_1: 2\nserial_2: 1\n", encoding="utf-8")
    with drives(config, FRESH):
        words = ("--config", str(config), "--answers", str(answers), "--present-bitrate", "125000")
        done = canbase("bus", "adopt", *words, timeout_s=PATIENCE_S)
        assert done.returncode == 0, done.stdout + done.stderr
        assert nodes(config) == [(1, 2), (2, 1)]


def test_ctrl_c_leaves_the_drives_waiting_and_a_power_cycle_brings_back_what_was(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    factory = bus_at(load_robot(config).robot.bus, 125_000).arguments()
    words = argv("bus", "adopt", "--config", str(config), "--yes", "--present-bitrate", "125000")
    with drives(config, FRESH) as control:
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT)
        assert process.stderr is not None
        spy = can.BufferedReader()
        with can.Bus(**factory) as bus, can.Notifier(bus, [spy]):
            for line in process.stderr:
                if "fastscan, drive 2" in line:
                    break
            process.send_signal(signal.SIGINT)
            _, told = process.communicate(timeout=PATIENCE_S)
            requests = _requests(spy)
        assert process.returncode == 130
        assert "stopped by SIGINT. The drives are in LSS waiting. Nothing was stored" in told
        assert requests[-1] == bytes((4, 0, 0, 0, 0, 0, 0, 0))
        power_cycle(control)
        at_the_rate_of_the_drives = write_robot(tmp_path, factory["port"], "factory.yaml")
        again = canbase("bus", "scan", "--config", str(at_the_rate_of_the_drives), "--seconds", "0.2")
        assert "node 1: two drives or more answer" in again.stderr


def _requests(spy: can.BufferedReader) -> list[bytes]:
    """The LSS requests that have come so far."""
    found = []
    while (message := spy.get_message(0.5)) is not None:
        if message.arbitration_id == 0x7E5:
            found.append(bytes(message.data))
    return found


def test_another_master_ends_it_before_any_lss(tmp_path: Path) -> None:
    port = free_udp_port()
    config = write_robot(tmp_path, port)
    stopped = threading.Event()
    spy = can.BufferedReader()
    with drives(config), can.Bus("239.74.163.2", "udp_multicast", port=port, hop_limit=0) as other:
        notifier = can.Notifier(other, [spy])
        thread = threading.Thread(target=_sync, args=(other, stopped))
        thread.start()
        done = canbase("bus", "adopt", "--config", str(config), "--yes", timeout_s=PATIENCE_S)
        stopped.set()
        thread.join()
        notifier.stop()
    assert done.returncode == 1
    assert _requests(spy) == []
    assert "another master is on this bus (SYNC" in done.stderr


def _sync(bus: can.BusABC, stopped: threading.Event) -> None:
    while not stopped.wait(0.02):
        bus.send(can.Message(arbitration_id=0x080, is_extended_id=False))


def test_a_motor_with_power_ends_it(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    with drives(config):
        for index, value in (("6060", "3"), ("6040", "6"), ("6040", "7"), ("6040", "15")):
            done = canbase("bus", "sdo", "write", "1", index, value, "--config", str(config), "--force")
            assert done.returncode == 0, done.stderr
        done = canbase(
            "bus", "adopt", "--config", str(config), "--yes", "--present-bitrate", "500000", timeout_s=PATIENCE_S
        )
    assert done.returncode == 1
    assert "node 1 is in operation enabled: its motor may have power" in done.stderr
    assert "Nothing was changed" in done.stderr


def test_an_empty_cable_is_1(tmp_path: Path) -> None:
    config = write_robot(tmp_path, free_udp_port())
    done = canbase("bus", "adopt", "--config", str(config), "--yes", timeout_s=PATIENCE_S)
    assert done.returncode == 1
    assert "no drive answers at any bit rate; check power, cable, termination" in done.stderr


def test_a_bit_rate_that_canopen_does_not_have_is_2() -> None:
    done = canbase("bus", "adopt", "--channel", "can0", "--bitrate", "123456")
    assert done.returncode == 2
    assert "expected one of 1000000" in done.stderr
