"""STOP of `canbase web` while strangers flood its port: the button keeps its time, whatever they send.

Each flood comes from a process of its own, as fast as it can, and lasts a few seconds.
"""

from __future__ import annotations

import http.client
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
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


@pytest.mark.parametrize("flood", FLOODS)
def test_stop_keeps_its_time_under_every_flood(page: Page, flood: str) -> None:
    page.robot.make_ready()
    with subprocess.Popen(
        [sys.executable, "-m", "support.web_flood", flood, str(page.port)], stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"began\n"
        presses = [page.stop() for _ in range(PRESSES)]
        assert process.poll() is None, "the flood lasts longer than the presses"
        process.terminate()
    assert all("Stop: stopping" in text for _, text in presses), presses
    times_s = [after_s for after_s, _ in presses]
    print(f"{flood}: STOP after {median(times_s):.3f} s, at most {max(times_s):.3f} s")
    assert max(times_s) <= STOP_S, times_s
    page.robot.wait_state(DriverStatus.LATCHED)
