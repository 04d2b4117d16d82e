"""How hard a drive pushes at a wheel that shows no motion, as the watchdog measures it. Times in s, 10 ms a sample."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_watchdog.torque_evidence import TorqueEvidence, TorqueWatch
from support.watchdog_story import config

CYCLE_S = 0.01
CONFIG = replace(config(), stand_impulse_s=0.05, stand_answer_s=0.2, motion_missing_s=0.25)
DRIVE = CONFIG.drives[0]
"""0.1 mm for one count: a sign of life is ten of them."""


class Bus:
    """One drive and its watch; the encoder shows `counts`."""

    def __init__(self, proof: bool = True) -> None:
        self.watch = TorqueWatch(DRIVE, replace(CONFIG, stand_proof=proof))
        self.cycle, self.counts = 0, 1000

    def run(
        self,
        cycles: int,
        share: float | None,
        setpoint: float = 0.0,
        rests: bool = True,
        powered: bool = True,
        step: int = 0,
    ) -> TorqueEvidence:
        for _ in range(cycles):
            self.cycle += 1
            self.counts += step
            self.watch.on_sync(setpoint, rests and setpoint == 0.0)
            self.watch.on_position(self.counts)
            self.watch.on_sample(share, powered, self.cycle * CYCLE_S)
        return self.watch.last

    def moved(self) -> Bus:
        """Ordered, and seen to move with a tenth of its torque."""
        self.run(5, 0.1, 0.2, step=10)
        return self


@pytest.mark.parametrize(("share", "cycles"), [(1.0, 25), (-1.0, 25), (0.5, 30), (0.1, 70), (None, 25), (0.25, 40)])
def test_power_at_a_stand_trips_after_impulse_and_answer(share: float | None, cycles: int) -> None:
    """0.05 s at rated torque, then 0.2 s. Whoever does not tell gives the rated one, as far as anybody knows."""
    bus = Bus()
    bus.run(2, share, 0.2, step=10)
    bus.run(cycles - 2, share)
    assert not bus.watch.overdue
    bus.run(3, share)
    assert (bus.watch.overdue, bus.watch.contradicts_encoder) == (True, True)


def test_a_torque_that_was_never_told_but_as_zero_is_not_known() -> None:
    bus = Bus()
    bus.run(2, 0.0, 0.2, step=10)
    assert bus.run(20, 0.0).share is None
    bus.run(10, 0.0)
    assert bus.watch.overdue


def test_a_torque_that_is_known_may_be_less_than_moves_a_wheel() -> None:
    bus = Bus().moved()
    bus.run(1, 0.0)
    last = bus.run(500, 0.0099)
    assert (last.share, last.release_due, last.overdue_s) == (0.0099, True, 0.0)
    assert last.pushed_s < 0.01


@pytest.mark.parametrize("change", [{"rests": False}, {"powered": False}, {"step": 10}, {"setpoint": 0.01}])
def test_what_is_no_stand_with_power_is_never_overdue(change: dict[str, float]) -> None:
    bus = Bus().moved()
    assert bus.run(100, 0.4, **change).overdue_s == 0.0  # type: ignore[arg-type]
    assert not bus.watch.overdue


def test_it_is_over_with_the_first_sample_without_power_and_owed_again_by_the_next_order() -> None:
    bus = Bus().moved()
    assert bus.run(10, 1.0).overdue_s > 0.0
    off = bus.run(1, 1.0, powered=False)
    assert (off.pushed_s, off.release_due, off.overdue_s) == (0.0, False, 0.0)
    assert off.vain_s == pytest.approx(0.09)
    assert bus.run(100, 0.5).overdue_s == 0.0
    bus.run(1, 1.0, 0.001)
    assert bus.run(1, 1.0).overdue_s > 0.0


def test_a_robot_that_needs_no_proof_is_not_overdue() -> None:
    bus = Bus(proof=False)
    bus.run(2, None, 0.2, step=10)
    assert bus.run(500, None).overdue_s == 0.0


def test_time_begins_anew_when_it_rests_anew() -> None:
    bus = Bus().moved()
    bus.run(15, 1.0)
    bus.run(1, 1.0, 0.1)
    assert bus.run(15, 1.0).overdue_s == pytest.approx(0.15)


@pytest.mark.parametrize(("share", "counts"), [(0.59, False), (0.61, True), (-0.49, False), (-0.51, True)])
def test_pushed_in_vain_is_a_torque_far_from_the_one_at_the_last_sign_of_life(share: float, counts: bool) -> None:
    """That was a tenth of the rated one: 0.51 beside it takes 0.25 s / 0.51."""
    bus = Bus().moved()
    bus.run(49, share, 0.01)
    assert not bus.watch.in_vain
    bus.run(1, share, 0.01)
    assert (bus.watch.in_vain, bus.watch.contradicts_encoder) == (counts, counts)


@pytest.mark.parametrize(("share", "samples"), [(1.1, 25), (3.0, 25), (-3.0, 25), (-0.9, 28), (-0.61, 41)])
@pytest.mark.parametrize(("setpoint", "slow"), [(0.001, True), (0.01, True), (1.5, False)])
def test_of_a_slow_order_it_is_time_at_rated_torque_or_longer_at_less(
    share: float, samples: int, setpoint: float, slow: bool
) -> None:
    """As long as no 10 mm, watchdog.motion_missing_m, were ordered."""
    bus = Bus().moved()
    expected = samples if slow else 25
    bus.run(expected - 1, share, setpoint)
    assert not bus.watch.in_vain
    bus.run(1, share, setpoint)
    assert bus.watch.in_vain


def test_after_it_has_let_go_each_moment_counts() -> None:
    bus = Bus().moved()
    bus.run(1, 0.0, powered=False)
    assert bus.run(10, 0.61, 0.001).vain_s == pytest.approx(0.1)
    bus.run(1, 0.0, step=10)
    assert bus.run(10, 0.61, 0.001).vain_s == pytest.approx(0.061)


@pytest.mark.parametrize(
    ("share", "counts"), [(-0.64, False), (-0.66, True), (0.64, False), (1.09, False), (1.11, True)]
)
def test_friction_takes_as_much_one_way_as_the_other(share: float, counts: bool) -> None:
    """0.6 of the rated torque at the last sign of life."""
    bus = Bus()
    bus.run(2, 0.6, 0.2, step=10)
    bus.run(60, share, 0.1)
    assert (bus.watch.last.vain_s > 0.0) == counts


@pytest.mark.parametrize(("share", "counts"), [(0.79, False), (0.81, True), (-0.49, False), (-0.51, True)])
def test_what_held_a_wheel_before_it_was_ordered_to_move_is_a_hill(share: float, counts: bool) -> None:
    """0.3 of the rated torque since it let go: 0.5 more is too much, and down the hill half of the rated one."""
    bus = Bus().moved()
    bus.run(1, 0.0, powered=False)
    bus.run(20, 0.3)
    assert (bus.run(20, share, 0.005).vain_s > 0.0) is counts


def test_pushed_in_vain_adds_up_over_orders_until_the_encoder_moves() -> None:
    bus = Bus().moved()
    for _ in range(4):
        bus.run(5, 0.9, 0.1)
        bus.run(50, 0.1)
    assert bus.run(1, 0.1).vain_s == pytest.approx(0.182)
    assert bus.run(1, 0.9, 0.1, step=9).vain_s == pytest.approx(0.192)
    assert bus.run(1, 0.9, 0.1, step=1).vain_s == 0.0


def test_most_of_it_outlives_the_power() -> None:
    bus = Bus().moved()
    bus.run(31, 0.9, 0.1)
    assert bus.run(1, 0.0, powered=False).vain_s == pytest.approx(0.25 * 0.875)
    assert bus.run(1, 0.0, powered=False, step=10).vain_s == 0.0


def test_after_a_time_without_power_the_usual_torque_is_none() -> None:
    bus = Bus().moved()
    bus.run(1, 0.0, powered=False)
    assert bus.run(1, 0.55, 0.1).vain_s == pytest.approx(0.01)


def test_without_an_order_or_a_torque_nothing_is_in_vain() -> None:
    bus = Bus()
    assert bus.run(100, 0.9).vain_s == 0.0
    other = Bus()
    other.run(2, None, 0.2, step=10)
    assert other.run(100, None, 0.1).vain_s == 0.0


def test_a_torque_that_changes_unasked_has_to_be_released_and_is_a_dead_sensor_the_next_time() -> None:
    """Half of the rated torque for 0.1 s, then 0.2 s; after a release without a count at once."""
    bus = Bus()
    bus.run(20, 0.2)
    assert bus.run(11, 0.71).overdue_s == pytest.approx(0.02)
    assert bus.run(18, 0.71).overdue_s == pytest.approx(0.2)
    bus.run(1, 0.0, powered=False)
    assert not bus.watch.overdue
    bus.run(20, 0.2)
    assert bus.run(4, 0.71).overdue_s == 0.0
    assert bus.run(1, 0.71).overdue_s == CONFIG.stand_answer_s
    assert bus.watch.contradicts_encoder


@pytest.mark.parametrize("change", [{"rests": False}, {"setpoint": 0.01}])
def test_only_with_nothing_ordered_of_any_wheel_it_is_unasked(change: dict[str, float]) -> None:
    bus = Bus()
    bus.run(20, 0.2)
    assert bus.run(200, 0.7, **change).overdue_s == 0.0  # type: ignore[arg-type]


def test_a_robot_that_needs_no_proof_may_change_its_torque() -> None:
    bus = Bus(proof=False)
    bus.run(20, 0.2)
    assert bus.run(500, 0.9).overdue_s == 0.0


def test_a_reset_begins_anew() -> None:
    bus = Bus().moved()
    bus.run(30, 1.0, 0.1)
    bus.watch.trust()
    assert bus.watch.last == TorqueEvidence()
    assert not bus.watch.contradicts_encoder


def test_a_gap_counts_as_a_tenth_of_a_second_and_a_time_that_went_back_as_nothing() -> None:
    watch = TorqueWatch(DRIVE, CONFIG)
    watch.on_sync(0.1, False)
    for at in (0.0, 60.0, 59.0):
        watch.on_sample(0.4, True, at)
    assert watch.last.pushed_s == pytest.approx(0.04)


def test_an_encoder_that_wraps_has_moved_a_little() -> None:
    bus = Bus()
    bus.counts = 2**31 - 1
    bus.run(2, 0.4, 0.1)
    bus.counts = -(2**31) + 8
    assert bus.run(1, 0.4, 0.1).pushed_s == pytest.approx(0.008)
    bus.counts += 1
    assert bus.run(1, 0.4, 0.1).pushed_s == 0.0
