"""The page of all files: one line for each, the first one of its docstring."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

from site_builder.modules import Module, modules, shipped_packages

_HEAD = """\
# Files

What each file of a shipped package is for: the first line of its docstring. How they work together:
[architecture](../architecture.md).

"""


def page(root: Path) -> str:
    """Markdown: one table for each folder of a shipped package."""
    found = [module for package in shipped_packages(root) for module in modules(package, root)]
    folders = groupby(found, key=lambda module: module.path.parent)
    return _HEAD + "\n\n".join(_folder(folder, list(files)) for folder, files in folders) + "\n"


def _folder(folder: Path, files: list[Module]) -> str:
    about = [module.purpose for module in files if module.path.name == "__init__.py"]
    rows = [
        f"| `{module.path.name}` | {_cell(module.purpose)} |" for module in files if module.path.name != "__init__.py"
    ]
    return "\n".join([f"## `{folder}/`", "", *about, "", "| file | purpose |", "|---|---|", *rows])


def _cell(text: str) -> str:
    return text.replace("|", "∣")
