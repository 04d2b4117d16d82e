"""Commands that had another name up to version 0.1: they work, and a terminal shows the new one. To go in 0.3."""

from __future__ import annotations

import sys
from difflib import get_close_matches
from typing import Any, Final

import typer

from canbase_cli.options import Commands

GROUPS: Final = {
    "setup": ("init", "commission", "calibrate", "install", "uninstall"),
    "bus": ("scan", "dump", "sdo", "params", "nmt", "emcy", "jog", "adopt"),
    "print": ("sample", "urdf", "nav2", "ekf", "aggregator"),
    "record": ("replay", "export"),
    "prove": ("qualify", "evidence", "benchmark"),
    "serve": ("driver", "velocity", "action-server", "watchdog", "sim", "metrics", "vda5050"),
}
NEW: Final = {name: (group, name) for group, names in GROUPS.items() for name in names} | {
    "support-bundle": ("record", "bundle")
}
OF_RECORD: Final = ("start", "replay", "export", "bundle", "--help", "-h")
"""What follows `record` now. Before, it was a command: nothing or an option followed, and still may."""


def renamed(words: list[str]) -> list[str] | None:
    """The words of a command line with the new name; None: its name is no old one."""
    if not words:
        return None
    if words[0] == "record" and (words[1:] == [] or words[1] not in OF_RECORD):
        return ["record", "start", *words[1:]]
    return [*NEW[words[0]], *words[1:]] if words[0] in NEW else None


class OldNames(Commands):
    """The commands of canbase, by their old names too."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """As every group. A person at a terminal learns the new name; scripts and launch files that take each line on
        stderr for a failure do not."""
        words = None if ctx.resilient_parsing and args[:1] == ["record"] else renamed(args)
        if words is not None and sys.stderr.isatty() and not ctx.resilient_parsing:
            typer.echo(f"canbase {args[0]} is now: canbase {' '.join(words[:2])}", err=True)
        if words is None and args[0] not in self.commands:
            near = get_close_matches(args[0], [*self.commands, *NEW])
            meant = ", ".join(repr(" ".join(NEW.get(name, (name,)))) for name in near)
            ctx.fail(f"No such command {args[0]!r}." + (f" Did you mean {meant}?" if near else ""))
        return super().resolve_command(ctx, words or args)
