"""Much torque and no speed, sample by sample: what counts as a stall, and for how long. Pure, times in s."""

from __future__ import annotations

import pytest

from canbase_driver.drives.stall import STALL_PART, Stall, StallLimits
from support.chain_world import bench_robot

CYCLE_S = 0.01
LIMITS = StallLimits(torque_share=0.8, time_s=0.2, standstill_mps=0.005)


class Story:
    """One axis, a sample each 10 ms; what is not given is that of a wheel that stalls."""

    def __init__(self, limits: StallLimits = LIMITS) -> None:
        self.stall = Stall(limits)
        self.now_s = 50.0
        self.samples(1)

    def samples(
        self,
        count: int,
        speed: float = 0.0,
        share: float | None = 1.0,
        ordered: float = 0.3,
        *,
        moves: bool = False,
        gap_s: float = CYCLE_S,
    ) -> bool:
        for _ in range(count):
            self.now_s += gap_s
            self.stall.on_sample(speed, share, ordered, moves=moves, now_s=self.now_s)
        return self.stall.is_over


def test_it_is_over_after_its_time_and_not_a_cycle_sooner() -> None:
    story = Story()
    assert not story.samples(19)
    assert story.samples(2)


@pytest.mark.parametrize(("share", "over"), [(0.8, True), (-0.8, True), (0.799, False), (-0.799, False), (3.0, True)])
def test_torque_counts_from_its_limit_on_in_either_direction(share: float, over: bool) -> None:
    assert Story().samples(30, share=share) is over


@pytest.mark.parametrize(("speed", "over"), [(0.005, True), (-0.005, True), (0.0051, False), (-0.0051, False)])
def test_a_wheel_that_is_faster_than_standstill_does_not_stall(speed: float, over: bool) -> None:
    assert Story().samples(30, speed=speed) is over


@pytest.mark.parametrize(("ordered", "over"), [(0.01, True), (-0.01, True), (0.0099, False), (0.0, False)])
def test_an_order_near_zero_is_none_as_a_wheel_that_is_held_on_a_slope_has_torque(ordered: float, over: bool) -> None:
    assert Story().samples(30, ordered=ordered) is over


def test_unknown_torque_is_no_evidence() -> None:
    assert not Story().samples(100, share=None)


def test_a_sign_of_life_begins_the_time_anew() -> None:
    story = Story()
    story.samples(19)
    story.samples(1, moves=True)
    assert story.stall.time_s == 0.0
    assert not story.samples(19)


def test_a_bad_sample_takes_off_what_it_lasts_and_hides_nothing() -> None:
    story = Story()
    for _ in range(3):
        assert not story.samples(5)
        story.samples(1, speed=0.02)
    assert story.stall.time_s == pytest.approx(0.12)
    assert story.samples(9)


def test_time_never_falls_below_nothing() -> None:
    story = Story()
    story.samples(100, speed=0.3)
    assert story.stall.time_s == 0.0


def test_it_lasts_no_longer_than_its_limit_so_that_it_ends_as_soon_as_it_may() -> None:
    story = Story()
    story.samples(1000)
    assert story.stall.time_s == LIMITS.time_s
    assert not story.samples(1, share=0.0)


def test_a_gap_in_the_feedback_counts_for_a_tenth_of_a_second_at_most() -> None:
    story = Story()
    assert not story.samples(1, gap_s=5.0)
    assert story.stall.time_s == pytest.approx(0.1)


def test_the_sentence_has_values_limits_and_keys() -> None:
    story = Story()
    story.samples(30, share=-0.953, ordered=-0.2)
    assert story.stall.sentence == (
        "stalls: -95% of the rated torque for 0.20 s at 0.000 m/s, ordered -0.200 m/s (health.stall_torque_share 0.8, "
        "health.stall_time_s 0.2 s): is the wheel blocked, the load too heavy, its encoder dead?"
    )


def test_without_a_time_of_its_own_it_is_named_before_the_watchdog_misses_the_motion() -> None:
    robot = bench_robot()
    assert StallLimits.of(robot) == StallLimits(0.8, STALL_PART * robot.watchdog.motion_missing_s, 0.005)
    assert StallLimits.of(robot).time_s == pytest.approx(0.22)
    given = robot.model_copy(update={"health": robot.health.model_copy(update={"stall_time_s": 0.5})})
    assert StallLimits.of(given).time_s == 0.5
