"""The list of all decision records, from their file names and headings."""

from __future__ import annotations

from pathlib import Path

_HEAD = """\
# Decisions

Why things are as they are: context, decision, consequence, and what was rejected. One page for each subject.
A new choice changes the record of its subject. A missing number belongs to the record whose status names it.

```{{toctree}}
:maxdepth: 1

{names}
```
"""


def page(root: Path) -> str:
    """The whole page in Markdown."""
    records = sorted((root / "docs" / "decisions").glob("*.md"))
    return _HEAD.format(names="\n".join(f"/decisions/{record.stem}" for record in records))
