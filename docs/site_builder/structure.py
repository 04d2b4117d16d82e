"""The tree of the sources for docs/architecture.md: one line for each file, from its docstring."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

from site_builder.modules import Module, modules, shipped_packages

COMMAND = "make structure"


def section(root: Path) -> str:
    """Markdown: one table for each folder of a shipped package."""
    found = [module for package in shipped_packages(root) for module in modules(package, root)]
    return "\n\n".join(
        _folder(folder, list(files)) for folder, files in groupby(found, key=lambda module: module.path.parent)
    )


def _folder(folder: Path, files: list[Module]) -> str:
    about = [module.purpose for module in files if module.path.name == "__init__.py"]
    rows = [
        f"| `{module.path.name}` | {_cell(module.purpose)} |" for module in files if module.path.name != "__init__.py"
    ]
    return "\n".join([f"### `{folder}/`", "", *about, "", "| file | purpose |", "|---|---|", *rows])


def _cell(text: str) -> str:
    return text.replace("|", "∣")
