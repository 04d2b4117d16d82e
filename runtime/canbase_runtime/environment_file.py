"""Reads the environment file of a unit, NAME=value a line, as systemd.exec(5) has it for EnvironmentFile=. Pure."""

from __future__ import annotations


def variables(text: str) -> dict[str, str]:
    """What the file sets: a later line wins over an earlier one, a pair of quotes round a value is no part of it."""
    lines = (line.strip() for line in text.splitlines())
    pairs = (line.partition("=") for line in lines if "=" in line and not line.startswith(("#", ";")))
    return {name.strip(): _unquoted(value.strip()) for name, _, value in pairs}


def _unquoted(value: str) -> str:
    return value[1:-1] if len(value) > 1 and value[0] == value[-1] and value[0] in "\"'" else value
