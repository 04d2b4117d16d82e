"""deploy/requirements: what a robot installs is pinned, has hashes, names no host, and fits pyproject.toml."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

if sys.version_info >= (3, 11):
    import tomllib
else:
    from pip._vendor import tomli as tomllib

ROOT: Final = Path(__file__).parents[3]
LOCKS: Final = sorted((ROOT / "deploy" / "requirements").glob("*.txt"))
PYPROJECT: Final = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS: Final = PYPROJECT["project"]["optional-dependencies"]
ASKED: Final = {
    "ros_apt": [*PYPROJECT["project"]["dependencies"], *EXTRAS["gpio"]],
    "ros_pypi": [
        *PYPROJECT["build-system"]["requires"],
        *PYPROJECT["project"]["dependencies"],
        *EXTRAS["gpio"],
        *EXTRAS["ros"],
    ],
}
FROM_APT: Final = {"ros_apt": {"numpy"}}
"""ROS 2 from apt is built against the numpy of the distribution."""
_ENTRY: Final = re.compile(r"(?P<name>[\w.-]+)==(?P<version>[\w.+!-]+)(?: ; (?P<marker>.+))?")


def entries(lock: Path) -> list[tuple[str, str, str, list[str]]]:
    """Name, version, marker and hashes of each entry. Fails on anything else than that."""
    text = re.sub(r"(?m)^\s*#.*\n", "", lock.read_text(encoding="utf-8")).replace("\\\n", " ")
    found: list[tuple[str, str, str, list[str]]] = []
    for line in text.splitlines():
        pin, *hashes = re.split(r"\s+--hash=", line.strip())
        match = _ENTRY.fullmatch(pin)
        assert match is not None, line
        found.append((canonicalize_name(match["name"]), match["version"], match["marker"] or "", hashes))
    return found


def test_there_is_one_for_each_way_to_have_ros() -> None:
    assert [lock.stem for lock in LOCKS] == sorted(ASKED)


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.stem)
def test_everything_is_pinned_and_has_hashes_and_no_host_is_named(lock: Path) -> None:
    for name, _, _, hashes in entries(lock):
        assert hashes, name
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", one) for one in hashes), name
    assert "://" not in lock.read_text(encoding="utf-8")
    assert "--index" not in lock.read_text(encoding="utf-8")


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.stem)
def test_it_is_what_pyproject_asks_for(lock: Path) -> None:
    """`make lock` renews it."""
    pinned: dict[str, set[str]] = {}
    for name, version, _, _ in entries(lock):
        pinned.setdefault(name, set()).add(version)

    for asked in map(Requirement, ASKED[lock.stem]):
        name = canonicalize_name(asked.name)
        if name in FROM_APT.get(lock.stem, ()):
            assert name not in pinned
        else:
            assert pinned[name], name
            assert all(asked.specifier.contains(version) for version in pinned[name]), name


def test_the_installation_asks_for_the_hashes() -> None:
    text = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")

    for lock in LOCKS:
        assert re.search(rf"pip install --require-hashes -r \S*deploy/requirements/{lock.name}", text)
