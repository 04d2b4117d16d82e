"""The committed report of the mutation tests is about today's sources; every survivor is explained. And the mutants."""

from __future__ import annotations

import pytest

from mutation import report
from mutation.mutants import behaviour, mutants
from mutation.targets import ROOT, TARGETS, Target, files

AGAIN = (
    "run `make mutation`: it tries the mutants of changed modules and writes virtual_bus_tests/mutation/report.json. "
    "mutation/unmeasured.yaml names exactly the modules that were not tried since they changed"
)


def test_the_report_is_about_these_sources() -> None:
    assert report.outdated(report.load()) == report.unmeasured(), AGAIN


def test_the_report_says_nothing_about_what_was_not_tried() -> None:
    assert not set(report.load()) & set(report.unmeasured())


def test_every_survivor_is_explained_and_nothing_else() -> None:
    survivors = {
        (module, survivor.before, survivor.after)
        for module, entry in report.load().items()
        for survivor in entry.survivors
    }
    waiting = {each for each in report.explanations() if each[0] in report.unmeasured()}
    explained = set(report.explanations()) - waiting
    assert survivors == explained, "mutation/explained.yaml says for each survivor why it may live"


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.module)
def test_each_module_has_its_tests(target: Target) -> None:
    assert target.source
    for name in files((*target.first, *target.then)):
        assert (ROOT / name).is_file(), name


SOURCE = '''
from dataclasses import dataclass

TABLE = (1, 2)


@dataclass(frozen=True, slots=True)
class Word:
    """What it is."""

    bits: int

    def far(self, limit: int) -> str:
        # an explanation
        return "far" if self.bits > limit else ""
'''


def changes(source: str) -> list[tuple[str, str]]:
    return [(mutant.before, mutant.after) for mutant in mutants(source)]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("TABLE = (1, 2)", "TABLE = ( 2)"),
        ("TABLE = (1, 2)", "TABLE = (1, )"),
        ("TABLE = (1, 2)", "TABLE = ( 0, 2)"),
        ('return "far" if self.bits > limit else ""', 'return "far" if self.bits >= limit else ""'),
        ('return "far" if self.bits > limit else ""', 'return "far" if not self.bits > limit else ""'),
    ],
)
def test_a_mutant_for_each_way_to_be_wrong(before: str, after: str) -> None:
    assert any(known == before and new.replace(" ", "") == after.replace(" ", "") for known, new in changes(SOURCE))


def test_what_no_behaviour_hangs_on_makes_no_mutant() -> None:
    touched = {before for before, _ in changes(SOURCE)}
    assert "@dataclass(frozen=True, slots=True)" not in {after for _, after in changes(SOURCE)}
    assert not any("bits: int" in line or "What it is" in line for line in touched)


def test_each_mutant_is_another_program() -> None:
    sources = [behaviour(mutant.source) for mutant in mutants(SOURCE)]
    assert len(set(sources)) == len(sources) > 8
    assert behaviour(SOURCE) not in sources


def test_a_changed_comment_or_docstring_does_not_outdate_the_report() -> None:
    assert behaviour(SOURCE.replace("an explanation", "another")) == behaviour(SOURCE)
    assert behaviour(SOURCE.replace("What it is", "What it was")) == behaviour(SOURCE)
    assert behaviour(SOURCE.replace("(1, 2)", "(1, 3)")) != behaviour(SOURCE)
