"""Finds what a built page would load from the network: scripts, style sheets, pictures, fonts. Links are no loads."""

from __future__ import annotations

import re
from pathlib import Path

_LOADS = re.compile(
    r"""<(?:script|img|iframe|source|video|audio|embed)\b[^>]*?\bsrc\s*=\s*["']?((?:https?:)?//[^"'\s>]+)"""
    r"""|<link\b[^>]*?\bhref\s*=\s*["']?((?:https?:)?//[^"'\s>]+)"""
    r"""|(?:url\(|@import\s+)["']?((?:https?:)?//[^"'\s)]+)""",
    re.IGNORECASE,
)


def loads(text: str) -> list[str]:
    """Addresses that `text` (HTML, CSS or SVG) loads by itself."""
    return ["".join(found) for found in _LOADS.findall(text)]


def check(site: Path) -> None:
    """Raises ValueError that names the first pages below `site` that would load something from the network."""
    files = (file for pattern in ("*.html", "*.css", "*.svg") for file in site.rglob(pattern))
    found = [f"{file.relative_to(site)}: {url}" for file in files for url in loads(file.read_text(encoding="utf-8"))]
    if found:
        raise ValueError("the site would load from the network:\n" + "\n".join(found[:20]))
