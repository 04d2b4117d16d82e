"""Debian's chromium, driven by playwright: for the tests of `canbase web`."""

from __future__ import annotations

import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import pytest

playwright = pytest.importorskip("playwright.sync_api")
CHROMIUM: Final = shutil.which("chromium") or shutil.which("chromium-browser")
NEEDS_CHROMIUM: Final = pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium: apt-get install chromium")
TOKEN: Final = "the-token-of-this-test"


@contextmanager
def browser() -> Iterator[Any]:
    """A headless one, for as long as this lasts."""
    with playwright.sync_playwright() as player:
        launched = player.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield launched
        launched.close()


def free_tcp_port() -> int:
    """A TCP port that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
