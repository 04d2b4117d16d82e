"""The tests that a row names: whether they exist, and which of pytest's tests they are. Three kinds of names:

- `unit/test_x.py::test_y`, below virtual_bus_tests/; without `::` every test of the file;
- `matrix: motor_driver: SIGKILL`: a row of the exit matrix that docs/stop_times.md has a measurement of;
- `virtual robot: driver SIGKILL`: a scenario of `make vm-test`.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from canbase_hazards.catalogue import Catalogue
from exit_matrix.failures import ROWS
from exit_matrix.page_table import NOTHING, Key
from exit_matrix.stop_table import COMMANDS, REAL_RUN, TABLE
from support.marked_page import section
from vm.guest.main import ALL

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "virtual_bus_tests"
MATRIX, VIRTUAL_ROBOT = "matrix: ", "virtual robot: "
STOP_TIMES = ROOT / "docs" / "stop_times.md"


def problem(name: str) -> str:
    """Why this name proves nothing; empty when the test exists."""
    if name.startswith(MATRIX):
        return _matrix_problem(name.removeprefix(MATRIX))
    if name.startswith(VIRTUAL_ROBOT):
        known = name.removeprefix(VIRTUAL_ROBOT) in ALL
        return "" if known else f"{name}: no such scenario in vm/guest/main.py"
    return _pytest_problem(name)


def pytest_names(catalogue: Catalogue) -> frozenset[str]:
    """Files and tests of pytest that some row names, relative to virtual_bus_tests/."""
    named = (name for row in catalogue.rows for name in row.tests)
    return frozenset(name for name in named if not name.startswith((MATRIX, VIRTUAL_ROBOT)))


def is_proof(node_id: str, names: frozenset[str]) -> bool:
    """Whether pytest's test `node_id` is one of `names`, or belongs to a file or a test with parameters of them."""
    path, _, test = node_id.removeprefix("virtual_bus_tests/").partition("::")
    return path in names or f"{path}::{test.partition('[')[0]}" in names


def stops() -> dict[Key, dict[str, str]]:
    """The stops that docs/stop_times.md has now, by what fails and how."""
    return TABLE.rows(section(STOP_TIMES.read_text(encoding="utf-8"), COMMANDS))


def _matrix_problem(name: str) -> str:
    if name not in {row.name for row in ROWS}:
        return f"{MATRIX}{name}: no such row in exit_matrix/failures.py"
    what, how = name.split(": ", 1)
    if stops().get((what, how), {}).get(REAL_RUN, NOTHING) == NOTHING:
        return f"{MATRIX}{name}: docs/stop_times.md has no measurement of it"
    return ""


def _pytest_problem(name: str) -> str:
    path, _, test = name.partition("::")
    if not (TESTS / path).is_file():
        return f"{name}: there is no virtual_bus_tests/{path}"
    tests = _tests_of(path)
    if not test:
        return "" if tests else f"{name}: the file has no test"
    return "" if test in tests else f"{name}: the file has no {test}"


@cache
def _tests_of(path: str) -> frozenset[str]:
    """Names of the test functions of a file, in classes too (Class::test)."""
    tree = ast.parse((TESTS / path).read_text(encoding="utf-8"))
    found = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}::{each.name}" for each in node.body if isinstance(each, ast.FunctionDef)}
    return frozenset(name for name in found if name.rpartition("::")[2].startswith("test"))
