"""The process of `canbase web`: its port, its pages, the robot's link, from its start to its end."""

from __future__ import annotations

import asyncio
import resource
import secrets
import signal
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
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
from canbase_runtime.web_names import authority, hosts
from canbase_web import commission_page, drive_page, explained_stop, health_page, now_page, stops_page
from canbase_web.access import COOKIE, MOST_BODY_BYTES, Access
from canbase_web.hold import Hold
from canbase_web.hold_socket import HoldSocket
from canbase_web.listener import HEADERS, Listener
from canbase_web.pages import Pages
from canbase_web.relay import relay
from canbase_web.robot_link import RobotLink

MOST_PASSED: Final = 256
"""Connections of those who have the cookie."""
SOURCE_NAME: Final = "web"
"""Key of `mux.sources` whose topic the page publishes on."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where the page is."""

    host: str
    port: int
    token: str
    proxy: str = ""
    """Of a proxy with TLS before it: https://NAME or https://NAME:PORT."""

    @property
    def url(self) -> str:
        """For the person; it has the token."""
        return f"{self.proxy or f'http://{authority(self.host, self.port)}'}/?token={self.token}"


def run(loaded: Loaded, address: Address, ros_args: list[str], namespace: str) -> None:
    """Serves until SIGINT or SIGTERM. Exits with 1 when the address cannot be had, or a part of it has failed."""
    _take_all_descriptors()
    access = Access(
        address.token,
        COOKIE.format(port=address.port),
        secrets.token_urlsafe(32),
        hosts(address.host, address.port),
        address.proxy,
    )
    try:
        listener = Listener((address.host, address.port), access)
    except OSError as error:
        fail(f"{address.host}:{address.port} cannot be had: {error.strerror}; give another --port", FAILED)
    robot = loaded.robot
    source = SOURCE_NAME if _is_ours(robot.mux.sources.get(SOURCE_NAME)) else ""
    link = RobotLink(robot, source, ros_args)
    hold = HoldSocket(Hold(robot.limits.linear_mps, robot.limits.angular_radps), link, source)
    pages = Pages(loaded, link, hold, source, namespace)
    with TemporaryDirectory(prefix="canbase-web-") as folder:
        behind = f"{folder}/pages"

        @asynccontextmanager
        async def life(app: FastAPI) -> AsyncIterator[None]:
            loop = asyncio.get_running_loop()

            relays = set()  # a loop keeps no task alive that nobody else has

            def pass_on(connection: socket.socket, begun: bytes) -> None:
                relays.add(passed := asyncio.run_coroutine_threadsafe(relay(connection, begun, behind), loop))
                passed.add_done_callback(relays.discard)

            parts = [
                asyncio.create_task(hold.run()),
                asyncio.create_task(asyncio.to_thread(listener.serve, lambda: pages.stop_page(loop), pass_on)),
            ]
            for part in parts:
                part.add_done_callback(lambda ended: _end_with(server, ended))
            typer.echo(f"open {address.url}   (Ctrl-C ends the page; the robot is not affected)")
            yield
            listener.close()
            parts[0].cancel()
            await asyncio.gather(*parts, return_exceptions=True)

        app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None, lifespan=life)
        _add(app, pages, hold, loaded)
        server = _Server(
            uvicorn.Config(
                app,
                uds=behind,
                log_level="warning",
                http="h11",
                headers=list(HEADERS),
                limit_concurrency=MOST_PASSED,
                ws_max_size=MOST_BODY_BYTES,
                timeout_graceful_shutdown=1,
                server_header=False,
                proxy_headers=False,
            )
        )
        try:
            server.run()
        finally:
            link.close()
    if server.failure:
        fail(f"canbase web ends: {server.failure}", FAILED)


def _add(app: FastAPI, pages: Pages, hold: HoldSocket, loaded: Loaded) -> None:
    """The pages, their files, the websocket of hold-to-drive, and the page of each recording."""

    @app.websocket("/hold")
    async def hold_to_drive(websocket: WebSocket) -> None:
        await hold.serve(websocket)

    @app.get(explained_stop.ADDRESS)
    async def explained(name: str) -> HTMLResponse:
        path = explained_stop.named((event.black_box for event in pages.link.stops), name)
        if path is None:
            return HTMLResponse(explained_stop.missing(name), 404)
        status, text = await asyncio.to_thread(explained_stop.explained, path, loaded.robot, loaded.path.name)
        return HTMLResponse(text, status)

    app.mount("/static", StaticFiles(directory=Path(__file__).parent / "static"))
    for page in (now_page, drive_page, commission_page, stops_page, health_page):
        page.add(pages)
    ui.run_with(app, title=f"canbase {loaded.robot.name}", dark=None, show_welcome_message=False, reconnect_timeout=3.0,
                tailwind=False, favicon="🛞", binding_refresh_interval=None)  # fmt: skip


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
    """The usual 1024 are few: where they end, no connection can be accepted, for STOP neither."""
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
