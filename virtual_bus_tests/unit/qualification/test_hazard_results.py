"""Tests of canbase as evidence: which results count for a hazard, and which do not."""

from __future__ import annotations

import pytest

from canbase_evidence.hazard_results import HazardResult, Proof, Result, finding, hazard_results
from canbase_evidence.junit_results import Case, JUnitError, Outcome, read_cases
from canbase_evidence.standing import Standing
from canbase_hazards import catalogue
from canbase_hazards.catalogue import Catalogue, Row
from vm.junit import junit

CODE = "c0de"
ROW = catalogue.load().rows[0]


def row_of(*tests: str, name: str = "a_row") -> Row:
    return ROW.model_copy(update={"id": name, "tests": tests})


def case(
    function: str = "test_a",
    *,
    module: str = "unit.chain.test_chain",
    parameters: str = "",
    outcome: Outcome = Outcome.PASSED,
    code: str = CODE,
    of_file: int | None = 1,
    of_function: int | None = 1,
) -> Case:
    return Case(module, function, parameters, outcome, code, of_file, of_function)


def result(row: Row, *cases: Case) -> HazardResult:
    return hazard_results(Catalogue(rows=(row,)), cases, CODE)[0]


def proof(name: str, *cases: Case) -> Proof:
    return result(row_of(name), *cases).proofs[0]


def test_a_function_that_passed_with_all_its_parameters_counts() -> None:
    cases = [case("test_a", parameters=p, of_file=9, of_function=2) for p in ("left", "right")]
    assert proof("unit/chain/test_chain.py::test_a", *cases) == Proof("unit/chain/test_chain.py::test_a", Result.PASSED)


def test_a_function_of_which_one_parameter_was_not_run_does_not_count() -> None:
    found = proof("unit/chain/test_chain.py::test_a", case("test_a", parameters="left", of_function=2))
    assert (found.result, found.why) == (Result.NOT_RUN, "only 1 of its 2 tests ran")


def test_a_file_counts_when_all_of_its_tests_ran() -> None:
    name = "unit/chain/test_chain.py"
    assert proof(name, case("test_a", of_file=2), case("test_b", of_file=2)).result is Result.PASSED
    assert proof(name, case("test_a", of_file=2)).result is Result.NOT_RUN
    assert proof(name, case("test_a", of_file=2), case("test_a", of_file=2)).result is Result.NOT_RUN, "the same twice"
    unknown = proof(name, case("test_a", of_file=None))
    assert (unknown.result, unknown.why) == (
        Result.NOT_RUN,
        "1 of its tests ran, and it is not known how many there are",
    )


@pytest.mark.parametrize(
    ("code", "why"),
    [("old", "its result is of another code of canbase"), ("", "its result does not say which code was tested")],
)
def test_results_of_another_code_do_not_count_even_when_they_failed(code: str, why: str) -> None:
    for outcome in Outcome:
        found = proof("unit/chain/test_chain.py::test_a", case(code=code, outcome=outcome))
        assert (found.result, found.why) == (Result.NOT_RUN, why)


def test_one_failure_in_any_file_of_results_outweighs_a_pass() -> None:
    found = proof("unit/chain/test_chain.py::test_a", case(), case(outcome=Outcome.FAILED))
    assert (found.result, found.why) == (Result.FAILED, "test_a failed")


def test_a_skipped_test_proves_nothing() -> None:
    assert proof("unit/chain/test_chain.py", case(outcome=Outcome.SKIPPED)).result is Result.SKIPPED


def test_rows_of_the_exit_matrix_are_the_parameters_of_one_test() -> None:
    name = "test_the_robot_stops_in_time_and_stays_at_rest"
    ran = case(name, module="ros.test_exit_matrix", parameters="motor_driver: SIGINT", of_function=52)
    assert proof("matrix: motor_driver: SIGINT", ran).result is Result.PASSED
    assert proof("matrix: motor_driver: SIGTERM", ran).result is Result.NOT_RUN


def test_scenarios_of_the_virtual_robot_come_from_its_own_file() -> None:
    found = [
        {"name": "driver SIGKILL", "failure": "", "took_s": 12.0, "row": None},
        {"name": "link down", "failure": "moved 0.4 m", "took_s": 9.0, "row": None},
    ]
    cases = read_cases(junit(found, CODE, {"two robots": "not here"}))
    assert proof("virtual robot: driver SIGKILL", *cases).result is Result.PASSED
    assert proof("virtual robot: link down", *cases).result is Result.FAILED
    assert proof("virtual robot: two robots", *cases).result is Result.SKIPPED
    assert proof("virtual robot: masked", *cases).result is Result.NOT_RUN


def test_a_row_is_as_good_as_the_worst_of_its_tests() -> None:
    row = row_of("unit/chain/test_chain.py::test_a", "unit/chain/test_chain.py::test_b")
    passed, skipped = case("test_a"), case("test_b", outcome=Outcome.SKIPPED)
    assert result(row, passed).result is Result.NOT_RUN
    assert result(row, passed, skipped).result is Result.SKIPPED
    assert result(row, passed, case("test_b")).result is Result.PASSED
    assert result(row, passed, case("test_b", outcome=Outcome.FAILED)).result is Result.FAILED


def test_the_sentence_counts_every_row() -> None:
    rows = Catalogue(rows=(row_of("unit/a/test_a.py", name="one"), row_of("unit/b/test_b.py", name="two")))
    one = case(module="unit.a.test_a")
    none, some = (hazard_results(rows, cases, CODE) for cases in ((), (one,)))
    every = hazard_results(rows, (one, case(module="unit.b.test_b")), CODE)
    assert finding(none, any_file=False).standing is Standing.MISSING
    found = finding(some, any_file=True)
    assert found.standing is Standing.INCOMPLETE
    assert found.sentence == "Of 2 hazards, by the worst of their tests: 1 not run, 1 passed."
    assert finding(every, any_file=True).standing is Standing.PRESENT


JUNIT = """<testsuites><testsuite>
<testcase classname="virtual_bus_tests.unit.a.test_b.TestC" name="test_d[x: y/z[1]]"><properties>
 <property name="canbase_code" value="c0de"/><property name="canbase_tests_of_file" value="7"/>
 <property name="canbase_tests_of_function" value="many"/></properties></testcase>
<testcase classname="unit.a.test_b" name="test_e"><failure message="no"/></testcase>
<testcase classname="unit.a.test_b" name="test_f"><error message="failed on teardown"/></testcase>
<testcase classname="unit.a.test_b" name="test_g"><skipped/></testcase>
</testsuite></testsuites>"""


def test_junit_xml_of_pytest() -> None:
    first, *others = read_cases(JUNIT)
    assert first == Case("unit.a.test_b", "TestC::test_d", "x: y/z[1]", Outcome.PASSED, "c0de", 7, None)
    assert [each.outcome for each in others] == [Outcome.FAILED, Outcome.FAILED, Outcome.SKIPPED]
    assert {each.module for each in others} == {"unit.a.test_b"}
    assert all(each.code == "" for each in others)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "no XML"),
        ("<testsuites>", "no XML"),
        ("<html/>", "its root is <html>"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><testsuites/>', "DOCTYPE"),
    ],
)
def test_what_is_no_junit_xml(text: str, why: str) -> None:
    with pytest.raises(JUnitError, match=why):
        read_cases(text)
