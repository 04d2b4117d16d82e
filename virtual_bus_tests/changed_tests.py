"""`python -m changed_tests`: the unit tests that concern what git says has changed, one path a line; for `make quick`.

A test concerns a module when it imports it, or when it is the test itself. What only uses a module through others is
left to `make test`.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parents[1]
UNIT = "virtual_bus_tests/unit"


def module_of(path: str) -> str:
    """Dotted name of a Python file, by which a test imports it; empty: it is none that a test can import."""
    parts = PurePosixPath(path).with_suffix("").parts
    if not path.endswith(".py") or parts[-1].startswith("test_"):
        return ""
    in_package = next((at for at, part in enumerate(parts) if part.startswith("canbase_")), None)
    first = 1 if in_package is None and parts[0] in ("virtual_bus_tests", "benchmarks", "docs") else in_package
    return "" if first is None else ".".join(parts[first:]).removesuffix(".__init__")


def imports(text: str, module: str) -> bool:
    """Whether the text of a test imports the module, or a name of its package that is this module."""
    package, _, name = module.rpartition(".")
    whole = rf"^\s*(?:from {re.escape(module)} import|import {re.escape(module)}\b)"
    part = rf"^\s*from {re.escape(package)} import [^\n]*\b{re.escape(name)}\b" if package else r"(?!)"
    return re.search(f"{whole}|{part}", text, re.MULTILINE) is not None


def concerned(changed: Iterable[str], tests: Mapping[str, str]) -> list[str]:
    """Of `tests` (path to text) those that concern the `changed` paths, all relative to the root of the repository."""
    changed = set(changed)
    modules = sorted({module_of(path) for path in changed} - {""})
    return sorted(path for path, text in tests.items() if path in changed or any(imports(text, m) for m in modules))


def changed_paths(base: str) -> list[str]:
    """What differs from the commit `base`, committed or not, and what git does not know yet."""
    asked = (["diff", "--name-only", "--diff-filter=d", base], ["ls-files", "--others", "--exclude-standard"])
    return [line for each in asked for line in _git(*each)]


def _git(*arguments: str) -> list[str]:
    told = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True)
    return told.stdout.splitlines()


def main() -> None:
    """BASE in the environment: another commit than the last one."""
    tests = {str(path.relative_to(ROOT)): path.read_text() for path in (ROOT / UNIT).rglob("test_*.py")}
    print(*concerned(changed_paths(os.environ.get("BASE", "HEAD")), tests), sep="\n")


if __name__ == "__main__":
    main()
