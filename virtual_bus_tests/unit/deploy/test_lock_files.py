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
    **{extra: asked for extra, asked in EXTRAS.items() if extra not in ("gpio", "ros")},
}
"""By list: one for each way to have ROS 2, which has `gpio` too, and one for each other extra."""
FROM_APT: Final = {"ros_apt": {"numpy"}}
ROS: Final = ("ros_apt", "ros_pypi")
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


def test_there_is_one_for_each_way_to_have_ros_and_for_each_extra() -> None:
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


def test_an_extra_changes_nothing_that_is_installed_and_brings_no_numpy() -> None:
    """The numpy of ROS 2 from apt is that of the distribution."""
    pins = {lock.stem: {name: (version, hashes) for name, version, _, hashes in entries(lock)} for lock in LOCKS}
    for extra in set(pins) - set(ROS):
        assert "numpy" not in pins[extra]
        for ros in ROS:
            both = pins[extra].keys() & pins[ros].keys()
            assert {name: pins[extra][name] for name in both} == {name: pins[ros][name] for name in both}, (extra, ros)


def pages() -> str:
    """All that users read, apart from decisions: they are history."""
    files = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return "\n".join(file.read_text(encoding="utf-8") for file in files if "decisions" not in file.parts)


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.stem)
def test_the_installation_asks_for_the_hashes(lock: Path) -> None:
    assert re.search(rf"pip install --require-hashes -r \S*deploy/requirements/{lock.name}", pages())


def test_no_page_has_root_install_what_has_no_hash() -> None:
    """canbase itself comes from the checkout, and everything else from the lists."""
    commands = re.findall(r"pip3? install ([^`\n#]*)", pages())
    assert len(commands) > 8
    unhashed = [words for words in commands if "--require-hashes" not in words and not is_of_the_checkout(words)]
    assert unhashed == []


def is_of_the_checkout(words: str) -> bool:
    """A wheel made there, or the checkout itself; with the extra `ros` for a laptop."""
    return re.search(r"(^|\s)('?\.\[ros\]'?|/opt/canbase/src|dist/\S+\.whl|-e '\.\[ros\]')(\s|$)", words) is not None
