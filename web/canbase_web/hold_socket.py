"""The websocket of hold-to-drive, and the loop that publishes what the pages hold. What counts is in hold.py."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import secrets
import time
from typing import Any, Final

from starlette.websockets import WebSocket, WebSocketDisconnect

from canbase_web.hold import NUMBER_S, Hold
from canbase_web.now_view import held_sentence, still_sentence
from canbase_web.robot_link import RobotLink

TICKET_S: Final = 10.0
MOST_ORDERS_PER_S: Final = 60
"""A page sends one for each number, and one at a press: more is none of ours."""
LONGEST_ORDER: Final = 200


class HoldSocket:
    """Tickets, open pages, and the loop."""

    def __init__(self, hold: Hold, link: RobotLink, source: str) -> None:
        self._hold, self._link, self._source = hold, link, source
        self._tickets: dict[str, float] = {}
        self._pages: dict[str, WebSocket] = {}

    def ticket(self) -> str:
        """For one page that a person has unlocked; it counts once, and for TICKET_S."""
        now_s = time.monotonic()
        self._tickets = {each: until_s for each, until_s in self._tickets.items() if until_s > now_s}
        made = secrets.token_urlsafe(16)
        self._tickets[made] = now_s + TICKET_S
        return made

    def revoke(self, ticket: str) -> None:
        """The page with this ticket is locked again: whatever its browser does, it orders nothing more."""
        self._tickets.pop(ticket, None)
        self._pages.pop(ticket, None)
        self._hold.forget(ticket)

    async def serve(self, socket: WebSocket) -> None:
        """One page, until it goes or sends what is none of ours."""
        page = socket.query_params.get("ticket", "")
        if self._tickets.pop(page, 0.0) < time.monotonic():
            await socket.close(code=1008)
            return
        self._pages[page] = socket  # before anything is awaited: the page may be locked again meanwhile
        began_s, orders = time.monotonic(), 0
        try:
            await socket.accept()
            while True:
                text = await socket.receive_text()
                orders += 1
                if (
                    page not in self._pages
                    or len(text) > LONGEST_ORDER
                    or orders > MOST_ORDERS_PER_S * (1.0 + time.monotonic() - began_s)
                ):
                    break
                self._take(page, json.loads(text))
        except (WebSocketDisconnect, ValueError, TypeError, KeyError, OverflowError, RuntimeError):
            pass  # it has gone, or what it sent is no order: both end what it held
        finally:
            self._hold.forget(page)
            self._pages.pop(page, None)
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await socket.close()

    def _take(self, page: str, said: Any) -> None:
        if not isinstance(said, dict):
            raise ValueError("an order is an object")
        if said.get("release"):
            self._hold.release(page)
        else:
            press, number = int(said["press"]), int(said["number"])
            self._hold.on_order(page, press, number, float(said["forward"]), float(said["turn"]), time.monotonic())

    async def run(self) -> None:
        """Every NUMBER_S: publish what is held, and give the pages a new number. However it ends, nothing is held."""
        try:
            while True:
                now_s = time.monotonic()
                self._publish(now_s)
                if self._pages:
                    await self._tell(now_s)
                await asyncio.sleep(NUMBER_S)
        finally:
            self._publish(math.inf)

    def _publish(self, now_s: float) -> None:
        """Nothing where nothing is held: a zero of this source would take the base from a lower one."""
        speed = self._hold.speed(now_s)
        if speed is not None:
            self._link.order(speed)

    async def _tell(self, now_s: float) -> None:
        number, holder = self._hold.number(now_s), self._hold.holder(now_s)
        state = still_sentence(self._link.newest("driver", now_s))
        if not state:
            state = held_sentence(self._link.newest("mux", now_s), self._source) if holder else "hold a key to drive"
        texts = {page: json.dumps({"number": number, "state": _state(page, holder, state)}) for page in self._pages}
        sends = (asyncio.wait_for(self._pages[page].send_text(text), NUMBER_S) for page, text in texts.items())
        # A browser that hangs holds up no other; one that has gone is noticed by whoever reads from it.
        await asyncio.gather(*sends, return_exceptions=True)


def _state(page: str, holder: str, state: str) -> str:
    if holder == page:
        return state
    return "another page drives" if holder else f"unlocked: {state}"
