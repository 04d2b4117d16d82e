"""The folder of a qualification: what may go on with it, and what is refused with which sentence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from canbase_qualification import folder
from canbase_qualification.folder import About, FolderError
from canbase_qualification.job import Amount, Load
from canbase_qualification.software import Software, software

HERE = Software("1.2.0", "0123456789ab", "3.11.2", "2.0.1")
ABOUT = About(
    "bench", "my/robot.yaml", "abc", HERE, Load((0.5, 2.0), 0.03), Amount(), 0.8, ("It rains.",), ("Snow: ä.",)
)


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    folder.write(tmp_path, ABOUT, b"name: bench\n")
    assert folder.read_about(tmp_path) == ABOUT
    assert (tmp_path / "robot.yaml").read_bytes() == b"name: bench\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["qualification.json", "robot.yaml"]


def test_results_are_not_overwritten(tmp_path: Path) -> None:
    folder.check_new(tmp_path)
    folder.write(tmp_path, ABOUT, b"")
    with pytest.raises(FolderError, match="has results already: --resume goes on with them, --output names another"):
        folder.check_new(tmp_path)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"load": {"payloads": [1], "slope": 0}}', ABOUT.text()[:-9]])
def test_a_file_that_is_none_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "qualification.json").write_text(text)
    with pytest.raises(FolderError, match=r"qualification\.json cannot be read"):
        folder.read_about(tmp_path)


def test_a_folder_without_one_is_named(tmp_path: Path) -> None:
    with pytest.raises(FolderError, match="it is no folder of canbase prove qualify"):
        folder.read_about(tmp_path)


@pytest.mark.parametrize(
    ("now", "words"),
    [
        (replace(ABOUT, software=replace(HERE, canbase="1.3.0")), "computed by canbase 1.2.0 .* this is canbase 1.3.0"),
        (replace(ABOUT, software=replace(HERE, sources="ffff")), "go on with the same version"),
        (
            replace(ABOUT, load=Load((0.5, 3.0), 0.03)),
            r"--payload 0\.5\.\.2 --slope 0\.03; now it is --payload 0\.5\.\.3",
        ),
        (
            replace(ABOUT, configuration_sha256="def"),
            r"configuration: SHA-256 abc…, and my/robot\.yaml has def",
        ),
    ],
)
def test_results_of_something_else_do_not_belong_to_it(tmp_path: Path, now: About, words: str) -> None:
    with pytest.raises(FolderError, match=words):
        folder.check_same(tmp_path, ABOUT, now)


def test_more_runs_of_the_same_do(tmp_path: Path) -> None:
    folder.check_same(tmp_path, ABOUT, replace(ABOUT, amount=Amount(scenarios=5), file="other/place.yaml"))


def test_the_software_of_this_process_is_known() -> None:
    found = software()
    assert len(found.sources) == 12
    assert found.sources in str(found)
