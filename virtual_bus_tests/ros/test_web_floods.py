"""STOP of `canbase web` while strangers flood its port: the button keeps its time, whatever they send.

Each flood comes from a process of its own, as fast as it can, and lasts a few seconds.
"""

from __future__ import annotations

import http.client
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import Final

import pytest
from canbase.msg import DriverStatus

from support.browser import TOKEN, free_tcp_port
from support.ros_harness import merged
from support.running_robot import PATIENT, RunningRobot, own_domain, robot_on
from support.web_flood import FLOODS

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]
STOP_S: Final = 0.3
PRESSES: Final = 5


class Page:
    """canbase web of one robot, and a person whose only button is STOP."""

    def __init__(self, robot: RunningRobot, folder: Path) -> None:
        self.robot = robot
        token = folder / "token"
        token.write_text(f"{TOKEN}\n", encoding="utf-8")
        token.chmod(0o600)
        self.port = free_tcp_port()
        words = ("web", "--config", str(robot.config), "--port", str(self.port), "--token-file", str(token))
        self.process = robot.command(*words)
        robot.node.wait_for(lambda: "/?token=" in self.process.log(), 40.0, "the page")
        self.cookie = self._log_in()
        robot.node.wait_for(lambda: "Stop: stopping" in self.stop()[1], 20.0, "the page to reach the driver")

    def _log_in(self) -> str:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10.0)
        connection.request("GET", f"/?token={TOKEN}")
        answer = connection.getresponse()
        assert answer.status == 303
        return str(answer.headers["set-cookie"]).partition(";")[0]

    def stop(self) -> tuple[float, str]:
        """From the press, over a connection of its own, to the answer [s], and the answer."""
        began_s = time.monotonic()
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20.0)
        connection.request("POST", "/stop", headers={"Cookie": self.cookie})
        text = connection.getresponse().read().decode()
        connection.close()
        return time.monotonic() - began_s, text


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with ExitStack() as held:
        domain = held.enter_context(own_domain())
        robot = held.enter_context(robot_on(domain, changes=merged({}, PATIENT)))
        yield Page(robot, tmp_path_factory.mktemp("web"))


@contextmanager
def flooded(flood: str, port: int) -> Iterator[None]:
    """A stranger floods that port, before and after everything that is done here."""
    words = [sys.executable, "-m", "support.web_flood", flood, str(port)]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == b"began\n"
            yield
            assert process.poll() is None, "the flood lasts longer than the presses"
        finally:
            process.terminate()


@contextmanager
def bare_port() -> Iterator[int]:
    """A port of nothing: a thread that closes every connection. A flood of it costs this computer the same."""

    def close_all() -> None:
        with suppress(OSError):
            while True:
                port.accept()[0].close()

    with socket.create_server(("127.0.0.1", 0), backlog=4096) as port:
        thread = threading.Thread(target=close_all)
        thread.start()
        yield port.getsockname()[1]
        port.shutdown(socket.SHUT_RDWR)
        thread.join()


@pytest.mark.parametrize("flood", FLOODS)
def test_stop_keeps_its_time_under_every_flood(page: Page, flood: str) -> None:
    """A flood of the page's port costs STOP at most STOP_S more than the same flood of a bare port on the same, perhaps
    loaded, computer: with both, the answer comes from the driver, over DDS."""
    page.robot.make_ready()
    with bare_port() as port, flooded(flood, port):
        floor_s = [page.stop()[0] for _ in range(PRESSES)]
    page.robot.make_ready()
    before = page.robot.wait_any_state()
    with flooded(flood, page.port):
        presses = [page.stop() for _ in range(PRESSES)]
    assert all("Stop: stopping" in text for _, text in presses), presses
    times_s = [after_s for after_s, _ in presses]
    usual_s, without_s = median(times_s), median(floor_s)
    print(f"{flood}: STOP after {usual_s:.3f} s (bare port: {without_s:.3f} s), at most {max(times_s):.3f} s")
    assert usual_s <= without_s + STOP_S, (times_s, floor_s)
    assert page.robot.wait_state(DriverStatus.LATCHED).watchdog_trips == before.watchdog_trips
