"""`canbase bus dump` as a process on a bus: frames in words, filters, Ctrl-C, a closed pipe; and it sends nothing."""

from __future__ import annotations

import select
import signal
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from support.bus_tool import ENVIRONMENT, argv, write_robot
from support.command_world import canbase
from support.udp_port import free_udp_port

pytestmark = [pytest.mark.bus, pytest.mark.timeout(60)]
STATUS = (0x181, struct.pack("<Hi", 0x0637, 7))
FRAMES = (
    (0x000, b"\x01\x00"),
    (0x080, b""),
    STATUS,
    (0x182, struct.pack("<Hi", 0x0208, 9)),
    (0x082, struct.pack("<HB5x", 0x3220, 4)),
)
TURN_S = 0.02


@contextmanager
def dumping(config: Path, *words: str) -> Iterator[subprocess.Popen[str]]:
    command = argv("bus", "dump", "--config", str(config), *words)
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT, bufsize=1
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait(10.0)


def lines_until(process: subprocess.Popen[str], bus: can.BusABC, ends_with: str, within_s: float = 30.0) -> list[str]:
    """Sends all FRAMES again and again until a line ends so; whole lines since the process receives."""
    assert process.stdout is not None
    end, lines = time.monotonic() + within_s, []
    while time.monotonic() < end:
        for cob_id, data in FRAMES:
            bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
        time.sleep(TURN_S)
        if has_more(process):
            lines.append(process.stdout.readline().rstrip())
            if lines[-1].endswith(ends_with):
                return lines
    raise AssertionError(f"no line with {ends_with!r} in {lines}")


def has_more(process: subprocess.Popen[str]) -> bool:
    assert process.stdout is not None
    return bool(select.select([process.stdout], [], [], 0.0)[0])


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[tuple[Path, can.BusABC]]:
    port = free_udp_port()
    with can.Bus("239.74.163.2", "udp_multicast", port=port, hop_limit=0) as bus:
        yield write_robot(tmp_path, port), bus


def test_frames_in_words_until_ctrl_c_and_it_sends_nothing(bench: tuple[Path, can.BusABC]) -> None:
    config, bus = bench
    sent = 0
    with dumping(config) as process:
        lines_until(process, bus, "node 2 (right_wheel): EMCY 3220h under-voltage of the DC link, register 04h")
        while bus.recv(0.2) is not None:
            pass
        for _ in range(20):
            for cob_id, data in FRAMES:
                bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
                sent += 1
        seen = 0
        while bus.recv(0.5) is not None:  # each sender hears itself, and whoever else sends
            seen += 1
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20.0)
        assert (process.returncode, err) == (0, "")
    assert "node 1 (left_wheel): TPDO1 statusword 0637h operation enabled, position 7" in out
    assert "NMT start, all nodes" in out
    assert seen <= sent


def test_only_what_is_asked_for_and_a_reader_that_has_enough_is_no_error(bench: tuple[Path, can.BusABC]) -> None:
    """As with `canbase bus dump | head`."""
    config, bus = bench
    with dumping(config, "--node", "2", "--kind", "pdo") as process:
        lines = lines_until(process, bus, "TPDO1 statusword 0208h fault, position 9")
        assert all("node 2 (right_wheel): TPDO1" in line for line in lines)
        assert process.stdout is not None
        process.stdout.close()
        end = time.monotonic() + 20.0
        while process.poll() is None and time.monotonic() < end:
            for cob_id, data in FRAMES:
                bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
            time.sleep(TURN_S)
        assert process.returncode == 0
        assert process.stderr is not None
        assert process.stderr.read() == ""


def test_a_bus_that_cannot_be_opened_is_1_with_its_reason() -> None:
    done = canbase("bus", "dump", "--interface", "socketcan", "--channel", "nocan7")
    assert done.exit_code == 1
    assert "socketcan nocan7 cannot be opened" in done.stderr
