"""`canbase setup commission --json` before another program: questions and answers in lines of JSON."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from canbase_commissioning.guide import CommissionError
from canbase_commissioning.onbus.bus_session import BusSession
from canbase_commissioning.onbus.remote_operator import SILENCE_S, Alive, Answer, RemoteOperator, Stop, parse
from canbase_config.load import load_robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtCommand, nmt
from canbase_sim.control import SimControl
from support.bus_tool import STANDS_S, drives, wheel_stands, write_robot
from support.json_page import Page
from support.udp_port import free_udp_port

pytestmark = [pytest.mark.bus, pytest.mark.timeout(120)]

TURNS_MPS = 0.02


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, SimControl]]:
    config = write_robot(tmp_path_factory.mktemp("page"), free_udp_port())
    with drives(config) as control:
        yield config, control


@pytest.fixture
def page(bench: tuple[Path, SimControl]) -> Iterator[Page]:
    page = Page("setup", "commission", "--config", str(bench[0]), "--steps", "directions", "--json", "--dry-run")
    yield page
    page.process.kill()
    page.process.wait(10.0)


def turning(page: Page, control: SimControl) -> None:
    page.live_until(lambda: any(line.get("ask") == "wheels_up" for line in page.told))
    page.say(answer="yes", key="wheels_up")
    page.live_until(lambda: control.truth().v_left_mps > TURNS_MPS)


def test_it_asks_and_is_answered_and_a_wrong_answer_is_asked_again(bench: tuple[Path, SimControl], page: Page) -> None:
    turning(page, bench[1])
    page.live_until(lambda: any(line.get("ask") == "direction.left_wheel" for line in page.told))
    page.say(answer="sideways", key="direction.left_wheel")
    page.live_until(lambda: any("again" in line for line in page.told))
    (again,) = (line for line in page.told if "again" in line)
    assert again == {"again": "direction.left_wheel", "reason": "expected one of forward, backward, nothing, other"}
    page.say(answer="forward", key="direction.left_wheel")
    page.live_until(lambda: any(line.get("ask") == "direction.right_wheel" for line in page.told))
    page.say(answer="forward", key="direction.right_wheel")
    page.ends()
    assert page.process.returncode == 0
    assert any(line["tell"].startswith("report: ") for line in page.told if "tell" in line)


def test_stop_stops_the_wheel(bench: tuple[Path, SimControl], page: Page) -> None:
    turning(page, bench[1])
    page.say(stop=True)
    wheel_stands(bench[1], STANDS_S)


def test_an_answer_to_another_question_is_none(bench: tuple[Path, SimControl], page: Page) -> None:
    page.live_until(lambda: any(line.get("ask") == "wheels_up" for line in page.told))
    page.say(answer="yes", key="wheels_up.again")
    began_m = bench[1].truth().path_m
    until_s = time.monotonic() + 1.0
    page.live_until(lambda: time.monotonic() > until_s)
    assert bench[1].truth().path_m == began_m
    page.say(stop=True)
    assert "stopped" in page.ends()
    assert page.process.returncode == 1


@pytest.mark.parametrize("way", ["is killed", "says nothing"])
def test_a_page_that_goes_or_hangs_stops_the_wheel(bench: tuple[Path, SimControl], page: Page, way: str) -> None:
    turning(page, bench[1])
    assert page.process.stdin is not None
    assert page.process.stdout is not None
    if way == "is killed":
        page.process.stdout.close()
        page.process.stdin.close()
    wheel_stands(bench[1], SILENCE_S + STANDS_S)
    assert page.process.wait(20.0) != 0


def test_a_signal_stops_the_wheel(bench: tuple[Path, SimControl], page: Page) -> None:
    turning(page, bench[1])
    page.process.send_signal(signal.SIGTERM)
    wheel_stands(bench[1], STANDS_S)
    assert page.process.wait(20.0) == 1


def test_a_signal_during_the_farewell_does_not_leave_the_drives_with_power(
    bench: tuple[Path, SimControl], page: Page
) -> None:
    """Somebody presses Stop, and ends `canbase web` before the wheels have stopped."""
    turning(page, bench[1])
    with BusSession(load_robot(bench[0]).robot.bus) as line:
        page.say(stop=True)
        heard = Heard(until_s=time.monotonic() + 0.03)
        line.run(heard)
        page.process.send_signal(signal.SIGTERM)
        heard.until_s = time.monotonic() + 3.0
        line.run(heard)
    assert page.process.wait(20.0) == 1
    assert nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 2) in heard.frames, "the farewell came to its end"


@dataclass
class Heard:
    """A session that listens until a time."""

    until_s: float
    frames: list[Frame] = field(default_factory=list)

    @property
    def done(self) -> bool:
        return time.monotonic() >= self.until_s

    def on_frame(self, frame: Frame, now_s: float) -> None:
        if frame.cob_id < 0x100:  # NMT and SYNC: what a master sends
            self.frames.append(frame)

    def tick(self, now_s: float) -> list[Frame]:
        return []


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b'{"stop": true}', Stop()),
        (b'{"alive": true}', Alive()),
        (b'{"answer": "yes", "key": "wheels_up"}', Answer("wheels_up", "yes")),
    ],
)
def test_there_are_three_lines(line: bytes, said: object) -> None:
    assert parse(line) == said


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"yes",
        b"[]",
        b'{"stop": 1.5}',
        b'{"stop": false}',
        b'{"answer": "yes"}',
        b'{"answer": 1, "key": "a"}',
        b"\xff",
    ],
)
def test_any_other_line_is_refused(line: bytes) -> None:
    with pytest.raises(ValueError, match=r".+"):
        parse(line)


def test_a_line_that_is_none_of_them_stops_the_wheels_at_once() -> None:
    page = RemoteOperator.__new__(RemoteOperator)
    page._rest = b""
    with pytest.raises(CommissionError, match="a line was not understood"):
        page._take_in(b"stop!!\n")
