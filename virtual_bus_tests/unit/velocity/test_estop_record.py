"""An emergency stop outlives the filter's process: pressed, waiting for its reset, or killed with a free button."""

from __future__ import annotations

import pytest

from canbase_base.latch_record import Defect, Found, Mark
from canbase_campaign.disk import FULL, StopDisk
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.decision import Action, Decision
from canbase_velocity.estop import Estop, EstopEvent, EstopState
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import config

FORWARD = Twist(0.3, 0.0)


class Robot:
    """A filter whose button speaks on change only, and its disk."""

    def __init__(self, *, latched: bool = True) -> None:
        self.now_s = 10.0
        self.disk = StopDisk("velocity")
        self._config = config(scan=False, estop=False, latched=latched)
        self.start()

    def start(self) -> None:
        """A new process."""
        self.filter = SafetyFilter(self._config, self.disk.found())
        self.settle()

    def button(self, pressed: bool) -> None:
        self.now_s += 0.02
        self.filter.on_estop(pressed, self.now_s)
        self.settle()

    def settle(self) -> None:
        for _ in range(3):
            self.order(ZERO)

    def order(self, twist: Twist) -> Decision:
        self.now_s += 0.02
        self.filter.accept_command(twist, self.now_s)
        decision = self.filter.decide(self.now_s)
        self.filter.on_record(*self.disk.write(self.filter.record))
        return decision

    def reset(self) -> bool:
        self.order(ZERO)
        return self.filter.reset((), self.now_s)[0]

    @property
    def drives(self) -> bool:
        self.settle()
        return self.order(FORWARD).twist != ZERO


def test_without_a_button_a_kill_leaves_nothing() -> None:
    robot = Robot()
    assert robot.drives
    robot.start()
    assert robot.drives


# pressed ── SIGKILL ── start ── zeros ── still pressed; released ── reset ── drives
@pytest.mark.parametrize("restarts", [1, 3])
def test_a_pressed_button_that_speaks_on_change_stays_pressed(restarts: int) -> None:
    robot = Robot()
    robot.button(True)
    for _ in range(restarts):
        robot.start()
        assert not robot.drives
        assert not robot.reset()
        assert robot.filter.estop is EstopState.HELD
    decision = robot.order(FORWARD)
    assert (decision.action, decision.cause) == (Action.STOP, StopCause.ESTOP)
    assert "not seen released" in decision.detail
    robot.button(False)
    assert not robot.drives
    assert robot.reset()
    assert robot.drives


# pressed, released ── restart, killed or in order ── zeros ── released; reset ── drives
@pytest.mark.parametrize("orderly", [False, True])
def test_an_emergency_stop_that_waits_for_its_reset_waits_over_a_restart(orderly: bool) -> None:
    robot = Robot()
    robot.button(True)
    robot.button(False)
    assert robot.filter.estop is EstopState.AWAITS_RESET
    if orderly:
        robot.filter.end()
        robot.settle()
    robot.start()
    assert not robot.drives
    robot.button(False)
    assert robot.filter.estop is EstopState.AWAITS_RESET
    assert not robot.drives
    assert "latched since before the start" in robot.order(FORWARD).detail
    assert robot.reset()
    assert robot.drives
    assert "latched" not in robot.order(FORWARD).detail


# pressed, released ── the computer is restarted, the button pressed meanwhile: nobody hears it ── a reset is tried
def test_a_press_that_nobody_heard_while_a_reset_was_due_is_not_reset_away() -> None:
    robot = Robot()
    robot.button(True)
    robot.button(False)
    robot.filter.end()
    robot.settle()
    robot.start()
    assert not robot.reset()
    assert not robot.drives
    assert robot.filter.estop is EstopState.HELD


def test_without_a_button_a_lost_record_needs_no_button_after_a_restart_either() -> None:
    estop = Estop(True, Found(defect=Defect.MISSING))
    estop = Estop(True, Found(estop.record))
    before = estop.state
    estop.happens(EstopEvent.RESET)
    assert (before, estop.state) == (EstopState.AWAITS_RESET, EstopState.FREE)


# the button is free ── SIGKILL, and a press that nobody heard ── start: taken for pressed
def test_killed_with_a_free_button_it_is_taken_for_pressed() -> None:
    robot = Robot()
    robot.button(False)
    assert robot.drives
    robot.start()
    assert robot.filter.estop is EstopState.HELD
    assert not robot.drives
    robot.button(False)
    assert robot.reset()
    assert robot.drives


def test_an_orderly_end_with_a_free_button_leaves_nothing() -> None:
    robot = Robot()
    robot.button(False)
    robot.filter.end()
    robot.settle()
    assert not robot.disk.found().latched
    robot.start()
    assert robot.drives


def test_an_orderly_end_with_a_pressed_button_leaves_it_pressed() -> None:
    robot = Robot()
    robot.button(True)
    robot.filter.end()
    robot.settle()
    robot.start()
    assert robot.filter.estop is EstopState.HELD


def test_without_latched_a_release_and_a_zero_are_enough() -> None:
    robot = Robot(latched=False)
    robot.button(True)
    robot.start()
    assert not robot.drives
    robot.button(False)
    assert robot.drives
    robot.button(True)
    robot.button(False)
    robot.start()
    assert robot.filter.estop is EstopState.HELD


def test_a_record_that_cannot_be_used_waits_for_a_reset() -> None:
    robot = Robot()
    robot.disk.file.data = bytearray(b"garbage")
    robot.filter = SafetyFilter(robot._config, robot.disk.found())
    decision = robot.filter.decide(robot.now_s)
    assert robot.filter.estop is EstopState.AWAITS_RESET
    assert "wrong size" in decision.detail


@pytest.mark.parametrize("defect", [defect for defect in Defect if defect is not Defect.NONE])
@pytest.mark.parametrize(("latches", "state"), [(True, EstopState.AWAITS_RESET), (False, EstopState.AWAITS_ZERO)])
def test_every_defect(defect: Defect, latches: bool, state: EstopState) -> None:
    assert Estop(latches, Found(defect=defect)).state is state


def test_a_full_disk_moves_nothing_from_the_first_word_of_the_button_on() -> None:
    robot = Robot()
    robot.disk.file.writable = False
    robot.button(False)
    decision = robot.order(FORWARD)
    assert (decision.action, decision.cause, decision.detail) == (Action.STOP, StopCause.ESTOP, FULL)
    robot.disk.file.writable = True
    assert robot.drives


def test_every_state_is_on_disk_and_comes_back_held() -> None:
    disk = StopDisk("velocity")
    estop = Estop(True, disk.found())
    for event, mark in (
        (EstopEvent.SILENCE, Mark.CLEAR),  # never heard: a robot that has just started has nothing to keep
        (EstopEvent.PRESS, Mark.LATCHED),
        (EstopEvent.RELEASE, Mark.LATCHED),
        (EstopEvent.RESET, Mark.LIVE),
        (EstopEvent.SILENCE, Mark.LATCHED),
    ):
        estop.happens(event)
        disk.write(estop.record)
        assert disk.found().record.mark is mark, event
        if mark is Mark.LATCHED:
            assert Estop(True, disk.found()).state is EstopState.HELD


# drives ── the end begins: zeros ── pressed meanwhile ── the end is complete ── start: pressed
@pytest.mark.parametrize("late", [False, True], ids=["before its record", "after its record"])
def test_a_press_during_an_orderly_end_is_recorded(late: bool) -> None:
    robot = Robot()
    robot.button(False)
    assert robot.drives
    assert robot.filter.shut_down(robot.now_s).twist == ZERO
    assert robot.order(FORWARD).cause is StopCause.SHUTDOWN  # whatever still arrives
    assert robot.disk.found().record.mark is Mark.LIVE
    if late:
        robot.filter.end()
        robot.settle()
        assert robot.filter.record_is_on_disk
        assert robot.disk.found().record.mark is Mark.CLEAR
    robot.button(True)
    robot.filter.end()
    robot.settle()
    assert robot.filter.record_is_on_disk
    robot.start()
    assert robot.filter.estop is EstopState.HELD
    assert not robot.drives
