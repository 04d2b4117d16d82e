"""What the tests of canbase write into JUnit XML, so that `canbase prove evidence` knows what a passed test proves."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from canbase_evidence.installed_code import PACKAGES, code_sha256, tree_sha256
from canbase_evidence.junit_results import Case, Outcome, read_cases
from site_builder.modules import ROOT

TESTS = """import pytest

@pytest.mark.parametrize("x", ["a: b", "c[d]"])
def test_one(x): ...

class TestTwo:
    def test_three(self): assert x
"""


def cases_of(pytester: pytest.Pytester, *words: str) -> dict[str, Case]:
    pytester.makeconftest("from hazards.tested import pytest_collection_modifyitems as pytest_collection_modifyitems")
    pytester.makepyfile(test_it=TESTS)
    pytester.runpytest_inprocess("-p", "no:cacheprovider", "--junitxml=found.xml", *words)
    return {case.function: case for case in read_cases((pytester.path / "found.xml").read_text())}


def test_a_whole_run(pytester: pytest.Pytester) -> None:
    found = cases_of(pytester)
    assert found["test_one"] == Case("test_it", "test_one", "c[d]", Outcome.PASSED, code_sha256(), 3, 2)
    assert found["TestTwo::test_three"] == Case(
        "test_it", "TestTwo::test_three", "", Outcome.FAILED, code_sha256(), 3, 1
    )


def test_tests_that_were_left_out_are_counted(pytester: pytest.Pytester) -> None:
    (found,) = cases_of(pytester, "-k", "three").values()
    assert (found.of_file, found.of_function) == (3, 1)


def test_tests_that_were_named_singly_do_not_know_how_many_there_are(pytester: pytest.Pytester) -> None:
    found = cases_of(pytester, "test_it.py::test_one")["test_one"]
    assert (found.of_file, found.of_function) == (None, 2)
    found = cases_of(pytester, "test_it.py::test_one[a: b]")["test_one"]
    assert (found.of_file, found.of_function) == (None, None)


def test_the_code_is_what_runs_on_a_robot() -> None:
    rules = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    rule = rules.partition('name = "On a robot nothing needs')[2].partition("source_modules = [")[2].partition("]")[0]
    assert set(PACKAGES) == set(re.findall('"([a-z_]+)"', rule))


def tree(folder: Path, files: dict[str, str]) -> str:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tree_sha256({"canbase_driver": folder})


def test_the_hash_of_the_code_depends_on_names_and_contents_and_not_on_the_place(tmp_path: Path) -> None:
    files = {"core.py": "a = 1\n", "boot/steps.py": "b = 2\n", "eds/drive.eds": "[FileInfo]\n"}
    known = tree(tmp_path / "here", files)
    assert tree(tmp_path / "there", {**files, "__pycache__/core.pyc": "anything"}) == known
    assert tree(tmp_path / "changed", {**files, "core.py": "a = 2\n"}) != known
    assert tree(tmp_path / "more", {**files, "new.py": ""}) != known
    renamed = {"boot/step.py" if name == "boot/steps.py" else name: text for name, text in files.items()}
    assert tree(tmp_path / "renamed", renamed) != known
