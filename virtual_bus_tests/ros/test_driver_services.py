"""motor_driver's services over DDS, on a whole robot: a stop waits for nothing, and no old request is carried out."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from canbase.msg import DriverStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from std_srvs.srv import Trigger

from support.running_robot import READY_S, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

TRIALS = 3
STOP_S = 0.25
"""A loaded machine answers within this; `canbase prove benchmark stop` measures it."""
PAUSE_S = 1.2
"""Longer than any request may wait, and than the watchdog waits for the driver."""
CUT_NODE = 1


class Services:
    """A robot, and clients of all services of its driver."""

    def __init__(self, robot: RunningRobot) -> None:
        self.robot = robot
        node = robot.node.node
        self.pose = node.create_publisher(PoseWithCovarianceStamped, "motor_driver/set_pose", 1)
        names = ("reset", "stop", "reset_odometry")
        self._clients = {name: node.create_client(Trigger, f"motor_driver/{name}") for name in names}
        self._clients["change_state"] = node.create_client(ChangeState, "motor_driver/change_state")
        self._clients["get_state"] = node.create_client(GetState, "motor_driver/get_state")
        for client in self._clients.values():
            robot.node.wait_for(client.service_is_ready, READY_S, client.srv_name)

    def ask(self, name: str, request: Any = None) -> Any:
        """The future answer."""
        return self._clients[name].call_async(request or Trigger.Request())

    def change(self, transition: int) -> Any:
        """The future answer to a transition."""
        return self.ask("change_state", ChangeState.Request(transition=Transition(id=transition)))

    def answer(self, future: Any, within_s: float = READY_S) -> Any:
        """The answer."""
        self.robot.node.wait_for(future.done, within_s, f"an answer\n{self.robot.logs()}")
        return future.result()

    def waiting_reset(self) -> Any:
        """The future answer to a reset that is under way; the stop before it has to be at its end for that."""
        deadline_s = time.monotonic() + READY_S
        while time.monotonic() < deadline_s:
            reset = self.ask("reset")
            self.robot.node.spin_for(0.2)
            if not reset.done():
                return reset
        raise AssertionError(f"no reset begins\n{self.robot.logs()}")

    def timed_stop(self) -> float:
        """From the request to the answer, which is yes [s]."""
        asked_s = time.monotonic()
        assert self.answer(self.ask("stop")).success
        return time.monotonic() - asked_s

    @property
    def lifecycle(self) -> int:
        """State of the node."""
        return int(self.answer(self.ask("get_state", GetState.Request())).current_state.id)

    def go(self, transition: int) -> None:
        """A transition that succeeds."""
        assert self.answer(self.change(transition)).success, self.robot.logs()

    def wait_cause(self, cause: str) -> DriverStatus:
        """Until the status tells that cause."""
        status = self.robot.status
        self.robot.node.wait_for(lambda: status.last and status.last.cause == cause, READY_S, cause)
        assert status.last is not None
        return status.last

    def heal(self) -> None:
        """All drives are on the bus, and have power."""
        self.robot.sim.fault(CUT_NODE, "heal")
        next_step = {
            State.PRIMARY_STATE_UNCONFIGURED: Transition.TRANSITION_CONFIGURE,
            State.PRIMARY_STATE_INACTIVE: Transition.TRANSITION_ACTIVATE,
        }
        deadline_s = time.monotonic() + READY_S
        while (state := self.lifecycle) != State.PRIMARY_STATE_ACTIVE and time.monotonic() < deadline_s:
            self.answer(self.ask("reset"))
            if state in next_step:
                self.answer(self.change(next_step[state]))
        self.robot.make_ready()

    def pause_driver(self, during: Callable[[], Any]) -> Any:
        """The driver's process stands still; `during` is called meanwhile."""
        self.robot.send("driver", signal.SIGSTOP)
        try:
            self.robot.node.spin_for(0.3)
            result = during()
            self.robot.node.spin_for(PAUSE_S)
        finally:
            self.robot.send("driver", signal.SIGCONT)
        return result


@pytest.fixture(scope="module")
def running() -> Iterator[Services]:
    with own_domain() as domain, robot_on(domain) as robot:
        yield Services(robot)


@pytest.fixture
def services(running: Services) -> Iterator[Services]:
    yield running
    running.heal()


def cut(services: Services) -> None:
    """A drive goes missing while nothing has power: no trip of the watchdog, which would refuse the reset at once."""
    services.go(Transition.TRANSITION_DEACTIVATE)
    services.robot.sim.fault(CUT_NODE, "cut")
    services.wait_cause("drive silent")


def test_a_stop_is_answered_and_obeyed_while_a_reset_waits_for_an_absent_drive(services: Services) -> None:
    cut(services)
    taken_s = []
    for _ in range(TRIALS):
        reset = services.waiting_reset()
        taken_s.append(services.timed_stop())
        assert services.answer(reset, 1.0).message == "broken off: service motor_driver/stop"
    assert max(taken_s) < STOP_S
    services.wait_cause("stop requested")


def test_while_a_reset_waits_everything_else_is_answered(services: Services) -> None:
    cut(services)
    reset = services.waiting_reset()
    assert services.answer(services.ask("reset"), 1.0).message == "refused: a reset is under way"
    assert services.lifecycle == State.PRIMARY_STATE_INACTIVE
    assert not reset.done()


def test_a_stop_is_answered_and_obeyed_while_a_transition_boots_an_absent_drive(services: Services) -> None:
    services.go(Transition.TRANSITION_DEACTIVATE)
    services.go(Transition.TRANSITION_CLEANUP)
    services.robot.sim.fault(CUT_NODE, "cut")
    configure = services.change(Transition.TRANSITION_CONFIGURE)
    services.robot.node.spin_for(0.5)
    assert services.timed_stop() < STOP_S
    assert services.wait_cause("stop requested").state == DriverStatus.LATCHED
    assert not configure.done()


def test_requests_that_waited_while_the_driver_stood_still_are_refused(services: Services) -> None:
    before = services.robot.odometry()
    pose = PoseWithCovarianceStamped()
    pose.header.frame_id = "odom"
    pose.pose.pose.position.x, pose.pose.pose.orientation.w = 7.0, 1.0

    def ask_all() -> list[Any]:
        services.pose.publish(pose)
        return [services.ask("reset"), services.ask("reset_odometry")]

    answers = [services.answer(future) for future in services.pause_driver(ask_all)]
    assert [answer.success for answer in answers] == [False, False]
    assert all("did not run before it" in answer.message for answer in answers), answers
    services.robot.wait_state(DriverStatus.LATCHED)  # the watchdog has stopped the drives
    assert services.robot.odometry() == pytest.approx(before, abs=0.005)


def test_an_activation_that_waited_gives_no_power(services: Services) -> None:
    services.go(Transition.TRANSITION_DEACTIVATE)
    activate = services.pause_driver(lambda: services.change(Transition.TRANSITION_ACTIVATE))
    assert not services.answer(activate).success
    assert services.lifecycle == State.PRIMARY_STATE_INACTIVE


def test_a_stop_and_a_deactivation_that_waited_are_obeyed(services: Services) -> None:
    stop, deactivate = services.pause_driver(
        lambda: (services.ask("stop"), services.change(Transition.TRANSITION_DEACTIVATE))
    )
    assert services.answer(stop).success
    assert services.answer(deactivate).success
    assert services.lifecycle == State.PRIMARY_STATE_INACTIVE
    services.robot.wait_state(DriverStatus.LATCHED)
