"""The list of all decision records, from their file names and headings."""

from __future__ import annotations

from pathlib import Path

_HEAD = """\
# Decisions

Why things are as they are: what was needed, what was decided, and what follows from it. One page for each decision.

```{{toctree}}
:maxdepth: 1

{names}
```
"""


def page(root: Path) -> str:
    """The whole page in Markdown."""
    records = sorted((root / "docs" / "decisions").glob("*.md"))
    return _HEAD.format(names="\n".join(f"/decisions/{record.stem}" for record in records))
