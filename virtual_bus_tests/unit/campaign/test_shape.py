"""What the base does before the faults of a scenario begin."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date, timedelta
from statistics import mean

import pytest

from campaign import nightly, regressions
from campaign.nightly import Night, first_seed
from canbase_campaign.faults import ADDED_LATER
from canbase_campaign.plan import draw_plan
from canbase_campaign.planned import Plan
from canbase_campaign.robots import robot_of
from canbase_campaign.shape import IN_CI, LONG_S

SEEDS = range(IN_CI, IN_CI + 300)


@pytest.fixture(scope="module")
def plans() -> dict[int, tuple[Plan, Plan]]:
    """With what comes before the faults, and without."""
    return {seed: (draw_plan(seed), draw_plan(seed, from_rest=True)) for seed in SEEDS}


def test_the_same_seed_gives_the_same_plan() -> None:
    assert [draw_plan(seed) for seed in range(20)] == [draw_plan(seed) for seed in range(20)]


def test_a_tenth_lasts_30_s_and_more_and_a_tenth_boots(plans: dict[int, tuple[Plan, Plan]]) -> None:
    long = [plan for plan, _ in plans.values() if plan.duration_s > LONG_S[0]]
    assert 0.05 < len(long) / len(plans) < 0.15
    assert all(plan.duration_s < 130.0 for plan in long)
    assert 0.05 < mean(plan.boots for plan, _ in plans.values()) < 0.15


def test_most_faults_begin_after_a_drive(plans: dict[int, tuple[Plan, Plan]]) -> None:
    """From rest all begin within 0.9 s."""
    before = [min(fault.start_s for fault in plan.faults) for _, plan in plans.values()]
    after = [min(fault.start_s for fault in plan.faults) for plan, _ in plans.values() if not plan.boots]
    assert max(before) < 1.0
    assert mean(start_s > 1.0 for start_s in after) > 0.5


def test_hands_drive_up_to_the_limits_and_turn(plans: dict[int, tuple[Plan, Plan]]) -> None:
    shares: list[float] = []
    turns = 0
    for seed, (plan, _) in plans.items():
        limits = robot_of(seed).robot.limits
        first = next(iter(plan.segments), None)
        if first is not None and first.duration_s > 2.5 and first.kind == "constant":
            shares.append(abs(first.linear_mps) / limits.linear_mps)
            turns += bool(first.angular_radps)
    assert max(shares) > 0.95
    assert min(shares) == 0.0, "in place"
    assert 0.2 < turns / len(shares) < 0.8


def test_some_faults_begin_while_a_reset_is_carried_out(plans: dict[int, tuple[Plan, Plan]]) -> None:
    near = [
        plan
        for plan, _ in plans.values()
        if any(abs(fault.start_s - at_s - 0.1) <= 0.3 for fault in plan.faults for at_s in plan.resets_s)
    ]
    assert len(near) > 0.1 * len(plans)


def test_from_rest_a_plan_is_as_in_reports_before(plans: dict[int, tuple[Plan, Plan]]) -> None:
    names = {fault.name for _, plan in plans.values() for fault in plan.faults}
    assert not names & set(ADDED_LATER)
    assert {fault.name for plan, _ in plans.values() for fault in plan.faults} > set(ADDED_LATER)


def test_no_two_nights_share_a_seed_and_each_step_draws_from_its_own() -> None:
    day = date(2026, 12, 1)
    assert first_seed(day + timedelta(days=1)) - first_seed(day) == nightly.SEEDS_A_NIGHT
    assert max(nightly.SCENARIOS, nightly.ROBOTS, nightly.SOAKED) <= nightly.SEEDS_A_NIGHT
    assert Night(100, 0.001).seeds(nightly.SCENARIOS) == range(100, 102)


@pytest.mark.parametrize(("failures", "code"), [(0, 0), (1, 1)])
def test_a_night_prints_its_seeds_and_a_command_for_each_failure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], failures: int, code: int
) -> None:
    step: Callable[[Night], list[str]] = lambda night: [f"held: make campaign SEED={night.first}"] * failures  # noqa: E731
    monkeypatch.setattr(nightly, "STEPS", {"campaign": step})
    assert nightly.main(["--date", "2026-11-27"]) == code
    told = capsys.readouterr().out
    assert "seeds from 1010000 on" in told
    assert told.count("campaign: FAILED: held: make campaign SEED=1010000") == failures


def test_a_scenario_is_repeated_by_one_command() -> None:
    assert regressions.repeats(7) == "make campaign SEED=7"
    assert regressions.repeats(7, ("slip",), True) == "python -m campaign --seed 7 --fault slip --from-rest"
