"""Hides secrets in text for a support bundle.

These are values after names like password or token, what is in URLs, headers and command lines, tokens of known forms,
and private keys. Pure. Why no library: docs/decisions/0037.
"""

from __future__ import annotations

import re
from typing import Final

HIDDEN: Final = "(hidden by canbase support-bundle)"
_NO_UNIT: Final = r"(?<!\.service)(?<!\.socket)(?<!\.target)(?<!\.path)(?<!\.timer)"
"""`systemd-ask-password.path: Deactivated` has no password."""
_SHORT: Final = r"(?:[\w.-]{0,80}[_.-])?(?:pass|pwd|psk)(?:[_.-]?\d{1,3})?"
"""Names of which these are a part of their own: DB_PASS and wpa-psk, but neither bypass nor passed."""
_KEY: Final = (
    r"(?<![\w.-])(?P<outer>\\{0,7}[\"'])?"
    rf"(?i:[\w.-]{{0,80}}(?:passw|passphrase|secret|token|api[ _-]?key|private[ _-]?key|credential)"
    rf"[\w.-]{{0,80}}(?:(?: access)? key)?|{_SHORT})"
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
_OPEN_LINE: Final = r"(?:(?!(?P=quote))[^\n]){0,2000}"
_LINES: Final = re.compile(
    rf"(?P<before>{_BEFORE}{_KEY})(?P<quote>\\{{0,7}}[\"']){_OPEN_LINE}(?:\n{_OPEN_LINE}){{1,10}}(?P<end>(?P=quote))",
    re.MULTILINE,
)
"""A quoted value that goes on in the next lines."""
_CONTINUED: Final = re.compile(
    rf"^(?P<before>(?P<indent>[ \t]*)(?:export[ \t]+)?{_KEY})"
    r"(?:[^\s\"'|>][^\n]*\n(?:(?P=indent)[ \t]+[^\s:=#-][^:=\n]*(?:\n|\Z))+|[^\n]*\\\n[^\n]+(?:\n|\Z))",
    re.MULTILINE,
)
"""One without quotes that goes on in deeper lines, as YAML has it, or behind a backslash, as shells have it."""
_PRIVATE_KEY: Final = re.compile(
    r"-----BEGIN [A-Z ]*PRIVATE KEY(?: BLOCK)?-----.*?(-----END [A-Z ]*PRIVATE KEY(?: BLOCK)?-----|\Z)", re.DOTALL
)
_END_OF_KEY: Final = re.compile(r"-----END [A-Z ]*PRIVATE KEY(?: BLOCK)?-----")
_WORD_OR_QUOTED: Final = r"(?:\"[^\"\n]*\"|'[^'\n]*'|[^\s\"',\]\\]+)"
_FORMS: Final = tuple(
    re.compile(rf"(?P<before>{before}){value}")
    for before, value in (
        (r"[A-Za-z][A-Za-z0-9+.-]{0,30}://", r"[^\s/\"'<>@]{1,300}(?:@[^\s/\"'<>@]{1,300}){0,3}(?=@)"),
        (
            r"(?i:\b(?:(?:proxy-)?authorization|(?:set-)?cookie|x-auth-token)"
            r"\\{0,7}[\"']?[ \t]*[:=][ \t]*\\{0,7}[\"']?)",
            r"[^\n\"'\\]+",
        ),
        (r"(?i:\b(?:bearer|basic|digest)[ \t]+)", r"[A-Za-z0-9+/._~-]{8,}={0,2}"),
        (
            r"(?i:(?<![\w-])--?[\w-]{0,40}(?:passw(?:or)?d|passphrase|pass|pwd|psk|secret|token|api-?key)\\{0,7}[\"']?"
            r"(?:[ \t]+|,[ \t]*)\\{0,7})",
            rf"(?!-){_WORD_OR_QUOTED}",
        ),
        (r"(?i:(?<!\S)(?:-u|--user)[ =]\S{1,80}?:)", _WORD_OR_QUOTED),
        (r"(?i:\bsshpass[ \t]+-p[ \t]*)", _WORD_OR_QUOTED),
        (r"(?i:\bwpa-(?:psk|passphrase)[ \t]+)", r"[^\s:=][^\n]*"),
        (r"(?i:\blogin[ \t]+\S{1,80}[ \t]+password[ \t]+)", r"\S+"),
        (r"\b(?=(?:gh[pousr]_|github_pat_|glpat-|xox[abprs]-|AKIA|ASIA|AIza|pypi-|eyJ[\w-]{8,200}\.))", r"[\w.-]{16,}"),
    )
)
"""Userinfo of a URL; headers; options of command lines; interfaces(5), .netrc; tokens that show what they are."""


_SUSPECT: Final = re.compile(
    r"(?i:pass|pwd|psk|secret|token|api[ _-]?key|private[ _-]?key|credential|authorization|cookie|bearer|basic|digest)"
    r"|(?i:login)|://|--?u|gh[pousr]_|github_pat_|glpat-|xox[abprs]-|AKIA|ASIA|AIza|pypi-|eyJ"
)
"""What every pattern below needs in its first line: most of a journal has none, and is copied."""
_LINES_AFTER: Final = 12
"""This many lines behind such a line belong to it, and all deeper ones."""


def cleaned(text: str) -> str:
    """Without what looks like a password, a token or a private key; everything else as it was."""
    text = _PRIVATE_KEY.sub(HIDDEN, _without_end_of_key(text))
    parts: list[str] = []
    suspect: list[str] = []
    left = 0
    for line in text.splitlines(keepends=True):
        if _SUSPECT.search(line):
            left = _LINES_AFTER
        if left > 0 or (suspect and line[0] in " \t-"):
            suspect.append(line)
            left -= 1
            continue
        if suspect:
            parts.append(_hidden("".join(suspect)))
            suspect = []
        parts.append(line)
    return "".join([*parts, _hidden("".join(suspect))])


def _hidden(text: str) -> str:
    for form in _FORMS:
        text = form.sub(lambda found: f"{found['before']}{HIDDEN}", text)
    text = _LINES.sub(lambda found: f"{found['before']}{found['quote']}{HIDDEN}{found['end']}", text)
    text = _CONTINUED.sub(lambda found: f"{found['before']}{HIDDEN}\n", text)
    text = _BLOCK.sub(lambda found: f"{found['before']}{found['indent']}  {HIDDEN}\n", text)
    return _SECRET.sub(lambda found: f"{found['before']}{found['quote'] or ''}{HIDDEN}{found['end'] or ''}", text)


def _without_end_of_key(text: str) -> str:
    """The beginning of a text may have been cut off, and with it that of a private key."""
    end, begin = _END_OF_KEY.search(text), text.find("-----BEGIN ")
    return text if end is None or 0 <= begin < end.start() else HIDDEN + text[end.end() :]
