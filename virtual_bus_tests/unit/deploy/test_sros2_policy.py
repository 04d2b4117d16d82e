"""The SROS2 policy that is shipped: who may write a velocity, read from the file itself."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from xml.etree import ElementTree

import pytest

from canbase_config.load import load_robot, sample
from canbase_config.mux import OUTPUTS

FOLDER = Path(__file__).parents[3] / "deploy" / "sros2"
INCLUDE = "{http://www.w3.org/2001/XInclude}include"
WRITERS = {
    "joystick": {"/canbase/joystick"}, "navigation": {"/canbase/navigation"}, "action": {"/canbase/action_server"},
}  # fmt: skip
"""The page in the browser has no enclave yet."""


@pytest.fixture(scope="module")
def policy() -> ElementTree.Element:
    return ElementTree.parse(FOLDER / "policy.xml").getroot()


def allowed(policy: ElementTree.Element, what: str) -> dict[str, set[str]]:
    """By topic: the enclaves that may `publish` or `subscribe`."""
    found = defaultdict(set)
    for enclave in policy.iter("enclave"):
        for topics in enclave.iter("topics"):
            if topics.get(what) == "ALLOW":
                for topic in topics.iter("topic"):
                    found[str(topic.text)].add(enclave.attrib["path"])
    return found


def test_what_the_chain_orders_is_written_by_mux_and_filter_alone(policy: ElementTree.Element) -> None:
    writers = allowed(policy, "publish")
    assert {topic: writers[topic] for topic in OUTPUTS} == {topic: {"/canbase/velocity"} for topic in OUTPUTS}


def test_each_default_source_has_one_writer_and_is_read_by_mux_and_black_box(policy: ElementTree.Element) -> None:
    writers, readers = allowed(policy, "publish"), allowed(policy, "subscribe")
    for name, source in load_robot(sample("bench")).robot.mux.sources.items():
        assert writers[source.topic] == WRITERS.get(name, set())
        assert readers[source.topic] == {"/canbase/velocity", "/canbase/driver"}


def test_the_mux_reads_whether_the_base_can_move_and_nobody_obeys_what_it_shows(policy: ElementTree.Element) -> None:
    readers = allowed(policy, "subscribe")
    assert "/canbase/velocity" in readers["motor_driver/status"]
    assert readers["cmd_vel_mux"] == set()


def test_no_rule_is_a_wildcard_and_nothing_is_allowed_for_all(policy: ElementTree.Element) -> None:
    assert [expression.text for expression in policy.iter() if "*" in (expression.text or "")] == []


def test_every_profile_has_what_a_node_needs(policy: ElementTree.Element) -> None:
    profiles = list(policy.iter("profile"))
    assert profiles
    for profile in profiles:
        assert [include.get("href") for include in profile.iter(INCLUDE)] == ["common/node.xml"]
    common = ElementTree.parse(FOLDER / "common" / "node.xml").getroot()
    assert {str(topic.text) for topic in common.iter("topic")} == {"/rosout", "/parameter_events", "/clock"}
