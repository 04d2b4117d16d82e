"""The driver's lifecycle as ROS shows it, over DDS, with a control thread that a test plays: one owner of the state."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from canbase_driver.ros.managed_node import ManagedNode
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.lifecycle import Aim
from support.ros_harness import TestNode

pytestmark = pytest.mark.ros

DONE, FAILED = RequestOutcome(True, "done"), RequestOutcome(False, "not confirmed in time")


class PlayedLoop:
    """In place of the control thread: the test says when a change ends, and how. A failed rise is taken back."""

    def __init__(self, aim: Aim) -> None:
        self.aimed_at = self._before = aim
        self._on_outcome: list[Callable[[RequestOutcome], None]] = []

    def aim(self, aim: Aim, on_outcome: Callable[[RequestOutcome], None]) -> None:
        self._before, self.aimed_at = self.aimed_at, aim
        self._on_outcome.append(on_outcome)

    def end(self, outcome: RequestOutcome) -> None:
        if not outcome.done and self.aimed_at > self._before:
            self.aimed_at = self._before
        self._on_outcome.pop()(outcome)

    @property
    def changing(self) -> bool:
        return bool(self._on_outcome)


class NoPauses:
    """In place of the clock's watch: this process never stands still."""

    def waited(self, _now: float) -> bool:
        return False


class Rig:
    """The node, its executor, and a client."""

    def __init__(self, autostart: bool) -> None:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.loop = PlayedLoop(Aim.ACTIVE if autostart else Aim.RELEASED)
        self.node = ManagedNode("motor_driver", self.loop)  # type: ignore[arg-type]
        self.node.request_times = NoPauses()  # type: ignore[assignment]
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)
        self._asks = TestNode()
        self._client = self._asks.node.create_client(ChangeState, "motor_driver/change_state")
        self._asks.wait_for(self._client.service_is_ready, 20.0, "change_state")

    @property
    def state(self) -> int:
        return int(self.node._state_machine.current_state[0])

    def ask(self, transition: int) -> Any:
        """The future answer; the request has been taken in."""
        answer = self._client.call_async(ChangeState.Request(transition=Transition(id=transition)))
        self._spin(lambda: answer.done() or self.loop.changing)
        return answer

    def change(self, transition: int, outcome: RequestOutcome = DONE) -> bool:
        """The answer to a transition that ends with `outcome`."""
        answer = self.ask(transition)
        assert not answer.done()
        self.loop.end(outcome)
        self._spin(answer.done)
        return bool(answer.result().success)

    def refused(self, transition: int) -> bool:
        """It is answered with no, and nothing is asked of the control thread."""
        before = self.loop.changing
        answer = self._client.call_async(ChangeState.Request(transition=Transition(id=transition)))
        self._spin(answer.done)
        return not answer.result().success and self.loop.changing is before

    def close(self) -> None:
        self._executor.shutdown()
        self._asks.close()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def _spin(self, done: Callable[[], bool]) -> None:
        def step() -> bool:
            self._executor.spin_once(timeout_sec=0.01)
            return done()

        self._asks.wait_for(step, 10.0, "the transition")


@pytest.fixture
def active(domain_id: int) -> Iterator[Rig]:
    rig = Rig(autostart=True)
    yield rig
    rig.close()


@pytest.fixture
def unconfigured(domain_id: int) -> Iterator[Rig]:
    rig = Rig(autostart=False)
    yield rig
    rig.close()


def test_after_a_deactivation_that_was_not_confirmed_ros_and_the_driver_are_both_inactive(active: Rig) -> None:
    assert not active.change(Transition.TRANSITION_DEACTIVATE, FAILED)
    assert (active.state, active.loop.aimed_at) == (State.PRIMARY_STATE_INACTIVE, Aim.CONFIGURED)
    assert active.change(Transition.TRANSITION_ACTIVATE)
    assert (active.state, active.loop.aimed_at) == (State.PRIMARY_STATE_ACTIVE, Aim.ACTIVE)


def test_after_a_cleanup_that_was_not_confirmed_both_are_unconfigured(active: Rig) -> None:
    assert active.change(Transition.TRANSITION_DEACTIVATE)
    assert not active.change(Transition.TRANSITION_CLEANUP, FAILED)
    assert (active.state, active.loop.aimed_at) == (State.PRIMARY_STATE_UNCONFIGURED, Aim.RELEASED)


def test_a_rise_that_fails_is_taken_back_in_both(unconfigured: Rig) -> None:
    assert not unconfigured.change(Transition.TRANSITION_CONFIGURE, FAILED)
    assert (unconfigured.state, unconfigured.loop.aimed_at) == (State.PRIMARY_STATE_UNCONFIGURED, Aim.RELEASED)
    assert unconfigured.change(Transition.TRANSITION_CONFIGURE)
    assert not unconfigured.change(Transition.TRANSITION_ACTIVATE, FAILED)
    assert (unconfigured.state, unconfigured.loop.aimed_at) == (State.PRIMARY_STATE_INACTIVE, Aim.CONFIGURED)


def test_during_a_transition_every_other_one_is_refused_also_its_own_end(active: Rig) -> None:
    deactivate = active.ask(Transition.TRANSITION_DEACTIVATE)
    for transition in (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_ON_DEACTIVATE_SUCCESS, 99):
        assert active.refused(transition)
    assert not deactivate.done()
    assert active.state == State.TRANSITION_STATE_DEACTIVATING
    active.loop.end(DONE)
    assert active.state == State.PRIMARY_STATE_INACTIVE


def test_a_shutdown_ends_finalized_also_when_it_was_not_confirmed(active: Rig) -> None:
    assert not active.change(Transition.TRANSITION_ACTIVE_SHUTDOWN, FAILED)
    assert (active.state, active.loop.aimed_at) == (State.PRIMARY_STATE_FINALIZED, Aim.RELEASED)
