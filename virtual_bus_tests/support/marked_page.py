"""Pages that several commands write: each has the lines between two marks to itself, and leaves all others alone."""

from __future__ import annotations


def marks(command: str) -> tuple[str, str]:
    """The lines before and after what `command` writes."""
    return f"<!-- {command}: begin -->", f"<!-- {command}: end -->"


def section(text: str, command: str) -> str:
    """What stands between the marks of `command` now. Raises ValueError when the page does not have both, once."""
    begin, end = marks(command)
    rewritten(text, command, "")
    return text.partition(f"{begin}\n")[2].partition(end)[0]


def rewritten(text: str, command: str, section: str) -> str:
    """`text` with `section` between the marks of `command`. Raises ValueError when it does not have both, once."""
    begin, end = marks(command)
    before, found, rest = text.partition(f"{begin}\n")
    _, found_end, after = rest.partition(end)
    if not (found and found_end) or begin in after or end in before + after:
        raise ValueError(f"expected the lines {begin} and {end} once: what {command} writes goes between them")
    return f"{before}{begin}\n{section.strip()}\n{end}{after}"
