"""Whether position and velocity contradict each other: sample by sample, times in s. Pure."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from canbase_driver.drives.feedback_factor import ENOUGH_M, FeedbackFactor
from support.chain_world import bench_robot

M_PER_COUNT, CYCLE_S = 7.67e-6, 0.01
Sensor = Callable[[float], float]


def driven(
    factor: float = 1.0,
    sign: int = 1,
    until_m: float = 0.02,
    shown: Sensor = lambda mps: mps,
    dies_m: float = 9.0,
    unit: str = "0.1rpm",
) -> FeedbackFactor:
    """From standstill, with 0.5 m/s²; the encoder counts `factor` times the travel, and no more after `dies_m`."""
    drive = bench_robot().drives[0].model_copy(update={"velocity_unit": unit})
    follows = FeedbackFactor(drive, M_PER_COUNT)
    travel_m, counted_m, now_s = 0.0, 0.0, 50.0
    while travel_m < until_m:
        mps = 0.5 * (now_s - 50.0)
        follows.on_sample(round(counted_m / M_PER_COUNT), sign * shown(mps), now_s)
        now_s += CYCLE_S
        step_m = (mps + 0.25 * CYCLE_S) * CYCLE_S
        travel_m += step_m
        counted_m += factor * step_m if travel_m < dies_m else 0.0
    return follows


@pytest.mark.parametrize(
    ("factor", "said"),
    [(0.05, "0.05 times"), (0.5, "0.5 times"), (2.0, "2 times"), (4.0, "4 times"), (100.0, "100 times")],
)
def test_a_factor_is_told_with_the_keys(factor: float, said: str) -> None:
    sentence = driven(factor).sentence
    assert sentence.startswith(f"6064h counts {said} as far as 606Ch shows: check `counts_per_motor_rev` (by the ")
    assert f"about {4096 * factor:.2g}".split("e")[0][:7] in sentence
    assert "and `velocity_unit` in robot.yaml, and 608Fh to 6096h in the drive" in sentence


def test_where_the_velocity_is_in_increments_their_number_cures_nothing() -> None:
    sentence = driven(0.5, unit="counts/s").sentence
    assert "`velocity_unit`" in sentence
    assert "counts_per_motor_rev" not in sentence


def test_a_few_increments_may_be_those_of_a_dead_encoder() -> None:
    assert driven(0.01, until_m=0.002).sentence.endswith("of its drive profile, or its encoder is dead")


def test_a_velocity_that_stays_zero_while_the_encoder_counts_is_told() -> None:
    assert driven(shown=lambda _mps: 0.0).sentence == "606Ch stays 0 while 6064h counts"
    assert driven(shown=lambda _mps: 0.0, until_m=0.004).sentence == ""


def test_a_velocity_of_the_other_sign_is_told_with_the_object() -> None:
    assert driven(sign=-1).sentence.startswith("606Ch counts against 6064h: one of them is reversed. Set 607Eh")


@pytest.mark.parametrize(
    "follows",
    [
        driven(),
        driven(1.15),
        driven(0.5, until_m=0.0005),
        driven(0.0),
        driven(dies_m=0.005),
        driven(dies_m=0.01, until_m=0.1),
        driven(shown=lambda mps: 0.05),
        driven(shown=lambda mps: 0.2 - mps),
        driven(0.5, until_m=ENOUGH_M + 0.1),
    ],
    ids=["fits", "nearly", "too little", "dead", "dies", "dies later", "stuck", "otherwise", "had its time"],
)
def test_what_is_right_or_cannot_be_told_says_nothing(follows: FeedbackFactor) -> None:
    assert follows.sentence == ""


def test_after_a_boot_it_begins_anew() -> None:
    follows = driven(0.5)
    follows.forget()
    assert follows.sentence == ""
