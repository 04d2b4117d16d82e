"""motor_driver as a managed node, over DDS, on a whole robot: what each transition does to the wheels and the bus."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from canbase.msg import DriverStatus
from geometry_msgs.msg import TwistStamped
from lifecycle_msgs.msg import State, Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetState

from exit_matrix.driven_robot import forward
from support.ros_harness import Repeater
from support.running_robot import READY_S, RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

CONFIGURE, CLEANUP = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_CLEANUP
ACTIVATE, DEACTIVATE = Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE
SPEED_MPS = 0.3


class Managed:
    """A robot whose driver is asked for transitions, and a joystick."""

    def __init__(self, robot: RunningRobot) -> None:
        self.robot = robot
        self.joystick: Repeater[TwistStamped] = robot.node.repeat(TwistStamped, "cmd_vel_joy", 50.0)
        self.events = robot.node.record(TransitionEvent, "motor_driver/transition_event")
        node = robot.node.node
        self._change = node.create_client(ChangeState, "motor_driver/change_state")
        self._get = node.create_client(GetState, "motor_driver/get_state")
        for client in (self._change, self._get):
            robot.node.wait_for(client.service_is_ready, READY_S, client.srv_name)
        robot.node.wait_for_subscriber(self.joystick.publisher)

    def change(self, transition: int) -> bool:
        """Whether it succeeded."""
        answer = self._change.call_async(ChangeState.Request(transition=Transition(id=transition)))
        self.robot.node.wait_for(answer.done, READY_S, "the answer to a transition")
        return bool(answer.result().success)

    @property
    def state(self) -> int:
        """Of the node now."""
        answer = self._get.call_async(GetState.Request())
        self.robot.node.wait_for(answer.done, READY_S, "the state")
        return int(answer.result().current_state.id)

    def go_to(self, state: int) -> None:
        """From wherever it is, by ordinary transitions."""
        self.joystick.message = None
        ways = {State.PRIMARY_STATE_ACTIVE: DEACTIVATE, State.PRIMARY_STATE_UNCONFIGURED: CONFIGURE}
        while (now_s := self.state) != State.PRIMARY_STATE_INACTIVE:
            assert self.change(ways[now_s]), self.robot.logs()
        last = {State.PRIMARY_STATE_ACTIVE: (ACTIVATE,), State.PRIMARY_STATE_UNCONFIGURED: (CLEANUP,)}
        for transition in last.get(state, ()):
            assert self.change(transition), self.robot.logs()

    def drives(self) -> bool:
        """It follows the joystick."""
        self.robot.wait_enabled()
        self.joystick.message = forward(0.0)
        self.robot.node.spin_for(0.3)
        self.joystick.message = forward(SPEED_MPS)
        self.robot.wait_speed(0.95 * SPEED_MPS)
        return True

    def moved(self, for_s: float = 1.0) -> float:
        """How far the base goes from now on [m]."""
        return self.robot.moved_since(time.monotonic(), for_s)


@pytest.fixture(scope="module")
def running() -> Iterator[Managed]:
    with own_domain() as domain, robot_on(domain) as robot:
        yield Managed(robot)


@pytest.fixture
def active(running: Managed) -> Managed:
    running.go_to(State.PRIMARY_STATE_ACTIVE)
    return running


@pytest.fixture
def inactive(running: Managed) -> Managed:
    running.go_to(State.PRIMARY_STATE_INACTIVE)
    return running


def test_it_is_active_by_itself_and_deactivate_at_speed_stops_the_wheels_before_it_answers(running: Managed) -> None:
    assert running.state == State.PRIMARY_STATE_ACTIVE
    running.robot.wait_enabled()
    for transition in (CONFIGURE, CLEANUP, ACTIVATE, 77):
        assert not running.change(transition)
    assert running.state == State.PRIMARY_STATE_ACTIVE
    assert running.drives()
    assert running.change(DEACTIVATE)
    answered_s = time.monotonic()
    assert running.robot.moved_since(answered_s, 1.0) < RESTS_M  # the joystick still orders 0.3 m/s
    status = running.robot.wait_state(DriverStatus.DISARMED)
    assert (status.cause, status.watchdog) == ("inactive", DriverStatus.WATCHDOG_OK)
    assert [drive.state for drive in status.drives] == ["switch on disabled"] * 2
    assert running.robot.odom.since(answered_s)


def test_a_stick_that_is_held_during_activate_moves_nothing_until_it_is_released(inactive: Managed) -> None:
    """The mux does not follow it, so the driver hears zero."""
    inactive.joystick.message = forward(SPEED_MPS)
    inactive.robot.node.spin_for(0.3)
    assert inactive.change(ACTIVATE)
    assert inactive.robot.wait_any_state().state == DriverStatus.ENABLED
    assert inactive.moved(1.5) < RESTS_M
    assert inactive.drives()


def test_cleanup_lets_the_drives_go_without_a_fault_and_configure_boots_them_again(active: Managed) -> None:
    asked_s = time.monotonic()
    assert active.change(DEACTIVATE)
    assert active.change(CLEANUP)
    status = active.robot.wait_state(DriverStatus.OFFLINE)
    assert status.cause == "not configured"
    let_go_s = time.monotonic()
    active.robot.node.spin_for(1.5)
    assert active.robot.odom.since(let_go_s + 0.5) == []
    told = [event.goal_state.label for event in active.events.since(asked_s)]
    assert told == ["deactivating", "inactive", "cleaningup", "unconfigured"]
    assert active.change(CONFIGURE)
    status = active.robot.wait_state(DriverStatus.DISARMED)
    assert status.cause == "inactive"
    assert [drive.error_code for drive in status.drives] == [0, 0]


def test_shutdown_at_speed_stops_the_wheels_and_the_process_stays_without_a_drive(active: Managed) -> None:
    assert active.drives()
    assert active.change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert active.moved() < RESTS_M
    assert active.state == State.PRIMARY_STATE_FINALIZED
    assert active.robot.stack.death() is None
    active.joystick.message = None
    active.robot.stack.end("driver")  # the cure: a new process, and an activation
    active.robot.stack.start()
    assert "switched off by an operator" in active.robot.wait_state(DriverStatus.OFFLINE).detail
    assert active.state == State.PRIMARY_STATE_UNCONFIGURED
    active.go_to(State.PRIMARY_STATE_ACTIVE)
    active.robot.wait_whole()
