"""The source of every module as a page of its own with an anchor for each line: what the API pages link to."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path

from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer

from site_builder.modules import ROOT, modules, shipped_packages

FOLDER = "source"
_FROM_API = f"../../{FOLDER}"
_PAGE = """\
<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark"><title>{title}</title>
<link rel="stylesheet" href="{up}/_static/source.css"></head>
<body><p><a href="{up}/index.html">canbase</a> / {title}</p>{code}</body></html>
"""
_BASE_STYLE = """\
body { font-family: sans-serif; margin: 1rem; }
pre { line-height: 1.4; overflow-x: auto; }
a { color: inherit; }
"""


def write(site: Path) -> None:
    """One page for each module below `site`; a page that is newer than its module is left alone."""
    formatter = HtmlFormatter(linenos="inline", lineanchors="L", anchorlinenos=True)
    for package in shipped_packages():
        for module in modules(package):
            page = site / FOLDER / f"{module.path}.html"
            if not page.exists() or page.stat().st_mtime < (ROOT / module.path).stat().st_mtime:
                _write(page, module.path, formatter)


def styles() -> str:
    """The style sheet of these pages: light, and dark where the reader's system is."""
    light, dark = (HtmlFormatter(style=name).get_style_defs(".highlight") for name in ("xcode", "github-dark"))
    return f"{_BASE_STYLE}{light}\n@media (prefers-color-scheme: dark) {{\n{dark}\n}}\n"


def link(domain: str, info: Mapping[str, str]) -> str | None:
    """Where sphinx.ext.linkcode finds the source of a documented name, relative to a page in generated/api."""
    path = _paths().get(info["module"]) if domain == "py" else None
    line = _lines(path).get(info["fullname"]) if path else None
    return f"{_FROM_API}/{path}.html#L-{line}" if line else None


@functools.cache
def _paths() -> dict[str, Path]:
    return {module.name: module.path for package in shipped_packages() for module in modules(package)}


@functools.cache
def _lines(path: Path) -> dict[str, int]:
    return dict(_definitions(ast.parse((ROOT / path).read_text(encoding="utf-8")).body, ""))


def _definitions(body: list[ast.stmt], prefix: str) -> Iterator[tuple[str, int]]:
    for node in body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            yield f"{prefix}{node.name}", node.lineno
            yield from _definitions(node.body, f"{prefix}{node.name}.")


def _write(page: Path, path: Path, formatter: HtmlFormatter) -> None:
    code = highlight((ROOT / path).read_text(encoding="utf-8"), PythonLexer(), formatter)
    page.parent.mkdir(parents=True, exist_ok=True)
    up = "/".join([".."] * len(path.parts))
    page.write_text(_PAGE.format(title=escape(str(path)), up=up, code=code), encoding="utf-8")
