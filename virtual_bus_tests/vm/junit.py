"""The results of the scenarios as JUnit XML, for `canbase prove evidence --tests`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

from canbase_evidence.hazard_results import VIRTUAL_ROBOT_MODULE
from canbase_evidence.junit_results import CODE, OF_FUNCTION
from vm.table import Result


def junit(found: Sequence[Result], code: str, skipped: Mapping[str, str]) -> str:
    """`code`: that of canbase in the guest (canbase_evidence.installed_code); `skipped`: scenarios with the reason."""
    failed = sum(bool(result["failure"]) for result in found)
    suites = ElementTree.Element("testsuites")
    numbers = {"tests": str(len(found) + len(skipped)), "failures": str(failed), "skipped": str(len(skipped))}
    suite = ElementTree.SubElement(suites, "testsuite", {"name": "virtual robot", **numbers})
    for result in found:
        case = _case(suite, str(result["name"]), float(result["took_s"]), code)
        if result["failure"]:
            ElementTree.SubElement(case, "failure", message=str(result["failure"]))
    for name, why in skipped.items():
        ElementTree.SubElement(_case(suite, name, 0.0, code), "skipped", message=why)
    return ElementTree.tostring(suites, encoding="unicode")


def _case(suite: ElementTree.Element, name: str, took_s: float, code: str) -> ElementTree.Element:
    case = ElementTree.SubElement(suite, "testcase", classname=VIRTUAL_ROBOT_MODULE, name=name, time=f"{took_s:.3f}")
    told = ElementTree.SubElement(case, "properties")
    for key, value in ((CODE, code), (OF_FUNCTION, "1")):
        ElementTree.SubElement(told, "property", name=key, value=value)
    return case
