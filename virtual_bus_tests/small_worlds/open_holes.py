"""Properties that do not hold yet, and with which events. A row goes when its mend has landed."""

from __future__ import annotations

from collections.abc import Sequence

from small_worlds.explore import Story

OPEN: dict[str, tuple[frozenset[str], str]] = {}
"""Property → with which of these events it does not hold yet, and why."""


def unexpected(stories: Sequence[Story]) -> list[Story]:
    """Stories that no row explains."""
    return [story for story in stories if not _is_open(story)]


def closed(stories: Sequence[Story]) -> list[str]:
    """Rows that no story needs any more."""
    return [name for name in OPEN if not any(story.found.name == name for story in stories)]


def _is_open(story: Story) -> bool:
    events, _ = OPEN.get(story.found.name, (frozenset(), ""))
    return any(name in events for _, name in story.events)
