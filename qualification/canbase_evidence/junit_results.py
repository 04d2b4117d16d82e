"""The results of tests out of JUnit XML files, as `pytest --junitxml` writes them. Pure: text in, cases out.

A case says little alone: a file of which only one test has run shows one passed test. So the tests of canbase add
properties to their results (virtual_bus_tests/hazards/tested.py): the code that was tested, and how many tests belong
to the file and to the function.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Final
from xml.etree import ElementTree

CODE: Final = "canbase_code"
"""Property: the code that was tested, installed_code.py."""
OF_FILE: Final = "canbase_tests_of_file"
OF_FUNCTION: Final = "canbase_tests_of_function"
_ROOT: Final = "virtual_bus_tests."


class Outcome(Enum):
    """Of one test. The value is what the page shows."""

    PASSED = "passed"
    FAILED = "failed"
    SKIPPED = "skipped"
    """Expected failures as well: they prove nothing."""


class JUnitError(ValueError):
    """The text is no JUnit XML; the message says why."""


@dataclass(frozen=True, slots=True)
class Case:
    """One test that has run. `module`: below virtual_bus_tests, as `unit.chain.test_chain`."""

    module: str
    function: str
    """With its class, as `TestA::test_b`."""
    parameters: str
    outcome: Outcome
    code: str
    """Empty: not known."""
    of_file: int | None
    """Tests in its file; None: not known."""
    of_function: int | None


def read_cases(text: str) -> tuple[Case, ...]:
    """All cases of one file. Raises JUnitError."""
    if re.search(r"<!(DOCTYPE|ENTITY)", text):  # entities can grow without bound
        raise JUnitError("it has a DOCTYPE, which JUnit XML has not")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise JUnitError(f"no XML: {error}") from error
    if root.tag not in ("testsuites", "testsuite"):
        raise JUnitError(f"its root is <{root.tag[:40]}>, expected <testsuites>")
    return tuple(_cases(root))


def _cases(root: ElementTree.Element) -> Iterator[Case]:
    for element in root.iter("testcase"):
        module, classes = _module(element.get("classname", ""))
        name, _, parameters = element.get("name", "").partition("[")
        told = {each.get("name"): each.get("value", "") for each in element.iterfind("properties/property")}
        yield Case(
            module=module,
            function="::".join([*classes, name]),
            parameters=parameters.removesuffix("]"),
            outcome=_outcome(element),
            code=told.get(CODE, ""),
            of_file=_count(told.get(OF_FILE)),
            of_function=_count(told.get(OF_FUNCTION)),
        )


def _module(classname: str) -> tuple[str, list[str]]:
    """The module ends at the part that is named as a file of tests; classes follow."""
    parts = classname.removeprefix(_ROOT).split(".")
    ends = next((at for at, part in enumerate(parts, start=1) if part.startswith("test_")), len(parts))
    return ".".join(parts[:ends]), parts[ends:]


def _outcome(element: ElementTree.Element) -> Outcome:
    if element.find("failure") is not None or element.find("error") is not None:
        return Outcome.FAILED
    return Outcome.PASSED if element.find("skipped") is None else Outcome.SKIPPED


def _count(text: str | None) -> int | None:
    return int(text) if text is not None and re.fullmatch("[0-9]{1,9}", text) else None
