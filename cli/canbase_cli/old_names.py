"""Commands that had another name up to version 0.1: they work, and say the new one. Delete this file in version 0.3."""

from __future__ import annotations

from typing import Any, Final

import typer
from typer.core import TyperGroup

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
"""What follows `record` now. Before, it was a command: an option or nothing followed."""


def renamed(words: list[str]) -> list[str] | None:
    """The words of a command line with the new name; None: its name is no old one."""
    if not words:
        return None
    if words[0] == "record" and words[1:2] and words[1] not in OF_RECORD:
        return ["record", "start", *words[1:]]
    return [*NEW[words[0]], *words[1:]] if words[0] in NEW else None


class OldNames(TyperGroup):
    """The commands of canbase, by their old names too."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """As every group. An old name is said to be one on stderr."""
        words = renamed(args)
        if words is not None:
            now = " ".join(word for word in words[:2])
            typer.echo(f"canbase {args[0]} is now: canbase {now}", err=True)
        return super().resolve_command(ctx, words or args)
