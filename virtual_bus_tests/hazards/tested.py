"""Hook of pytest: in JUnit XML each test states which code it has tested, and how many tests its file has.

`canbase prove evidence` reads that: a passed test proves a row of hazards.yaml for the code that was tested alone,
and a file of tests only when all of them have run.
"""

from __future__ import annotations

from collections import Counter

import pytest

from canbase_evidence.installed_code import code_sha256
from canbase_evidence.junit_results import CODE, OF_FILE, OF_FUNCTION


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Before -k, -m and others leave tests out. Tests that were named singly know nothing of their neighbours."""
    if not config.getoption("xmlpath"):
        return
    named = "".join(config.args)
    functions = Counter(_function(item) for item in items)
    files = Counter(_file(item) for item in items)
    for item in items:
        item.user_properties.append((CODE, code_sha256()))
        if "::" not in named:
            item.user_properties.append((OF_FILE, str(files[_file(item)])))
        if "[" not in named:
            item.user_properties.append((OF_FUNCTION, str(functions[_function(item)])))


def _file(item: pytest.Item) -> str:
    return item.nodeid.partition("::")[0]


def _function(item: pytest.Item) -> str:
    return item.nodeid.partition("[")[0]
