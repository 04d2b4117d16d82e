"""docs/architecture.md against the code: packages, their imports, and the files, folders and nodes that it names."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from site_builder.modules import ROOT, modules, shipped_packages

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `canbase_(\w+)` \| (\w+/) \| (.+) \|$", PAGE, re.MULTILINE)
PACKAGES = shipped_packages()
SOURCES = {module.path: (ROOT / module.path).read_text("utf-8") for package in PACKAGES for module in modules(package)}
OTHERS = (*(ROOT / "virtual_bus_tests").rglob("*.py"), *(ROOT / "qualification").rglob("*.yaml"))
FILES = {f"/{path}" for path in (*SOURCES, *(path.relative_to(ROOT) for path in OTHERS))}


def imported(package: Path) -> Iterator[str]:
    """Top names of what this package imports, also within functions."""
    for path, source in SOURCES.items():
        for node in ast.walk(ast.parse(source)) if package in path.parents else ():
            if isinstance(node, ast.ImportFrom) and node.module:
                yield node.module.partition(".")[0]
            elif isinstance(node, ast.Import):
                yield from (alias.name.partition(".")[0] for alias in node.names)


def test_every_package_has_a_row_with_its_folder() -> None:
    assert {Path(folder, f"canbase_{name}") for name, folder, _ in ROWS} == set(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_a_package_imports_what_its_row_names_and_nothing_else(package: Path) -> None:
    row = next(names for name, _, names in ROWS if f"canbase_{name}" == package.name)
    named = {f"canbase_{name}" for name in re.findall(r"\w+", re.sub(r"\(.*?\)", "", row))}
    assert named == {each.name for each in PACKAGES} & set(imported(package)) - {package.name}


def test_every_file_folder_and_node_that_the_page_names_exists() -> None:
    named = set(re.findall(r"`([\w/]+\.(?:py|yaml))`", PAGE)) - {"robot.yaml"}
    folders = set(re.findall(r"`(\w+)/`", PAGE)) - {"interfaces"}
    nodes = set(re.findall(r"nodes? `(\w+)`", PAGE))
    assert (len(named) > 40, len(folders) > 7, len(nodes) > 4) == (True, True, True)
    assert sorted(name for name in named if not any(path.endswith(f"/{name}") for path in FILES)) == []
    assert sorted(name for name in folders if not any(f"/{name}/" in path for path in FILES)) == []
    assert [node for node in nodes if not any(f'"{node}"' in source for source in SOURCES.values())] == []
