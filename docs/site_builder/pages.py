"""Writes all generated pages to docs/generated/. A page that has not changed is left alone, so that Sphinx skips it."""

from __future__ import annotations

from pathlib import Path

from site_builder import api_pages, command_page, decision_page, message_page, structure


def write(root: Path) -> None:
    """Every generated page below `root`/docs/generated; what is no longer generated is removed."""
    folder = root / "docs" / "generated"
    made = {
        **api_pages.pages(root),
        "commands.md": command_page.page(),
        "decisions.md": decision_page.page(root),
        "files.md": structure.page(root),
        "messages.md": message_page.page(root),
    }
    for name, text in made.items():
        _write(folder / name, text)
    for file in [file for file in folder.rglob("*") if file.is_file()]:
        if str(file.relative_to(folder)) not in made:
            file.unlink()


def _write(file: Path, text: str) -> None:
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
