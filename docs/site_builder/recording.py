"""`make recording`: runs `canbase demo` on a terminal of its own and draws what it prints, in colour: docs/demo.svg."""

from __future__ import annotations

import io
import os
import pty
import re
import subprocess
import sys

from rich.console import Console
from rich.terminal_theme import MONOKAI
from rich.text import Text

from site_builder.modules import ROOT

COLUMNS = 92
PICTURE = ROOT / "docs" / "demo.svg"
_WEB_FONT = re.compile(r"@font-face\s*\{.*?\}\s*", re.DOTALL)


def main() -> int:
    """Exit code 0: the demo succeeded, and the picture is written. The picture loads nothing: no fonts of the web."""
    output, exit_code = recorded("canbase", "demo")
    if exit_code:
        print(f"canbase demo failed ({exit_code}); {PICTURE.name} is left as it was\n{output}", file=sys.stderr)
        return 1
    PICTURE.write_text(drawn(f"$ canbase demo\n{output.rstrip()}", "canbase demo"), encoding="utf-8")
    return 0


def recorded(*command: str) -> tuple[str, int]:
    """What `command` writes to a terminal with COLUMNS columns, and its exit code."""
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": str(COLUMNS), "LINES": "60"}
    process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment)
    os.close(theirs)
    parts = []
    try:
        while part := os.read(ours, 4096):
            parts.append(part)
    except OSError:  # EIO: Linux reports the end of a terminal so
        pass
    os.close(ours)
    return b"".join(parts).decode(), process.wait()


def drawn(output: str, title: str) -> str:
    """`output` with its ANSI colours as SVG."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), force_terminal=True, color_system="truecolor")
    console.print(Text.from_ansi(output.replace("\r\n", "\n")))
    svg = console.export_svg(title=title, theme=MONOKAI, unique_id="demo")
    return _WEB_FONT.sub("", svg).replace("Fira Code, monospace", "monospace")


if __name__ == "__main__":
    sys.exit(main())
