"""The HTML of a report (`canbase explain`, `prove qualify`, `prove evidence`): one base page, one escaper.

A page is one file that opens without a network and may load nothing (its Content-Security-Policy). Whatever is not
`Html` is escaped, so a text of a recording or of a robot never becomes markup.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterable
from importlib.resources import files
from string import Template
from typing import Any, Final

from canbase_runtime.foreign_text import LINE_LENGTH, printable

_INLINE: Final = (
    (re.compile(r"`([^`]+)`"), r"<code>\1</code>"),
    (re.compile(r"\*\*([^*<>]+)\*\*"), r"<strong>\1</strong>"),
    (re.compile(r"(?<!\w)\*([^*<>]+)\*(?!\w)"), r"<em>\1</em>"),
)


class Html(str):
    """Markup: it is not escaped again."""

    __slots__ = ()


def escaped(text: object) -> Html:
    """One line of anybody's text. Markup stays as it is."""
    return text if isinstance(text, Html) else Html(html.escape(printable(text, LINE_LENGTH)))


def marked(text: str) -> Html:
    """Escaped; code between backquotes, emphasis between asterisks, as in Markdown."""
    shown = str(escaped(text))
    for pattern, markup in _INLINE:
        shown = pattern.sub(markup, shown)
    return Html(shown)


def tag(name: str, /, *parts: object, **attributes: object) -> Html:
    """An element. `class_="soft"` is the attribute class; attributes that are empty are left out."""
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escaped(value)}"' for key, value in attributes.items() if value
    )
    end = "" if name == "input" else f"{''.join(map(escaped, parts))}</{name}>"
    return Html(f"<{name}{given}>{end}")


def section(key: str, title: object, *parts: object, **attributes: object) -> Html:
    """A card with a heading."""
    return tag("section", tag("h2", title), *parts, id=key, **attributes)


def bullets(items: Iterable[object]) -> Html:
    """A list; empty without items."""
    listed = [tag("li", item) for item in items]
    return tag("ul", *listed) if listed else Html()


def terms(pairs: Iterable[tuple[object, object]]) -> Html:
    """Names with their values."""
    return tag("dl", *(part for name, value in pairs for part in (tag("dt", name), tag("dd", value))))


def row(*cells: object, **attributes: object) -> Html:
    """Of a table."""
    return tag("tr", *(tag("td", cell) for cell in cells), **attributes)


def table(columns: Iterable[object], rows: Iterable[Html], *, caption: str = "", class_: str = "") -> Html:
    """It scrolls by itself, with the keyboard too. A column may be its whole `th`."""
    head = (each if isinstance(each, Html) else tag("th", each, scope="col") for each in columns)
    named = [tag("caption", marked(caption))] if caption else []
    whole = tag("table", *named, tag("thead", tag("tr", *head)), tag("tbody", *rows), class_=class_)
    return tag("div", whole, class_="scroll", tabindex="0", role="region" if caption else "", aria_label=caption)


def code(text: str) -> Html:
    """A whole file, line by line."""
    return tag("pre", Html(html.escape(text)))


def data(value: Any, **attributes: object) -> Html:
    """JSON for a script of the page: nothing in it ends its element."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True)
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return tag("script", Html(text), type="application/json", **attributes)


def page(title: str, header: Iterable[Html], main: Iterable[Html], *, library: str = "", script: str = "") -> str:
    """The whole file. `library`, `script`: JavaScript for its head and its end; without both, scripts are forbidden."""
    template = Template((files("canbase_recording") / "html_page.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=escaped(title),
        allowed="; script-src 'unsafe-inline'; img-src data: blob:; font-src data:" if script else "",
        library=f"<script>{library}</script>" if library else "",
        header="".join(map(escaped, header)),
        main="".join(map(escaped, main)),
        script=f"<script>{script}</script>" if script else "",
    )
