"""Hides secrets in text for a support bundle: values after names like password or token, and private keys. Pure."""

from __future__ import annotations

import re
from typing import Final

HIDDEN: Final = "(hidden by canbase support-bundle)"
_NO_UNIT: Final = r"(?<!\.service)(?<!\.socket)(?<!\.target)(?<!\.path)(?<!\.timer)"
"""`systemd-ask-password.path: Deactivated` has no password."""
_KEY: Final = (
    r"(?<![\w.-])(?P<outer>\\{0,7}[\"'])?"
    r"(?i:[\w.-]{0,80}(?:passw|passphrase|secret|token|api[ _-]?key|private[ _-]?key|credential)"
    r"[\w.-]{0,80}(?:(?: access)? key)?)"
    rf"{_NO_UNIT}(?P<close>\\{{0,7}}[\"'])?[ \t]*(?:=(?![=>])|:(?!:|//))[ \t]*"
)
"""A name with its quotes and its = or :, but not ==, =>, :: and ://."""
_BEFORE: Final = r"(?:(?P<start>^[ \t]*(?:-[ \t]+|export[ \t]+)?)|(?P<flow>[{,][ \t]*))?"
_QUOTED: Final = r"(?P<quote>\\{0,7}[\"'])(?:(?!(?<!\\)(?P=quote))[^\n])+(?P<end>(?P=quote))?"
_LIST: Final = r"[\[{][^\]}\n]+[\]}]?"
"""Or a mapping."""
_NUMBER: Final = r"[^\s,}\]]+"
"""Of JSON: its key is in quotes."""
_UP_TO_QUOTE: Final = r"(?:(?!(?P=outer))[^\n])+"
"""The quotes are around key and value."""
_FLOW: Final = r"[^,{}\n]+"
_LINE: Final = r"\S[^\n]*"
"""The key begins its line."""
_WORD: Final = r"(?:(?!\\{0,7}[\"'])\S)+"
_PLAIN: Final = rf"(?(close){_NUMBER}|(?(outer){_UP_TO_QUOTE}|(?(flow){_FLOW}|(?(start){_LINE}|{_WORD}))))"
_VALUE: Final = rf"(?:{_QUOTED}|(?!\\{{0,7}}[\"'])(?:{_LIST}|{_PLAIN}))"
_SECRET: Final = re.compile(f"(?P<before>{_BEFORE}{_KEY}){_VALUE}", re.MULTILINE)
_BLOCK: Final = re.compile(
    rf"^(?P<before>(?P<indent>[ \t]*){_KEY}(?:[|>][^\n]*)?\n)(?:(?P=indent)[ \t]+\S[^\n]*(?:\n|\Z))+", re.MULTILINE
)
"""A key whose value is in the deeper lines below it, as YAML has it."""
_PRIVATE_KEY: Final = re.compile(
    r"-----BEGIN [A-Z ]*PRIVATE KEY(?: BLOCK)?-----.*?(-----END [A-Z ]*PRIVATE KEY(?: BLOCK)?-----|\Z)", re.DOTALL
)


def cleaned(text: str) -> str:
    """Without what looks like a password, a token or a private key; everything else as it was."""
    text = _PRIVATE_KEY.sub(HIDDEN, text)
    text = _BLOCK.sub(lambda found: f"{found['before']}{found['indent']}  {HIDDEN}\n", text)
    return _SECRET.sub(lambda found: f"{found['before']}{found['quote'] or ''}{HIDDEN}{found['end'] or ''}", text)
