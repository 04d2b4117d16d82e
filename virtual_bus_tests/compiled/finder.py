"""Copied as sitecustomize.py beside the compiled packages: they win over the editable ones, here and in all workers."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

HERE = Path(__file__).resolve().parent
PACKAGES = {path.parent.name for path in HERE.glob("*/__init__.py")}


class CompiledPackages:
    """In front of all other finders, also that of the editable installation."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """As Python's own finder, in this folder alone."""
        if name.partition(".")[0] not in PACKAGES:
            return None
        return PathFinder.find_spec(name, path or [str(HERE)], target)


sys.meta_path.insert(0, CompiledPackages)
