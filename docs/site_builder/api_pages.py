"""The Python reference: one page for each package that is shipped, with every module in it, and an overview of them."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

from site_builder.docstrings import plain
from site_builder.modules import Module, modules, shipped_packages

_OVERVIEW = """\
Python API
==========

Every package that the wheel installs. Units are in the names (``_s``, ``_m``, ``_mps``, ``_rad``) or in brackets;
signs follow REP 103.
Each class and function links to its source. Names that begin with an underscore are private and are not listed.

.. toctree::
   :maxdepth: 1

{names}
{tables}
"""


def pages(root: Path) -> dict[str, str]:
    """File names below docs/generated, and their texts."""
    packages = {name: list(found) for name, found in groupby(_all(root), key=lambda module: module.package)}
    made = {f"api/{name}.rst": _page(name, found) for name, found in packages.items()}
    names = "".join(f"   api/{name}\n" for name in packages)
    return {
        **made,
        "api.rst": _OVERVIEW.format(names=names, tables="\n".join(map(_table, packages, packages.values()))),
    }


def _all(root: Path) -> list[Module]:
    found = [module for package in shipped_packages(root) for module in modules(package, root)]
    return [module for module in found if module.path.name != "__main__.py"]


def _page(name: str, found: list[Module]) -> str:
    parts = [name, "=" * len(name), ""]
    for module in found:
        if module.name != name:
            title = module.name.removeprefix(f"{name}.")
            parts += [title, "-" * len(title), ""]
        parts += [f".. automodule:: {module.name}", ""]
    return "\n".join(parts)


def _table(name: str, found: list[Module]) -> str:
    rows = [
        f"   * - :py:mod:`{_label(name, module)} <{module.name}>`\n     - {plain(module.purpose)}" for module in found
    ]
    head = [name, "-" * len(name), "", ".. list-table::", "   :widths: 25 75", ""]
    return "\n".join([*head, *rows, ""])


def _label(name: str, module: Module) -> str:
    return module.name.removeprefix(f"{name}.")
