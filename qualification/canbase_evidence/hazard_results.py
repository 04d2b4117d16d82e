"""Each hazard of the catalogue with its tests, and how each of them ended: passed, failed, skipped, not run. Pure.

A test counts for the installed code alone, and a file counts when all of its tests have run.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from canbase_evidence.junit_results import Case, Outcome
from canbase_evidence.standing import Finding, Part, Standing
from canbase_hazards.catalogue import Catalogue, Row

MATRIX: Final = "matrix: "
VIRTUAL_ROBOT: Final = "virtual robot: "
VIRTUAL_ROBOT_MODULE: Final = "vm"
"""In the results of `make vm-test`."""
_MATRIX_TEST: Final = ("ros.test_exit_matrix", "test_the_robot_stops_in_time_and_stays_at_rest")


class Result(Enum):
    """Of a test or of a row; the worst first. The value is what the page shows."""

    FAILED = "failed"
    NOT_RUN = "not run"
    SKIPPED = "skipped"
    PASSED = "passed"


@dataclass(frozen=True, slots=True)
class Proof:
    """One name in `tests` of a row."""

    name: str
    result: Result
    why: str = ""
    """Why it does not count; empty for a passed one."""


@dataclass(frozen=True, slots=True)
class HazardResult:
    """One row and its tests."""

    row: Row
    proofs: tuple[Proof, ...]

    @property
    def result(self) -> Result:
        """The worst of its tests."""
        found = {proof.result for proof in self.proofs}
        return next(result for result in Result if result in found)


def hazard_results(catalogue: Catalogue, cases: Iterable[Case], code: str) -> tuple[HazardResult, ...]:
    """`code`: what is installed here; cases of another code count for nothing."""
    by_module: dict[str, list[Case]] = defaultdict(list)
    for case in cases:
        by_module[case.module].append(case)
    return tuple(
        HazardResult(row, tuple(_proof(name, by_module, code) for name in row.tests)) for row in catalogue.rows
    )


def finding(results: Sequence[HazardResult], any_file: bool) -> Finding:
    """All rows in one sentence. `any_file`: whether a file of results was given."""
    counts = {result: sum(each.result is result for each in results) for result in Result}
    cure = "make evidence-tests in the sources of this version; then --tests FILE" if not any_file else ""
    if counts[Result.PASSED] == len(results):
        return Finding(Part.HAZARDS, Standing.PRESENT, f"All tests of all {len(results)} hazards passed.")
    told = ", ".join(f"{counts[result]} {result.value}" for result in Result if counts[result])
    standing = Standing.FAILED if counts[Result.FAILED] else Standing.INCOMPLETE if any_file else Standing.MISSING
    return Finding(Part.HAZARDS, standing, f"Of {len(results)} hazards, by the worst of their tests: {told}.", cure)


def _proof(name: str, by_module: dict[str, list[Case]], code: str) -> Proof:
    module, function, parameters = _wanted(name)
    found = [
        case
        for case in by_module.get(module, ())
        if function in ("", case.function) and parameters in ("", case.parameters)
    ]
    ours = [case for case in found if case.code == code]
    if not ours:
        return Proof(name, Result.NOT_RUN, _why_none(found))
    return _judged(name, ours, _expected(ours, function, parameters))


def _wanted(name: str) -> tuple[str, str, str]:
    """Module, function and parameters; an empty one: any."""
    if name.startswith(MATRIX):
        return (*_MATRIX_TEST, name.removeprefix(MATRIX))
    if name.startswith(VIRTUAL_ROBOT):
        return VIRTUAL_ROBOT_MODULE, name.removeprefix(VIRTUAL_ROBOT), ""
    path, _, function = name.partition("::")
    return path.removesuffix(".py").replace("/", "."), function, ""


def _why_none(found: Sequence[Case]) -> str:
    if not found:
        return "no result of it was given"
    known = any(case.code for case in found)
    return "its result is of another code of canbase" if known else "its result does not say which code was tested"


def _expected(cases: Sequence[Case], function: str, parameters: str) -> int | None:
    """How many tests must have run; None: not known."""
    if parameters:
        return 1
    counts = [case.of_function if function else case.of_file for case in cases]
    return max((count for count in counts if count is not None), default=None)


def _judged(name: str, cases: Sequence[Case], expected: int | None) -> Proof:
    failed = [case for case in cases if case.outcome is Outcome.FAILED]
    if failed:
        return Proof(name, Result.FAILED, f"{_names(failed)} failed")
    ran = len({(case.function, case.parameters) for case in cases})
    if expected is None:
        return Proof(name, Result.NOT_RUN, f"{ran} of its tests ran, and it is not known how many there are")
    if ran < expected:
        return Proof(name, Result.NOT_RUN, f"only {ran} of its {expected} tests ran")
    skipped = [case for case in cases if case.outcome is Outcome.SKIPPED]
    if skipped:
        return Proof(name, Result.SKIPPED, f"{_names(skipped)} was skipped")
    return Proof(name, Result.PASSED)


def _names(cases: Sequence[Case]) -> str:
    more = f" and {len(cases) - 1} more" if len(cases) > 1 else ""
    first = cases[0]
    return f"{first.function}{f'[{first.parameters}]' if first.parameters else ''}{more}"
