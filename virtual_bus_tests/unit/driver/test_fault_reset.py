"""A reset on its way: what refuses it, what breaks it off, and how long each level of the fault reset bit lasts."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from canbase_driver.supervision.fault_reset import FAULT_TRIES, RequestOutcome, Reset, ResetPhase, refusal
from canbase_driver.supervision.situation import Situation
from canbase_driver.supervision.watchdog_link import ANSWERS
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView

WELL = Situation()
TRIPPED = Situation(watchdog=WatchdogView.TRIPPED, watchdog_detail="lease lost")
MISSING = Situation(watchdog=WatchdogView.MISSING, watchdog_detail="no frame for 0.40 s")
FAULT = Situation(fault="left: over-current")
DONE, CAUSE_STANDS, VELOCITY_ORDERED, NOT_TRIPPED = 1, 2, 3, 4


class Story:
    """One reset from second 10 on, stepped every `cycle_s`."""

    def __init__(self, cycle_s: float = 0.01) -> None:
        self.cycle_s = cycle_s
        self.now_s = 10.0
        self.reset = Reset(self.now_s, cycle_s, boot_s=10.0)
        self.phases: list[tuple[float, ResetPhase]] = []

    def run(self, situation: Situation, seconds: float, answer: int | None = NOT_TRIPPED) -> RequestOutcome | None:
        """Step until it ends, or for so long."""
        for _ in range(round(seconds / self.cycle_s)):
            self.now_s += self.cycle_s
            outcome = self.reset.step(situation, answer, self.now_s)
            self.phases.append((round(self.now_s - 10.0, 3), self.reset.phase))
            if outcome is not None:
                return outcome
        return None

    def lasted(self, phase: ResetPhase) -> float:
        """How long it stayed in a phase [s]."""
        return round(self.cycle_s * sum(each is phase for _, each in self.phases), 3)


def in_phase(phase: ResetPhase) -> Story:
    """A reset that has got so far."""
    story = Story()
    for situation, seconds, answer in (
        (WELL, 0.02, None),
        (FAULT, 0.01, DONE),
        (FAULT, 0.01, DONE),
        (FAULT, 1.0, DONE),
    ):
        for _ in range(round(seconds / 0.01)):
            if story.reset.phase is phase:
                return story
            assert story.run(situation, 0.01, answer) is None
    raise AssertionError(story.reset.phase)


def sentence(outcome: RequestOutcome | None) -> str:
    """The sentence of a reset that has failed."""
    assert outcome is not None
    assert not outcome.done
    return outcome.sentence


@pytest.mark.parametrize(
    ("situation", "why"),
    [
        (Situation(commanded="cmd_vel orders 0.3 m/s"), "cmd_vel orders 0.3 m/s; release the joystick"),
        (Situation(standstill=False), "a wheel turns; reset again at standstill"),
        (
            Situation(standstill=False, turning="left is not believed (8 s left)", doubted="left is not believed"),
            "left is not believed (8 s left); then reset again",
        ),
        (Situation(bus="bus-off"), "bus-off"),
        (MISSING, "watchdog: no frame for 0.40 s"),
        (Situation(resetting=True), "a reset is under way"),
        (Situation(shutdown_requested=True), "motor_driver is shutting down"),
    ],
)
def test_it_may_not_even_begin_while(situation: Situation, why: str) -> None:
    refused = refusal(situation, DriverState.LATCHED)
    assert refused is not None
    assert refused.startswith(f"refused: {why}")


@pytest.mark.parametrize(
    "situation",
    [
        WELL,
        TRIPPED,
        FAULT,
        Situation(stop_requested=True),
        # whether these wheels turn is not known: they are waited for
        Situation(standstill=False, silent="node 1: no status"),
        Situation(standstill=False, absent="node 1 restarted"),
        Situation(standstill=False, booting="waiting for node 1"),
    ],
)
def test_it_may_begin_with(situation: Situation) -> None:
    assert refusal(situation, DriverState.LATCHED) is None


def test_it_may_not_begin_while_there_is_power() -> None:
    assert refusal(WELL, DriverState.STOPPING) == "refused: a stop is under way; reset again when it has ended"
    for state in (DriverState.ENABLING, DriverState.ENABLED):
        assert refusal(WELL, state) == ("refused: an enabled robot needs no reset. `canbase stop` takes the power off")


@pytest.mark.parametrize("answer", [DONE, NOT_TRIPPED])
def test_with_nothing_else_wrong_it_is_done_two_cycles_after_the_watchdogs_answer(answer: int) -> None:
    story = Story()
    assert story.run(WELL, 0.1, answer=None) is None
    assert story.run(WELL, 0.02, answer) is None
    outcome = story.run(WELL, 0.01, answer)
    assert outcome == RequestOutcome(True, "Reset. The drives are enabled once every velocity command is zero")


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (CAUSE_STANDS, ANSWERS[CAUSE_STANDS]),
        (VELOCITY_ORDERED, ANSWERS[VELOCITY_ORDERED]),
        (9, "answer 9"),
    ],
)
def test_what_the_watchdog_refuses_is_refused(answer: int, why: str) -> None:
    assert sentence(Story().run(TRIPPED, 0.01, answer)) == f"the watchdog (lease lost) refused: {why}"
    clues = replace(TRIPPED, watchdog_detail=f"lease lost; {'left_wheel stalls: is it blocked?; ' * 9}")
    assert sentence(Story().run(clues, 0.01, answer)) == f"the watchdog (lease lost) refused: {why}"


@pytest.mark.parametrize(
    ("situation", "answer", "detail"),
    [
        (WELL, None, "no answer"),
        (TRIPPED, None, "lease lost"),
        (TRIPPED, DONE, "lease lost"),
        (MISSING, None, "no frame"),
    ],
)
def test_it_waits_half_a_second_for_the_watchdog(situation: Situation, answer: int | None, detail: str) -> None:
    story = Story()
    assert story.run(situation, 0.49, answer) is None
    assert sentence(story.run(situation, 0.03, answer)).startswith(f"the watchdog is not ready after 0.5 s ({detail}")


NOT_THERE = "node 1 is not there"


@pytest.mark.parametrize(
    "waiting", [Situation(booting=NOT_THERE), Situation(absent=NOT_THERE), Situation(silent=NOT_THERE)]
)
def test_it_waits_ten_seconds_for_a_drive_and_goes_on_when_it_is_there(waiting: Situation) -> None:
    late = Story()
    assert late.run(waiting, 9.9) is None
    assert sentence(late.run(waiting, 0.2)) == "node 1 is not there; remedy that, then reset again"
    in_time = Story()
    assert in_time.run(waiting, 9.9) is None
    outcome = in_time.run(WELL, 0.1)
    assert outcome is not None
    assert outcome.done


@pytest.mark.parametrize(("cycle_s", "edge_s"), [(0.005, 0.05), (0.01, 0.05), (0.02, 0.06), (0.05, 0.15)])
def test_each_level_of_the_fault_reset_bit_lasts_50_ms_and_three_cycles_and_twice_as_long_at_each_further_try(
    cycle_s: float, edge_s: float
) -> None:
    story = Story(cycle_s)
    outcome = story.run(FAULT, 6.0)
    edges_s = (1 + 2 + 4) * edge_s
    assert story.lasted(ResetPhase.EDGE_LOW) == pytest.approx(edges_s, abs=FAULT_TRIES * 1.01 * cycle_s)
    assert story.lasted(ResetPhase.EDGE_HIGH) == pytest.approx(edges_s, abs=FAULT_TRIES * 1.01 * cycle_s)
    assert story.lasted(ResetPhase.EDGE_HIGH) > edges_s - 1e-6
    order = [phase for i, (_, phase) in enumerate(story.phases) if i == 0 or story.phases[i - 1][1] is not phase]
    assert order == list(ResetPhase)[1:] + (FAULT_TRIES - 1) * list(ResetPhase)[2:]
    assert sentence(outcome) == "left: over-current: it does not clear; remove its cause, then reset again"
    assert story.lasted(ResetPhase.FAULTS) == pytest.approx(FAULT_TRIES * 1.0, abs=FAULT_TRIES * 2.01 * cycle_s)


@pytest.mark.parametrize("phase", list(ResetPhase))
def test_the_bit_is_set_on_the_high_level_only(phase: ResetPhase) -> None:
    assert in_phase(phase).reset.fault_reset_bit is (phase is ResetPhase.EDGE_HIGH)


def test_a_fault_that_clears_ends_the_reset_well() -> None:
    story = in_phase(ResetPhase.FAULTS)
    outcome = story.run(WELL, 0.01)
    assert outcome is not None
    assert outcome.done


AFTER_BOOT = {ResetPhase.EDGE_LOW, ResetPhase.EDGE_HIGH, ResetPhase.FAULTS}
BREAKS = {
    "commanded": (Situation(commanded="cmd_vel orders 0.3 m/s"), set(ResetPhase)),
    "bus": (Situation(bus="bus-off"), set(ResetPhase)),
    "tripped": (TRIPPED, set(ResetPhase) - {ResetPhase.WATCHDOG}),
    "missing": (MISSING, set(ResetPhase) - {ResetPhase.WATCHDOG}),
    "booting": (Situation(booting="waiting for node 1"), AFTER_BOOT),
    "absent": (Situation(absent="node 1 restarted"), AFTER_BOOT),
    "silent": (Situation(silent="node 1: no status"), AFTER_BOOT),
}
"""What breaks it off, in which phases."""


@pytest.mark.parametrize("what", BREAKS)
@pytest.mark.parametrize("phase", list(ResetPhase))
def test_what_was_well_must_stay_so(phase: ResetPhase, what: str) -> None:
    situation, phases = BREAKS[what]
    outcome = in_phase(phase).run(replace(situation, fault="left: over-current"), 0.01, answer=None)
    broken_off = outcome is not None and outcome.sentence.startswith("broken off: ")
    assert broken_off is (phase in phases)
    assert not (broken_off and outcome is not None and outcome.done)


# Exactly at its limits: from second 8 on, times that a float holds exactly


def reset_at_8(answer: int | None = DONE, *, boot_s: float = 8.0, cycle_s: float = 0.125) -> Reset:
    """A reset since second 8, which has taken one step with this answer."""
    reset = Reset(8.0, cycle_s, boot_s)
    assert reset.step(FAULT, answer, 8.0) is None
    return reset


def test_half_a_second_is_not_too_late_for_the_watchdog() -> None:
    reset = reset_at_8(answer=None)
    assert reset.step(TRIPPED, None, 8.5) is None
    assert reset.step(WELL, DONE, 8.5) is None
    assert reset.phase is ResetPhase.DRIVES
    assert reset_at_8(answer=None).step(TRIPPED, None, math.nextafter(8.5, 9.0)) is not None


def test_the_time_for_a_boot_is_not_too_late_for_a_drive() -> None:
    waits = Situation(booting="waiting for node 1")
    reset = reset_at_8(DONE, boot_s=8.0)
    assert reset.step(waits, None, 16.0) is None
    assert sentence(reset.step(waits, None, math.nextafter(16.0, 17.0))).startswith("waiting for node 1")


# 8 s the drives are there ── 8.375 s the bit, three cycles of 0.125 s later ── 8.75 s low ── 9.75 s a whole second
def test_an_edge_is_long_enough_at_three_cycles_and_a_fault_may_take_a_second() -> None:
    reset = reset_at_8()
    for now_s, phase in (
        (8.0, ResetPhase.EDGE_LOW),
        (8.3125, ResetPhase.EDGE_LOW),
        (8.375, ResetPhase.EDGE_HIGH),
        (8.75, ResetPhase.FAULTS),
        (9.75, ResetPhase.FAULTS),
        (9.8125, ResetPhase.EDGE_LOW),
    ):
        assert reset.step(FAULT, None, now_s) is None
        assert reset.phase is phase, now_s


def test_a_fault_is_tried_three_times() -> None:
    reset, highs = reset_at_8(), 0
    before = reset.phase
    for cycle in range(1, 100):
        outcome = reset.step(FAULT, None, 8.0 + 0.125 * cycle)
        highs += before is not ResetPhase.EDGE_HIGH is reset.phase
        before = reset.phase
        if outcome is not None:
            break
    assert (outcome is not None, highs) == (True, 3)
