"""The section `action` of robot.yaml: what it refuses, and that it says why."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from canbase_config.action import Action


@pytest.mark.parametrize("policy", ["reject", "queue", "preempt"])
def test_the_policies_that_one_base_allows(policy: str) -> None:
    assert Action.model_validate({"goal_policy": policy}).goal_policy == policy


def test_without_a_word_a_second_goal_is_rejected() -> None:
    assert Action().goal_policy == "reject"


def test_parallel_is_refused_and_the_sentence_says_why() -> None:
    with pytest.raises(ValidationError, match="one base, and two goals would both order its speed"):
        Action.model_validate({"goal_policy": "parallel"})


def test_an_unknown_policy_is_refused() -> None:
    with pytest.raises(ValidationError, match="'reject', 'queue' or 'preempt'"):
        Action.model_validate({"goal_policy": "newest"})


@pytest.mark.parametrize("length", [0, 101, -1, 2.5])
def test_a_queue_is_bounded(length: float) -> None:
    with pytest.raises(ValidationError, match="queue_length"):
        Action.model_validate({"queue_length": length})


def test_nav2_has_its_behaviours_for_itself_by_default() -> None:
    assert not Action().nav2_behaviors


def test_behaviours_of_nav2_are_refused_where_each_client_has_to_send_keepalives() -> None:
    with pytest.raises(ValidationError, match="behaviour trees send no keepalives"):
        Action.model_validate({"nav2_behaviors": True, "require_client_lease": True})


def test_a_spin_is_not_slower_than_a_turn_may_be() -> None:
    with pytest.raises(ValidationError, match=r"spin_speed_radps \(0.05\) must not be below min_speed_radps \(0.1\)"):
        Action.model_validate({"spin_speed_radps": 0.05})
