"""The websocket of hold-to-drive: tickets, locking, and what ends it. Socket and robot only note what happens."""

from __future__ import annotations

import asyncio
import json
from types import SimpleNamespace
from typing import Any

import pytest
from canbase.msg import DriverStatus
from starlette.websockets import WebSocketDisconnect

from canbase_runtime.last_message import LastMessage
from canbase_runtime.source_standing import SourceStanding
from canbase_web import hold_socket
from canbase_web.hold import Hold, Speed
from canbase_web.hold_socket import LONGEST_ORDER, MOST_ORDERS_PER_S, TICKET_S, HoldSocket


class Socket:
    """A page whose script a test writes."""

    def __init__(self, ticket: str) -> None:
        self.query_params = {"ticket": ticket}
        self.to_server: asyncio.Queue[str | None] = asyncio.Queue()
        self.sent: list[dict[str, Any]] = []
        self.accepted = self.closed = False
        self.accept_time = asyncio.Event()
        self.accept_time.set()

    async def accept(self) -> None:
        await self.accept_time.wait()
        self.accepted = True

    async def receive_text(self) -> str:
        text = await self.to_server.get()
        if text is None:
            raise WebSocketDisconnect(1006)
        return text

    async def send_text(self, text: str) -> None:
        if not self.accepted:
            raise RuntimeError("as Starlette: accept first")
        self.sent.append(json.loads(text))

    async def close(self, code: int = 1000) -> None:
        self.closed = True

    def hold(self, press: int = 1) -> None:
        """An order with the newest number."""
        order = {"press": press, "number": self.sent[-1]["number"], "forward": 0.5, "turn": 0.0}
        self.to_server.put_nowait(json.dumps(order))


class Robot:
    """What was ordered; its mux follows every order, unless a test says otherwise."""

    def __init__(self) -> None:
        self.orders: list[Speed] = []
        self.driver = DriverStatus(state=DriverStatus.ENABLED)
        self.source = SimpleNamespace(name="web", active=True, standing=SourceStanding.FOLLOWED, reason="")

    def newest(self, name: str, now_s: float) -> LastMessage:
        return LastMessage({"mux": SimpleNamespace(sources=[self.source]), "driver": self.driver}[name], 0.0)

    def order(self, speed: Speed) -> None:
        self.orders.append(speed)


class Story:
    """A hold socket whose clock the test advances, with one page."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 100.0
        monkeypatch.setattr(hold_socket, "time", SimpleNamespace(monotonic=lambda: self.now_s))
        self.hold, self.robot = Hold(0.8, 2.0), Robot()
        self.socket = HoldSocket(self.hold, self.robot, "web")  # type: ignore[arg-type]

    async def page(self, ticket: str) -> tuple[Socket, asyncio.Task[None]]:
        socket = Socket(ticket)
        task = asyncio.create_task(self.socket.serve(socket))  # type: ignore[arg-type]
        await asyncio.sleep(0)
        await self.turn()
        return socket, task

    async def turn(self) -> None:
        """One turn of the loop 0.05 s later, and whatever the pages have sent."""
        self.now_s += 0.05
        speed = self.hold.speed(self.now_s)
        if speed is not None:
            self.robot.order(speed)
        await self.socket._tell(self.now_s)
        for _ in range(5):
            await asyncio.sleep(0)


def test_a_ticket_counts_once_and_for_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    async def tell() -> list[bool]:
        story = Story(monkeypatch)
        fresh, old = story.socket.ticket(), story.socket.ticket()
        found = [(await story.page(fresh))[0].accepted, (await story.page(fresh))[0].accepted]
        story.now_s += TICKET_S
        return found + [(await story.page(each))[0].accepted for each in (old, "", "made-up")]

    assert asyncio.run(tell()) == [True, False, False, False, False]


def test_who_holds_drives_and_a_page_that_is_locked_again_does_not_whatever_its_browser_sends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def tell() -> tuple[list[Speed], list[Speed], bool]:
        story = Story(monkeypatch)
        ticket = story.socket.ticket()
        socket, task = await story.page(ticket)
        for _ in range(5):
            socket.hold()
            await story.turn()
        drove = list(story.robot.orders)
        story.socket.revoke(ticket)
        story.robot.orders.clear()
        for press in range(2, 6):
            socket.hold(press)
            await story.turn()
        return drove, story.robot.orders, task.done()

    drove, then, ended = asyncio.run(tell())
    assert Speed(0.4, 0.0) in drove
    assert (set(then), ended) == ({Speed(0.0, 0.0)}, True)


def test_a_ticket_that_was_taken_back_opens_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    async def tell() -> bool:
        story = Story(monkeypatch)
        ticket = story.socket.ticket()
        story.socket.revoke(ticket)
        return (await story.page(ticket))[0].accepted

    assert not asyncio.run(tell())


def test_a_page_that_is_locked_while_its_socket_opens_orders_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    async def tell() -> tuple[list[Speed], bool]:
        story = Story(monkeypatch)
        ticket = story.socket.ticket()
        socket = Socket(ticket)
        socket.accept_time.clear()
        task = asyncio.create_task(story.socket.serve(socket))  # type: ignore[arg-type]
        await story.turn()
        story.socket.revoke(ticket)
        socket.accept_time.set()
        for _ in range(5):
            await story.turn()
            number = story.hold.number(story.now_s)  # what another page hears, and tells it
            socket.to_server.put_nowait(json.dumps({"press": 1, "number": number, "forward": 0.5, "turn": 0.0}))
        return story.robot.orders, task.done()

    assert asyncio.run(tell()) == ([], True)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no json",
        "[]",
        "1",
        '{"press": Infinity, "number": 1, "forward": 0, "turn": 0}',
        '{"press": NaN, "number": 1, "forward": 0, "turn": 0}',
        '{"press": 1, "number": 1, "forward": 1' + "0" * 160 + '0, "turn": 1e400}',
        "{}",
        '{"press": 1}',
        '{"press": "x", "number": 1, "forward": 0, "turn": 0}',
        '{"release": true}' + " " * LONGEST_ORDER,
        None,
    ],
)
def test_what_is_no_order_ends_the_page_and_what_it_held(monkeypatch: pytest.MonkeyPatch, text: str | None) -> None:
    async def tell() -> tuple[bool, bool, Speed]:
        story = Story(monkeypatch)
        socket, task = await story.page(story.socket.ticket())
        for _ in range(3):
            socket.hold()
            await story.turn()
        socket.to_server.put_nowait(text)
        await story.turn()
        await story.turn()
        await task  # without an exception
        return task.done(), socket.closed, story.robot.orders[-1]

    assert asyncio.run(tell()) == (True, True, Speed(0.0, 0.0))


def test_more_orders_than_a_page_sends_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    async def tell() -> bool:
        story = Story(monkeypatch)
        socket, task = await story.page(story.socket.ticket())
        for _ in range(2 * MOST_ORDERS_PER_S):
            socket.hold()
        for _ in range(100):
            await story.turn()
        return task.done()

    assert asyncio.run(tell())


def test_the_end_of_the_server_orders_zero_where_it_held_and_says_nothing_where_it_did_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A zero of this source has the base for its timeout: it would take it from a goal that drives."""

    async def tell(holds: bool) -> list[Speed]:
        story = Story(monkeypatch)
        loop = asyncio.create_task(story.socket.run())
        socket, page = await story.page(story.socket.ticket())
        for _ in range(3 if holds else 0):
            socket.hold()
            await story.turn()
        story.robot.orders.clear()
        loop.cancel()
        page.cancel()
        await asyncio.gather(loop, page, return_exceptions=True)
        return story.robot.orders

    assert [asyncio.run(tell(holds)) for holds in (True, False)] == [[Speed(0.0, 0.0)], []]


def test_a_page_whose_orders_the_mux_does_not_follow_is_told_why_and_not_that_it_drives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def tell() -> list[str]:
        story = Story(monkeypatch)
        socket, _ = await story.page(story.socket.ticket())
        said = []
        for standing, reason in (
            (SourceStanding.UNARMED, "waiting for zero (restarted)"),
            (SourceStanding.FOLLOWED, ""),
        ):
            story.robot.source.standing, story.robot.source.reason = standing, reason
            socket.hold()
            await story.turn()
            await story.turn()
            said.append(socket.sent[-1]["state"])
        return said

    assert asyncio.run(tell()) == ["not followed: waiting for zero (restarted)", "drives"]


def test_an_unlocked_page_of_a_latched_robot_offers_no_key_and_one_that_holds_does_not_say_that_it_drives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def tell() -> list[str]:
        story = Story(monkeypatch)
        socket, _ = await story.page(story.socket.ticket())
        said = [socket.sent[-1]["state"]]
        story.robot.driver = DriverStatus(state=DriverStatus.LATCHED, cause="stop requested", clears_on="reset")
        await story.turn()
        said.append(socket.sent[-1]["state"])
        socket.hold()
        await story.turn()
        await story.turn()
        return [*said, socket.sent[-1]["state"]]

    why = "the robot does not move: latched: stop requested; ends with: reset"
    assert asyncio.run(tell()) == ["unlocked: hold a key to drive", f"unlocked: {why}", why]
