"""The page `Commission` in a real browser, before simulated drives: the wheels stop when whoever looks at it goes."""

from __future__ import annotations

import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from canbase_sim.control import SimControl
from support.browser import NEEDS_CHROMIUM, TOKEN, browser, free_tcp_port
from support.bus_tool import ENVIRONMENT, STANDS_S, argv, drives, wheel_stands, write_robot
from support.udp_port import free_udp_port

pytestmark = [pytest.mark.bus, pytest.mark.timeout(180), NEEDS_CHROMIUM]
TURNS_MPS = 0.02
SILENT_S = 1.8
"""The page is gone: a second of silence, and 0.8 s for which its last proof counts."""


@pytest.fixture(scope="module")
def page_of_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, SimControl, Any]]:
    """The address, the drives, and a browser."""
    folder = tmp_path_factory.mktemp("commission")
    config = write_robot(folder, free_udp_port())
    (folder / "token").write_text(TOKEN, encoding="utf-8")
    (folder / "token").chmod(0o600)
    port = free_tcp_port()
    words = ("web", "--config", str(config), "--port", str(port), "--token-file", str(folder / "token"))
    environment = ENVIRONMENT | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "99"}
    with ExitStack() as held:
        control = held.enter_context(drives(config))
        process = subprocess.Popen(argv(*words), env=environment, stdout=subprocess.DEVNULL)
        held.callback(process.wait, 20.0)
        held.callback(process.send_signal, signal.SIGINT)
        launched = held.enter_context(browser())
        wait_for(lambda: not socket.socket().connect_ex(("127.0.0.1", port)), 30.0)
        yield f"http://127.0.0.1:{port}", control, launched


def wait_for(holds: Callable[[], bool], timeout_s: float) -> None:
    end_s = time.monotonic() + timeout_s
    while not holds():
        assert time.monotonic() < end_s
        time.sleep(0.02)


@pytest.fixture
def turning(page_of_bench: tuple[str, SimControl, Any]) -> Iterator[Any]:
    """A page on which a person has begun, and the left wheel turns."""
    url, control, launched = page_of_bench
    page = launched.new_context().new_page()
    page.goto(f"{url}/?token={TOKEN}")
    page.goto(f"{url}/commission")
    page.get_by_role("switch").click()
    page.get_by_role("button", name="Begin").click()
    page.get_by_role("button", name="yes").click()
    wait_for(lambda: control.truth().v_left_mps > TURNS_MPS, 20.0)
    yield page
    page.context.close()
    wheel_stands(control, 10.0)
    time.sleep(1.0)  # the process behind the page ends


WAYS = ("the large STOP", "Stop on the page", "nobody looks at it", "the page goes and another browser looks on")


@pytest.mark.parametrize("way", WAYS)
def test_the_wheel_stops(page_of_bench: tuple[str, SimControl, Any], turning: Any, way: str) -> None:
    control = page_of_bench[1]
    if way == "the large STOP":
        turning.get_by_role("button", name="Stop the robot").click()
        turning.wait_for_function(
            "document.getElementById('stop-answer').textContent.startsWith('Stop: commissioning')"
        )
    elif way == "Stop on the page":
        turning.get_by_role("button", name="Stop", exact=True).click()
    elif way == "the page goes and another browser looks on":
        other = page_of_bench[2].new_context().new_page()
        other.goto(f"{page_of_bench[0]}/?token={TOKEN}")
        other.goto(f"{page_of_bench[0]}/commission")
        other.wait_for_function("document.body.innerText.includes('in another browser')")
        turning.close()
    else:
        turning.evaluate("Object.defineProperty(document, 'hidden', {value: true})")
    wheel_stands(control, SILENT_S + STANDS_S)


def test_a_person_answers_and_the_wheel_that_is_asked_about_is_named(turning: Any) -> None:
    turning.get_by_role("button", name="forward").wait_for(timeout=15_000)
    drawing = turning.get_by_role("img", name="The base from above")
    assert "direction.left_wheel" in drawing.get_attribute("aria-label")
    turning.get_by_label("Answer", exact=True).fill("sideways")
    turning.keyboard.press("Enter")
    turning.wait_for_function("document.body.innerText.includes('expected one of forward, backward, nothing, other')")
    turning.get_by_role("button", name="forward").click()
    turning.wait_for_function("document.body.innerText.includes('Mark the top of left_wheel')")
