"""The page of all actions and messages: each definition in full, since its comments are its documentation."""

from __future__ import annotations

from pathlib import Path

_HEAD = """\
# Actions and messages

The definitions as they are built, with units and ranges in their comments.
Which node uses which: [ROS API](../ros_api.md).
"""


def page(root: Path) -> str:
    """The whole page in Markdown."""
    files = sorted(file for kind in ("*.action", "*.msg", "*.srv") for file in (root / "interfaces").glob(f"*/{kind}"))
    return "\n".join([_HEAD, *(_section(file) for file in files)])


def _section(file: Path) -> str:
    kind = "action" if file.suffix == ".action" else file.suffix.removeprefix(".")
    return f"## canbase/{kind}/{file.stem}\n\n```text\n{file.read_text(encoding='utf-8').rstrip()}\n```\n"
