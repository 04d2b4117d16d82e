"""The results of the scenarios as JUnit XML, for `canbase evidence --tests`."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from canbase_evidence.hazard_results import VIRTUAL_ROBOT_MODULE
from canbase_evidence.junit_results import CODE, OF_FUNCTION
from vm.table import Result


def junit(found: Sequence[Result], code: str) -> str:
    """`code`: that of canbase in the guest (canbase_evidence.installed_code)."""
    failed = sum(bool(result["failure"]) for result in found)
    suites = ElementTree.Element("testsuites")
    numbers = {"tests": str(len(found)), "failures": str(failed)}
    suite = ElementTree.SubElement(suites, "testsuite", {"name": "virtual robot", **numbers})
    for result in found:
        name, took_s = str(result["name"]), f"{result['took_s']:.3f}"
        case = ElementTree.SubElement(suite, "testcase", classname=VIRTUAL_ROBOT_MODULE, name=name, time=took_s)
        told = ElementTree.SubElement(case, "properties")
        for key, value in ((CODE, code), (OF_FUNCTION, "1")):
            ElementTree.SubElement(told, "property", name=key, value=value)
        if result["failure"]:
            ElementTree.SubElement(case, "failure", message=str(result["failure"]))
    return ElementTree.tostring(suites, encoding="unicode")
