"""`canbase web`: a page in the browser that shows a running robot, and drives it while a finger is on it."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path
from typing import Annotated, Final

import typer

from canbase_cli.options import ConfigOption, NamespaceOption, ros_arguments, ros_needed
from canbase_runtime.terminal import WRONG_INPUT, fail, load_config

SHORTEST_TOKEN: Final = 16
"""Characters."""
_OF_OTHERS: Final = 0o077


def web(
    ctx: typer.Context,
    config: ConfigOption = None,
    port: Annotated[int, typer.Option("--port", min=1, max=65_535, help="TCP port of the page.")] = 8080,
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Address to listen on; others than 127.0.0.1 open it.")
    ] = "127.0.0.1",
    token_file: Annotated[
        Path | None,
        typer.Option("--token-file", metavar="FILE", help="File with the token.", show_default="a new one each time"),
    ] = None,
    proxy: Annotated[
        str,
        typer.Option("--proxy", metavar="URL", help="Address of a proxy with TLS before it: https://robot.example."),
    ] = "",
    namespace: NamespaceOption = "",
) -> None:
    """Show a running robot in the browser: who drives, speeds, scan, drives, stops, the doctor. Needs no network.

    It prints the address of the page, with a token; without it nobody gets in. The page only reads until a person
    unlocks it. Then it sends goals, and drives the robot while a key is held: with the source `web` of robot.yaml.
    Its large stop always works. From another computer: ssh -L 8080:127.0.0.1:8080 ROBOT.

    Exit codes: 0 ended by Ctrl-C or SIGTERM, 1 the port cannot be had, 2 wrong command line or robot.yaml.
    """
    loaded, arguments = load_config(config), ros_arguments(ctx, namespace)
    with ros_needed():
        import rclpy  # noqa: F401 - without ROS 2 this ends in advice
    try:
        from canbase_web.server import Address, run
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] not in ("nicegui", "fastapi", "uvicorn", "starlette"):
            raise
        fail(f"canbase web needs the Python package {error.name}: pip install 'nicegui>=3.18,<4'", WRONG_INPUT)
    token = secrets.token_urlsafe(24) if token_file is None else _token(token_file)
    _need_one_address(host)
    run(loaded, Address(host, port, token, _origin(proxy)), arguments, namespace)


def _token(file: Path) -> str:
    try:
        with file.open(encoding="utf-8") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            token = opened.read().strip()
    except (OSError, ValueError) as error:
        fail(f"{file} cannot be read: {error}", WRONG_INPUT)
    if mode & _OF_OTHERS:
        fail(f"{file} may be read or written by other users: chmod 600 {file}", WRONG_INPUT)
    if len(token) < SHORTEST_TOKEN or not token.isascii() or not token.isprintable() or " " in token:
        fail(f"{file}: a token has at least {SHORTEST_TOKEN} characters, and no space", WRONG_INPUT)
    return token


def _origin(proxy: str) -> str:
    """As a browser names it (RFC 6454). Exits with 2 for what is no address with TLS."""
    import re

    origin = proxy.lower().removesuffix("/").removesuffix(":443")
    if proxy and not re.fullmatch(r"https://([a-z0-9.-]+|\[[0-9a-f:]+\])(:[0-9]{1,5})?", origin):
        fail(
            f"--proxy {proxy}: expected https://NAME or https://NAME:PORT, the address of the page without a path",
            WRONG_INPUT,
        )
    return origin


def _need_one_address(host: str) -> None:
    """Exits with 2 for an address under which no browser opens the page."""
    import ipaddress

    with contextlib.suppress(ValueError):
        if ipaddress.ip_address(host).is_unspecified:
            fail(f"--host {host} names no address: give that of one interface, as in the browser", WRONG_INPUT)
