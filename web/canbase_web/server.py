"""The process of `canbase web`: pages, gate, the robot's link, from its start to its end."""

from __future__ import annotations

import asyncio
import contextlib
import resource
import secrets
import signal
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Final

import typer
import uvicorn
from fastapi import FastAPI, WebSocket
from fastapi.responses import HTMLResponse
from fastapi.staticfiles import StaticFiles
from nicegui import ui

from canbase_config.load import Loaded
from canbase_config.mux import MuxSource
from canbase_runtime.terminal import FAILED, fail
from canbase_web import commission_page, drive_page, explained_stop, health_page, now_page, stops_page
from canbase_web.access import COOKIE, MOST_BODY_BYTES, Access, authority, hosts
from canbase_web.gate import Gate
from canbase_web.hold import Hold
from canbase_web.hold_socket import HoldSocket
from canbase_web.pages import Pages
from canbase_web.robot_link import RobotLink

MOST_SILENT: Final = 100
"""Of more connections without a request the oldest are closed: whoever floods the page keeps nobody from the stop."""
SILENT_S: Final = 5.0
"""A connection that has sent no request for so long is closed."""
LOOK_S: Final = 0.25
SOURCE_NAME: Final = "web"
"""Key of `mux.sources` whose topic the page publishes on."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where the page is."""

    host: str
    port: int
    token: str

    @property
    def url(self) -> str:
        """For the person; it has the token."""
        return f"http://{authority(self.host, self.port)}/?token={self.token}"


def run(loaded: Loaded, address: Address, ros_args: list[str], namespace: str) -> None:
    """Serves until SIGINT or SIGTERM. Exits with 1 when a part of it has failed."""
    _take_all_descriptors()
    robot = loaded.robot
    source = SOURCE_NAME if _is_ours(robot.mux.sources.get(SOURCE_NAME)) else ""
    link = RobotLink(robot, source, ros_args)
    hold = Hold(robot.limits.linear_mps, robot.limits.angular_radps)
    socket = HoldSocket(hold, link, source)
    pages = Pages(loaded, link, socket, source, namespace)

    @asynccontextmanager
    async def life(app: FastAPI) -> AsyncIterator[None]:
        loops = [asyncio.create_task(each) for each in (socket.run(), _drop_silent(server))]
        for loop in loops:
            loop.add_done_callback(lambda ended: _end_with(server, ended))
        typer.echo(f"open {address.url}   (Ctrl-C ends the page; the robot is not affected)")
        yield
        for loop in loops:
            loop.cancel()
        await asyncio.gather(*loops, return_exceptions=True)

    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None, lifespan=life)

    @app.post("/stop")
    async def stop() -> HTMLResponse:
        """The large stop: of the page's script, and of a browser whose script does not run."""
        done, sentence = await pages.stop()
        return HTMLResponse(pages.stop_answer(done, sentence), 200 if done else 503)

    @app.websocket("/hold")
    async def hold_to_drive(websocket: WebSocket) -> None:
        await socket.serve(websocket)

    _add_explained(app, link, loaded)
    app.mount("/static", StaticFiles(directory=Path(__file__).parent / "static"))
    for page in (now_page, drive_page, commission_page, stops_page, health_page):
        page.add(pages)
    ui.run_with(app, title=f"canbase {robot.name}", dark=None, show_welcome_message=False, reconnect_timeout=3.0,
                tailwind=False, favicon="🛞", binding_refresh_interval=None)  # fmt: skip
    cookie = COOKIE.format(port=address.port)
    access = Access(address.token, cookie, secrets.token_urlsafe(32), hosts(address.host, address.port))
    config = uvicorn.Config(
        Gate(app, access),
        host=address.host,
        port=address.port,
        log_level="warning",
        http="h11",  # bounds what a request may have before its body; httptools takes headers without end
        h11_max_incomplete_event_size=MOST_BODY_BYTES,
        ws_max_size=MOST_BODY_BYTES,
        timeout_graceful_shutdown=1,
        server_header=False,
    )
    server = _Server(config)
    try:
        server.run()
    finally:
        link.close()
    if server.failure:
        fail(f"canbase web ends: {server.failure}", FAILED)


def _add_explained(app: FastAPI, link: RobotLink, loaded: Loaded) -> None:
    """The page of each recording of the page `Stops`."""

    @app.get(explained_stop.ADDRESS)
    async def explained(name: str) -> HTMLResponse:
        path = explained_stop.named((event.black_box for event in link.stops), name)
        if path is None:
            return HTMLResponse(explained_stop.missing(name), 404)
        status, text = await asyncio.to_thread(explained_stop.explained, path, loaded.robot, loaded.path.name)
        return HTMLResponse(text, status)


class _Server(uvicorn.Server):
    """Ends in order by each of the signals that request it; uvicorn would raise them once more at its end.

    `failure`: what ended it otherwise.
    """

    failure = ""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """While this lasts."""

        def end(_number: int, _frame: FrameType | None) -> None:
            self.should_exit = True

        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, end)
        yield


def _take_all_descriptors() -> None:
    """The usual 1024 are few: where they end, whoever connects next is cut off, the stop too."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _end_with(server: _Server, loop: asyncio.Task[None]) -> None:
    """A loop that fails ends the process: a page that only looks alive is worse than none."""
    if not loop.cancelled() and loop.exception() is not None:
        server.failure = repr(loop.exception())
        server.should_exit = True


def _is_ours(source: MuxSource | None) -> bool:
    """The page publishes velocities of the base, no wheel speeds."""
    return source is not None and source.type == "twist"


async def _drop_silent(server: uvicorn.Server) -> None:
    """Closes connections without a request, again and again; who is refused has none any more (gate.py)."""
    seen: dict[object, float] = {}
    while True:
        await asyncio.sleep(LOOK_S)
        now_s = time.monotonic()
        silent = [each for each in tuple(server.server_state.connections) if getattr(each, "cycle", True) is None]
        seen = {each: seen.get(each, now_s) for each in silent}
        oldest = sorted(seen, key=lambda each: seen[each])
        for i, each in enumerate(oldest):
            is_new = seen[each] == now_s  # its request may be on the way
            if (i < len(oldest) - MOST_SILENT and not is_new) or now_s - seen[each] > SILENT_S:
                with contextlib.suppress(AttributeError, RuntimeError):
                    each.transport.abort()  # type: ignore[attr-defined]
