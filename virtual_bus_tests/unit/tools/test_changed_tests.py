"""Which unit tests `make quick` takes: those that import what has changed, and those that have changed themselves."""

from __future__ import annotations

import pytest

from changed_tests import concerned, module_of

TESTS = {
    "virtual_bus_tests/unit/driver/test_release_test.py": "from canbase_driver.drives.let_go import LetGo\n",
    "virtual_bus_tests/unit/driver/test_boot.py": "import pytest\n\nfrom canbase_driver.drives import let_go, axis\n",
    "virtual_bus_tests/unit/driver/test_other.py": "from canbase_driver.drives.let_gone import Other\n# let_go\n",
    "virtual_bus_tests/unit/chain/test_stops.py": "from support.chain_world import World\n",
}


@pytest.mark.parametrize(
    ("path", "module"),
    [
        ("driver/canbase_driver/drives/let_go.py", "canbase_driver.drives.let_go"),
        ("driver/canbase_driver/__init__.py", "canbase_driver"),
        ("virtual_bus_tests/support/chain_world.py", "support.chain_world"),
        ("virtual_bus_tests/canbase_sim/axis.py", "canbase_sim.axis"),
        ("virtual_bus_tests/unit/driver/test_release_test.py", ""),
        ("docs/bus.md", ""),
        ("setup.py", ""),
    ],
)
def test_a_file_has_the_name_by_which_tests_import_it(path: str, module: str) -> None:
    assert module_of(path) == module


def test_a_changed_module_takes_the_tests_that_import_it_and_no_others() -> None:
    taken = concerned(["driver/canbase_driver/drives/let_go.py", "docs/bus.md"], TESTS)
    assert taken == ["virtual_bus_tests/unit/driver/test_boot.py", "virtual_bus_tests/unit/driver/test_release_test.py"]


def test_a_changed_test_and_a_changed_helper_count_too() -> None:
    changed = ["virtual_bus_tests/unit/driver/test_other.py", "virtual_bus_tests/support/chain_world.py"]
    taken = concerned(changed, TESTS)
    assert taken == ["virtual_bus_tests/unit/chain/test_stops.py", "virtual_bus_tests/unit/driver/test_other.py"]


def test_without_a_change_there_is_nothing_to_run() -> None:
    assert concerned([], TESTS) == []
