"""Where remap rules leave an action whole, and where they would tear it apart."""

from __future__ import annotations

import pytest

from canbase_action_server.action_name import SERVICES, TOPICS, Resolve, TornActionError, action_name

PARTS = (*SERVICES, *TOPICS)


def resolver(rules: dict[str, str]) -> Resolve:
    """As ROS: the whole name in the namespace /, then the first rule for it, once."""

    def resolve(name: str) -> str:
        whole = name if name.startswith("/") else f"/{name}"
        return rules.get(whole, whole)

    return resolve


def name_with(rules: dict[str, str]) -> str:
    """The name of `go` under rules for topics and services."""
    return action_name("go", resolver(rules), resolver(rules))


def parts_to(other: str, parts: tuple[str, ...] = PARTS) -> dict[str, str]:
    """Rules that rename hidden names."""
    return {f"/go/_action/{part}": f"{other}/_action/{part}" for part in parts}


def test_without_rules_an_action_has_its_own_name() -> None:
    assert name_with({}) == "/go"
    assert name_with({"/stop": "/halt", "/go/keepalive": "/alive"}) == "/go"


def test_a_rule_for_the_action_renames_it() -> None:
    assert name_with({"/go": "/robot1/run"}) == "/robot1/run"


def test_rules_for_all_five_parts_rename_it_too() -> None:
    assert name_with(parts_to("/robot1/run")) == "/robot1/run"
    assert name_with({"/go": "/run", **{f"/run/_action/{part}": f"/far/_action/{part}" for part in PARTS}}) == "/far"


@pytest.mark.parametrize("part", PARTS)
def test_a_rule_for_one_part_is_refused_and_the_message_has_the_part_and_the_cure(part: str) -> None:
    with pytest.raises(TornActionError, match="-r go:=NAME") as told:
        name_with(parts_to("/run", (part,)))
    assert f"/go/_action/{part} to /run/_action/{part}" in str(told.value)


@pytest.mark.parametrize("part", PARTS)
def test_four_rules_of_five_are_refused(part: str) -> None:
    with pytest.raises(TornActionError):
        name_with(parts_to("/run", tuple(each for each in PARTS if each != part)))


def test_a_part_that_gets_a_name_of_another_form_is_refused() -> None:
    with pytest.raises(TornActionError):
        name_with({f"/go/_action/{part}": f"/{part}" for part in PARTS})
    with pytest.raises(TornActionError):
        name_with({"/go/_action/status": "/go/_action/feedback", "/go/_action/feedback": "/go/_action/status"})


def test_rules_that_lead_to_a_name_that_has_rules_itself_are_refused() -> None:
    with pytest.raises(TornActionError):
        name_with(parts_to("/run") | {"/run/_action/status": "/elsewhere"})


def test_a_rule_for_topics_or_for_services_alone_is_refused() -> None:
    with pytest.raises(TornActionError, match="one rule for both"):
        action_name("go", resolver({"/go": "/run"}), resolver({}))
    with pytest.raises(TornActionError, match="one rule for both"):
        action_name("go", resolver({}), resolver({"/go": "/run"}))
