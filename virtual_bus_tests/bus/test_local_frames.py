"""Frames of another computer on a simulated bus: two network namespaces with a cable between them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from canbase_base.local_frames import keep_to_this_computer
from support.receivers import INSIDE

pytestmark = pytest.mark.bus
TESTS = Path(__file__).parents[1]
HERE, THERE = f"canbase-here-{os.getpid()}", f"canbase-there-{os.getpid()}"
OUTSIDE = 0x182
FORGED = (
    "import can, time\n"
    "with can.Bus(interface='udp_multicast', channel='239.74.163.2', port={port}, hop_limit=1) as bus:\n"
    "    for _ in range(5):\n"
    f"        bus.send(can.Message(arbitration_id={OUTSIDE}, is_extended_id=False))\n"
    "        time.sleep(0.02)\n"
)
PORT = 43113
"""Any: the namespaces are their own."""
needs_namespaces = pytest.mark.needs_root("make network namespaces")


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, timeout=10.0, capture_output=True)


@pytest.fixture
def two_computers() -> Iterator[None]:
    """HERE is 10.9.0.1, THERE 10.9.0.2."""
    if shutil.which("ip") is None:
        pytest.skip("NOT CHECKED: no ip here, for network namespaces (apt-get install iproute2)")
    names = (HERE, THERE)
    try:
        for name in names:
            ip("netns", "add", name)
        ip("link", "add", "cable", "netns", HERE, "type", "veth", "peer", "name", "cable", "netns", THERE)
        for number, name in enumerate(names, start=1):
            ip("-n", name, "addr", "add", f"10.9.0.{number}/24", "dev", "cable")
            for link in ("lo", "cable"):
                ip("-n", name, "link", "set", link, "up")
            ip("-n", name, "route", "add", "default", "via", f"10.9.0.{3 - number}")
        yield
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "del", name], check=False, timeout=10.0, capture_output=True)


def python(namespace: str, *arguments: str) -> subprocess.Popen[str]:
    argv = ["ip", "netns", "exec", namespace, sys.executable, *arguments]
    return subprocess.Popen(argv, cwd=TESTS, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def heard(hop_limit: int) -> dict[str, list[int]]:
    """By whom what was heard, while another computer forged frames."""
    with python(HERE, "-m", "support.receivers", str(PORT), str(hop_limit)) as listener:
        assert listener.stdout is not None
        assert listener.stdout.readline() == "{}\n"
        with python(THERE, "-c", FORGED.format(port=PORT)) as stranger:
            assert stranger.wait(timeout=30.0) == 0
        return dict(json.loads(listener.communicate("all sent\n", timeout=30.0)[0]))


@needs_namespaces
def test_driver_watchdog_and_simulator_hear_this_computer_alone(two_computers: None) -> None:
    told = heard(hop_limit=0)

    assert OUTSIDE in told.pop("neighbour"), "without the filter it comes in: the forged frames did arrive"
    assert told == {name: [INSIDE.arbitration_id] for name in ("driver", "watchdog", "simulator")}


@needs_namespaces
def test_a_bus_that_is_to_span_computers_hears_them(two_computers: None) -> None:
    told = heard(hop_limit=1)

    assert all(OUTSIDE in frames and INSIDE.arbitration_id in frames for frames in list(told.values())[:3]), told


class NoSocket:
    """As python-can's `virtual` bus."""

    def fileno(self) -> int:
        raise NotImplementedError


@pytest.mark.parametrize("arguments", [{"interface": "virtual"}, {"interface": "socketcan", "hop_limit": 0}])
def test_other_buses_get_no_filter(arguments: dict[str, object]) -> None:
    keep_to_this_computer(arguments, NoSocket())
