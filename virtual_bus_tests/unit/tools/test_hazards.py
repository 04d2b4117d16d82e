"""hazards.yaml: tests that exist, formulas that robot.yaml can answer, and a page that is up to date."""

from __future__ import annotations

import re

import pytest
from pydantic import ValidationError

from campaign.removed_safeguards import SAFEGUARDS
from canbase_campaign.faults import FAULTS
from canbase_campaign.twins import MEASURED, SPEED_MPS
from canbase_hazards.catalogue import Braking, Catalogue, Row, load
from canbase_hazards.formula import FormulaError, evaluate
from canbase_hazards.promise import worst_distance_m
from exit_matrix.page_table import Key
from exit_matrix.stop_limits import ALLOWANCE_S, coast, quick, ramp
from hazards import page, proofs
from hazards.measured import longest_stop

CATALOGUE = load()
ROBOT = page.sample_robot()


@pytest.mark.parametrize("row", CATALOGUE.rows, ids=lambda row: row.id)
def test_each_row_names_tests_that_exist(row: Row) -> None:
    assert [why for name in row.tests if (why := proofs.problem(name))] == []


@pytest.mark.parametrize("row", CATALOGUE.rows, ids=lambda row: row.id)
def test_each_time_and_distance_follows_from_robot_yaml(row: Row) -> None:
    for formula in (row.within_s, row.distance_m):
        assert not formula or 0.0 < evaluate(formula, ROBOT) < 20.0
    assert row.braking in (Braking.NONE, Braking.COAST) or row.layer


@pytest.mark.parametrize("row", [row for row in CATALOGUE.rows if row.safeguard], ids=lambda row: row.id)
def test_each_safeguard_can_be_taken_out(row: Row) -> None:
    assert [name for name in row.safeguard.split("+") if name not in SAFEGUARDS] == []


@pytest.mark.parametrize("row", [row for row in CATALOGUE.rows if row.faults], ids=lambda row: row.id)
def test_each_failure_of_a_row_is_one_of_the_campaign(row: Row) -> None:
    known = FAULTS.keys() | {": ".join(twin.key) for twin in MEASURED}
    assert [name for name in row.faults if name not in known] == []
    assert len(set(row.faults)) == len(row.faults)


def test_each_failure_of_the_campaign_has_a_row() -> None:
    named = {name for row in CATALOGUE.rows for name in row.faults}
    assert FAULTS.keys() - named == set()


BRAKING_S = {Braking.RAMP: ramp, Braking.QUICK_STOP: quick, Braking.COAST: coast}
STOPS = proofs.stops()
PROMISED = [row for row in CATALOGUE.rows if row.within_s and row.braking in BRAKING_S and longest_stop(row, STOPS)]


def test_most_measured_rows_are_compared() -> None:
    assert len(PROMISED) > 30


@pytest.mark.parametrize("row", PROMISED, ids=lambda row: row.id)
def test_no_measured_stop_is_longer_than_its_row_states(row: Row) -> None:
    stop = longest_stop(row, STOPS)
    assert stop is not None
    assert stop.time_s <= evaluate(row.within_s, ROBOT) + BRAKING_S[row.braking](ROBOT, SPEED_MPS) + ALLOWANCE_S


def longest(stops: dict[Key, dict[str, str]], *faults: str) -> tuple[str, str, str] | None:
    """Of a row with these failures."""
    row = CATALOGUE.rows[0].model_copy(update={"faults": faults, "tests": ("matrix: a: killed",)})
    stop = longest_stop(row, stops)
    return None if stop is None else (stop.cell, stop.name, stop.source)


def test_the_longest_stop_of_a_row_is_the_longest_of_many_runs_and_of_the_real_one() -> None:
    stops: dict[Key, dict[str, str]] = {
        ("a", "killed"): {"one real run": "0.30 s, 10 mm", "runs": "100", "max": "0.40 s, 90 mm"},
        ("a", "hung: for ever"): {"one real run": "0.50 s, 20 mm", "runs": "–", "max": "–"},
        ("b", "killed"): {"one real run": "7.00 s, 1 mm"},
        ("c", "killed"): {"one real run": "0.70 s, 1 mm", "runs": "100", "max": "0.60 s, 90 mm"},
    }
    assert longest(stops) == ("0.40 s, 90 mm", "a: killed", "100 runs")
    assert longest(stops, "c: killed") == ("0.70 s, 1 mm", "c: killed", "one real run")
    assert longest(stops, "hangs", "a: hung: for ever") == ("0.50 s, 20 mm", "a: hung: for ever", "one real run")
    assert longest({}, "hangs") is None


def test_a_base_that_never_stood_took_the_longest() -> None:
    stops: dict[Key, dict[str, str]] = {
        ("a", "killed"): {"runs": "9", "max": "0.40 s, 90 mm"},
        ("b", "c"): {"runs": "9", "max": "never, 3 mm"},
    }
    assert longest(stops, "b: c") == ("never, 3 mm", "b: c", "9 runs")


def test_the_page_is_up_to_date() -> None:
    assert page.out_of_date(page.pages(CATALOGUE)) == [], "run `make hazards`"


CARDS = dict(re.findall(r"^### (.+?)$\n(.+?)(?=^#|\Z)", page.cards(CATALOGUE, ROBOT), re.MULTILINE | re.DOTALL))


@pytest.mark.parametrize("row", CATALOGUE.rows, ids=lambda row: row.id)
def test_the_card_of_a_hazard_has_all_that_its_row_states(row: Row) -> None:
    card = re.sub(r"\[(\w+)\]\(#[\w-]+\)", r"\1", CARDS[row.id.replace("_", " ").capitalize()])
    stated = (row.failure, row.unsafe_control_action, row.constraint, row.layer, row.reaction, row.not_covered)
    assert [text for text in (*stated, row.within_s, *row.tests) if text not in card] == []
    assert ("Acts within" in card, "Not covered" in card) == (bool(row.within_s), bool(row.not_covered))


def test_a_card_names_the_measured_stop_and_links_the_rows_that_it_names() -> None:
    stop = longest_stop(next(row for row in CATALOGUE.rows if row.id == "driver_killed_or_hung"), STOPS)
    assert stop is not None
    assert f"- **Measured:** {stop.cell} ({stop.name}, {stop.source})\n" in CARDS["Driver killed or hung"]
    assert "[dead_encoder_after_a_tap](#dead-encoder-after-a-tap)" in CARDS["Encoder lost slow or at rest"]
    assert set(page.FIRST) <= {row.id for row in CATALOGUE.rows}


def test_the_distance_is_the_way_until_it_acts_and_braking() -> None:
    row = CATALOGUE.rows[1].model_copy(update={"within_s": "0.3", "braking": Braking.QUICK_STOP, "distance_m": ""})
    speed, rate = ROBOT.limits.linear_mps, ROBOT.limits.emergency_deceleration_mps2
    assert worst_distance_m(row, ROBOT) == pytest.approx(speed * 0.3 + speed**2 / (2.0 * rate))
    assert worst_distance_m(row.model_copy(update={"braking": Braking.COAST}), ROBOT) is None
    assert worst_distance_m(row.model_copy(update={"distance_m": "0.25 * 2"}), ROBOT) == 0.5


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("1 + 2 * 3", 7.0),
        ("max(0.1, 3 / 10) - min(0.1, 1)", 0.2),
        ("timeouts.lease_s", ROBOT.timeouts.lease_s),
        ("mux.sources.joystick.timeout_s", ROBOT.mux.sources["joystick"].timeout_s),
    ],
)
def test_a_formula(formula: str, value: float) -> None:
    assert evaluate(formula, ROBOT) == pytest.approx(value)


@pytest.mark.parametrize(
    ("formula", "said"),
    [
        ("timeouts.lease", "no key timeouts.lease"),
        ("timeouts.__class__", "no key"),
        ("limits", "not a number"),
        ("__import__('os')", "only numbers"),
        ("bus.interface", "not a number"),
        ("1 +", "not a formula"),
        ("True", "not a number"),
        ("2 ** 9", "only numbers"),
        ("(lambda: 1)()", "only numbers"),
    ],
)
def test_what_is_no_formula_is_refused(formula: str, said: str) -> None:
    with pytest.raises(FormulaError, match=said):
        evaluate(formula, ROBOT)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("unit/test_nothing.py", "there is no"),
        ("unit/tools/test_hazards.py::test_nothing", "has no test_nothing"),
        ("support/snapshots.py", "has no test"),
        ("matrix: motor_driver: SIGNOTHING", "no such row"),
        ("virtual robot: nothing", "no such scenario"),
    ],
)
def test_a_proof_that_does_not_exist_is_named(name: str, said: str) -> None:
    assert said in proofs.problem(name)


def test_a_proof_is_a_file_a_test_or_a_test_with_parameters() -> None:
    names = frozenset(("unit/test_a.py", "ros/test_b.py::test_stops"))
    assert proofs.is_proof("virtual_bus_tests/unit/test_a.py::test_any[1]", names)
    assert proofs.is_proof("virtual_bus_tests/ros/test_b.py::test_stops[driver: SIGKILL]", names)
    assert not proofs.is_proof("virtual_bus_tests/ros/test_b.py::test_goes", names)


def test_two_rows_with_one_id_are_refused() -> None:
    with pytest.raises(ValidationError, match="two rows have the id"):
        Catalogue(rows=(CATALOGUE.rows[0], CATALOGUE.rows[0]))


HOOKS = """
from hazards.proof_rules import pytest_runtest_makereport as pytest_runtest_makereport
from support.needs_root import pytest_runtest_setup as pytest_runtest_setup
"""
SKIPPED = "import pytest\n\n@pytest.mark.skip(reason='no time')\ndef test_it() -> None: ...\n"
NEEDS_ROOT = "import pytest\n\n@pytest.mark.needs_root('give a file away')\ndef test_it() -> None:\n    pass\n"


@pytest.mark.filterwarnings("ignore::pytest.PytestUnknownMarkWarning")
@pytest.mark.parametrize(
    ("text", "user", "outcomes"),
    [
        pytest.param(SKIPPED, 0, {"errors": 1, "skipped": 1}, id="skipped: fails"),
        pytest.param(SKIPPED, 1000, {"errors": 1, "skipped": 1}, id="skipped for a user: fails too"),
        pytest.param(NEEDS_ROOT, 0, {"passed": 2}, id="needs root: runs as root"),
        pytest.param(NEEDS_ROOT, 1000, {"skipped": 2}, id="needs root: skipped for a user"),
        pytest.param(NEEDS_ROOT + "    pytest.skip('')\n", 0, {"failed": 1, "skipped": 1}, id="skipped as root: fails"),
    ],
)
def test_a_skipped_proof_fails_unless_it_waits_for_root(
    text: str, user: int, outcomes: dict[str, int], pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A proof, and beside it a test that is none."""
    monkeypatch.setattr("os.geteuid", lambda: user)
    pytester.makeconftest(HOOKS)
    name = next(
        name for name in sorted(proofs.pytest_names(CATALOGUE)) if name.startswith("unit/") and "::" not in name
    )
    path = pytester.path / name
    path.parent.mkdir(parents=True)
    path.write_text(text)
    path.with_name("test_other.py").write_text(text)
    result = pytester.runpytest_inprocess("-p", "no:cacheprovider", "-rs")
    result.assert_outcomes(**outcomes)
    assert ("NOT CHECKED: needs root, to give a file away" in result.stdout.str()) == (text is NEEDS_ROOT and user != 0)


UNSTEADY = """
runs = []

def test_it():
    runs.append("run")
    assert len(runs) > 1, "stopped 0.3 s late"
"""


def test_a_proof_that_fails_does_not_run_again(pytester: pytest.Pytester) -> None:
    """A proof and a test that is none both fail at their first run: the second alone may pass at its second."""
    pytester.makeconftest("from hazards.proof_rules import pytest_itemcollected as pytest_itemcollected")
    name = next(name for name in sorted(proofs.pytest_names(CATALOGUE)) if name.startswith("ros/") and "::" not in name)
    path = pytester.path / name
    path.parent.mkdir(parents=True)
    path.write_text(UNSTEADY)
    path.with_name("test_other.py").write_text(UNSTEADY)
    result = pytester.runpytest_inprocess("--reruns", "1", "-p", "no:cacheprovider")
    assert {kind: result.parseoutcomes().get(kind) for kind in ("failed", "passed", "rerun")} == {
        "failed": 1,
        "passed": 1,
        "rerun": 1,
    }
