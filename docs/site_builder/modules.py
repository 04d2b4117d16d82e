"""Finds the Python packages that pyproject.toml ships and the modules in them, with each module's one-line purpose.

Nothing is imported: a purpose is the first line of the module's docstring. No list of modules is kept by hand.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    from pip._vendor import tomli as tomllib

ROOT = Path(__file__).parents[2]
"""The top folder of the sources."""


@dataclass(frozen=True, slots=True)
class Module:
    """One Python file: its dotted name, its path below the top folder, and the first line of its docstring."""

    name: str
    path: Path
    purpose: str

    @property
    def package(self) -> str:
        """The dotted name of the package that holds it; a package's own `__init__` holds itself."""
        return self.name if self.path.name == "__init__.py" else self.name.rpartition(".")[0]


def shipped_packages(root: Path = ROOT) -> list[Path]:
    """The folders of the packages in the wheel, relative to `root`, in the order of pyproject.toml."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    return [Path(folder) for folder in project["tool"]["scikit-build"]["wheel"]["packages"]]


def modules(package: Path, root: Path = ROOT) -> Iterator[Module]:
    """Every module of the package in the folder `package`, `__init__` first, folder by folder."""
    files = (root / package).rglob("*.py")
    for file in sorted(files, key=lambda file: (file.parent, file.name != "__init__.py", file.name)):
        path = file.relative_to(root)
        parts = path.relative_to(package.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        yield Module(name, path, purpose(file))


def purpose(file: Path) -> str:
    """The first line of the module's docstring. Raises ValueError where there is none."""
    docstring = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
    if not docstring:
        raise ValueError(f"{file} has no docstring: its first line has to say what the file is for")
    return docstring.splitlines()[0]


def version(root: Path = ROOT) -> str:
    """The version of canbase, from pyproject.toml."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    return str(project["project"]["version"])
