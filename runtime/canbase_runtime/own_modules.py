"""The command line of a module of canbase as a process of its own, which imports nothing from the current folder."""

from __future__ import annotations

import sys
from typing import Final

_HAS_SAFE_PATH: Final = (3, 11)
"""Since then Python has -P."""
_RUN_MODULE: Final = (
    "import sys; sys.path[:] = [path for path in sys.path if path]; import runpy; "
    "runpy.run_module(sys.argv.pop(1), run_name='__main__', alter_sys=True)"
)
"""For `-c`, which puts the current folder, an empty entry, into the path; `sys`, built in, is all that comes before."""


def module_command(module: str, *arguments: str, version: tuple[int, ...] = tuple(sys.version_info[:2])) -> list[str]:
    """`python -m module arguments …` without the current folder in the path. `version`: of this Python."""
    run = ["-P", "-m"] if version >= _HAS_SAFE_PATH else ["-c", _RUN_MODULE]
    return [sys.executable, *run, module, *arguments]
