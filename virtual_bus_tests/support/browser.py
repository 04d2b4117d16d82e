"""Debian's chromium, driven by playwright: for the tests of pages."""

from __future__ import annotations

import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest

playwright = pytest.importorskip("playwright.sync_api")
CHROMIUM: Final = shutil.which("chromium") or shutil.which("chromium-browser")
NEEDS_CHROMIUM: Final = pytest.mark.skipif(
    CHROMIUM is None, reason="NOT CHECKED: no chromium here (apt-get install chromium)"
)
TOKEN: Final = "the-token-of-this-test"


@contextmanager
def browser() -> Iterator[Any]:
    """A headless one, for as long as this lasts."""
    with playwright.sync_playwright() as player:
        launched = player.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield launched
        launched.close()


def offline_page(player: Any, file: Path, drawn: str, *, width: int, height: int, dark: bool) -> tuple[Any, list[str]]:
    """A page from a file without a network, once the selector `drawn` is there; and what the browser complains about or
    asks a network for."""
    context = player.new_context(
        viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light", offline=True
    )
    shown, complaints = context.new_page(), []
    shown.on("console", lambda message: complaints.append(message.text))
    shown.on("pageerror", lambda error: complaints.append(str(error)))
    inside = ("file:", "data:", "blob:")
    shown.on("request", lambda asked: None if asked.url.startswith(inside) else complaints.append(asked.url))
    shown.goto(file.as_uri())
    shown.wait_for_selector(drawn)
    return shown, complaints


def free_tcp_port() -> int:
    """A TCP port that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
