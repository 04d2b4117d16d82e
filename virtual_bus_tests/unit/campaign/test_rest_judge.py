"""Creeping at zero order, and what a joystick may after a pause: at the limits. One step of the judge is 0.01 s."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from canbase_campaign.allowance import Active, Allowance
from canbase_campaign.excuses import STEP_S, Ledger
from canbase_campaign.pause_judge import LATE_S, SCANS_S, PauseJudge
from canbase_campaign.rest_judge import REST_MPS, RestJudge
from canbase_campaign.robots import DrawnRobot, campaign_robot
from canbase_campaign.wishes import Wishes
from canbase_sim.plant.base import PlantParameters
from canbase_velocity.twist import ZERO, Twist

FORWARD, ZERO_AT = Twist(0.4, 0.0), 1.0


def stub() -> Any:
    """A world of which these judges see a robot, a clock and the velocity process."""
    drawn = DrawnRobot(0, campaign_robot(), PlantParameters())
    return SimpleNamespace(
        robot=drawn.robot, drawn=drawn, clock=SimpleNamespace(now_s=0.0), velocity=SimpleNamespace(running=True)
    )


def creeping(speeds_mps: list[float], *, stands: bool = True, gives: dict[str, float] | None = None) -> list[str]:
    """What a wheel of these speeds, one a step, is told after an order of motion at t = 0 and zero from then on."""
    shown: Any = SimpleNamespace(fastest_mps=0.0)
    ledger = Ledger()
    judge = RestJudge(stub(), shown, ledger)
    judge.order(False, 0.0)
    told = []
    for step, speed_mps in enumerate(speeds_mps):
        now_s = ZERO_AT + step * STEP_S
        shown.fastest_mps = speed_mps
        ledger.step(True, now_s)
        judge.order(True, now_s)
        told.append(judge.step(now_s, stands, gives or {}))
    return told


def longest() -> int:
    """Steps that a wheel may creep."""
    return round(RestJudge(stub(), SimpleNamespace(), Ledger()).allowed_s / STEP_S)  # type: ignore[arg-type]


def test_a_wheel_may_creep_for_the_stated_time_and_no_longer() -> None:
    told = creeping([0.03] * (longest() + 3))
    assert not any(told[: longest() - 1])
    assert "0.030 m/s" in told[-1]
    assert 0.9 < longest() * STEP_S < 1.4


@pytest.mark.parametrize(("speed_mps", "found"), [(REST_MPS, False), (REST_MPS + 1e-6, True)])
def test_what_is_slower_than_a_centimetre_a_second_is_at_rest(speed_mps: float, found: bool) -> None:
    assert any(creeping([speed_mps] * 300)) is found


def test_pauses_between_do_not_begin_it_anew() -> None:
    assert any(creeping([0.03 if step % 20 < 10 else 0.0 for step in range(400)]))


def test_an_order_of_motion_does_and_what_is_faster_is_not_its_matter() -> None:
    assert not any(creeping([0.03] * 300, stands=False))
    shown: Any = SimpleNamespace(fastest_mps=0.03)
    judge = RestJudge(stub(), shown, Ledger())
    for step in range(300):
        judge.order(step % 50 != 0, step * STEP_S)
        assert judge.step(step * STEP_S, True, {}) == ""


@pytest.mark.parametrize(("gives_s", "found"), [(0.0, True), (1.0, True), (3.0, False), (math.inf, False)])
def test_an_excuse_gives_its_seconds(gives_s: float, found: bool) -> None:
    assert any(creeping([0.03] * 350, gives={"pushed": gives_s})) is found


def pauses(world: Any, ledger: Ledger) -> PauseJudge:
    return PauseJudge(world, Allowance("pauses", ledger, 0.3, 0.0, 0.2))


def first_problem(*, locked_until: float = 0.0, scans_from: float = 0.0, topic: str = "cmd_vel_joy") -> float:
    """The source orders motion from t = 0 on, the base moves from t = 3 on: when is that a violation? inf: never."""
    world, ledger = stub(), Ledger()
    judge = pauses(world, ledger)
    for step in range(500):
        now_s = step * STEP_S
        ledger.step(now_s >= 3.0, now_s)
        if now_s >= scans_from:
            judge.on_scan(now_s)
        judge.take(topic, FORWARD, now_s)
        judge.arrive(topic, FORWARD, now_s)
        tau_s = 0.3 if now_s >= 3.0 else 0.0
        if judge.step(tau_s, now_s, locked=now_s < locked_until, active=Active()):
            return now_s
    return math.inf


def test_a_joystick_that_is_held_over_a_lock_moves_nothing() -> None:
    assert first_problem() == math.inf
    assert 3.2 < first_problem(locked_until=0.5) < 3.5


def test_a_program_goes_on_after_a_pause() -> None:
    assert first_problem(locked_until=0.5, topic="cmd_vel_nav") == math.inf


@pytest.mark.parametrize(("more_s", "found"), [(-0.02, False), (0.02, True)])
def test_scans_that_are_missing_for_a_second_count_as_a_pause(more_s: float, found: bool) -> None:
    from_s = campaign_robot().safety.scan.timeout_s + SCANS_S + LATE_S + more_s
    assert (first_problem(scans_from=from_s) < math.inf) is found


def test_after_its_zero_the_joystick_counts_again() -> None:
    wishes = Wishes(campaign_robot(), 0.0)
    for twist, at, counts in ((FORWARD, 0.1, False), (ZERO, 0.2, False), (FORWARD, 0.3, True)):
        wishes.take("cmd_vel_joy", twist, at)
        wishes.arrive("cmd_vel_joy", twist, at)
        if at == 0.1:
            wishes.on_pause(at)
        assert (wishes.greatest_s(at) > 0.0) is counts


def test_one_that_publishes_nothing_during_a_pause_has_to_show_zero_too() -> None:
    wishes = Wishes(campaign_robot(), 0.0)
    wishes.on_pause(5.0)
    wishes.take("cmd_vel_joy", FORWARD, 6.0)
    wishes.arrive("cmd_vel_joy", FORWARD, 6.0)
    assert wishes.greatest_s(6.0) == 0.0
