"""A managed node (lifecycle_msgs, rclpy.lifecycle) whose transitions are aims of the control thread.

configure boots the drives, activate gives them power, deactivate and shutdown stop the base first, cleanup lets the
drives go. The driver owns the lifecycle (`lifecycle.py`): a transition ends in the state of what it aims at by then. A
deactivation that could not be confirmed in time is answered with "no", and the node is inactive, as the driver is.
Nothing here waits: rclpy's own callbacks of a transition would, so they are not used.
"""

from __future__ import annotations

import time

from lifecycle_msgs.msg import Transition
from rcl_interfaces.msg import SetParametersResult
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

from canbase_driver.ros.late_answer import Asked, answer_later
from canbase_driver.ros.request_age import refusal
from canbase_driver.runtime.control_thread import ControlLoop
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.lifecycle import Aim
from canbase_runtime.receive_time import ReceiveTimes
from canbase_runtime.sim_time import refuse_sim_time

AIMS = {
    Transition.TRANSITION_CONFIGURE: Aim.CONFIGURED,
    Transition.TRANSITION_ACTIVATE: Aim.ACTIVE,
    Transition.TRANSITION_DEACTIVATE: Aim.CONFIGURED,
    Transition.TRANSITION_CLEANUP: Aim.RELEASED,
    Transition.TRANSITION_UNCONFIGURED_SHUTDOWN: Aim.RELEASED,
    Transition.TRANSITION_INACTIVE_SHUTDOWN: Aim.RELEASED,
    Transition.TRANSITION_ACTIVE_SHUTDOWN: Aim.RELEASED,
}
"""What each transition aims at. After a shutdown the process stays until it is ended: nothing would start it again."""


class ManagedNode(LifecycleNode):
    """The lifecycle of the driver as ROS sees it."""

    def __init__(self, name: str, loop: ControlLoop) -> None:
        """Its first state is how far the driver goes by itself."""
        super().__init__(name)
        refuse_sim_time(self, SetParametersResult)
        self._loop = loop
        self.request_times = ReceiveTimes.of_requests()
        """Whether a request that is taken in now may have waited while this process stood still."""
        answer_later(self._service_change_state, self._on_change_state)
        if loop.aimed_at is not Aim.RELEASED:
            self.trigger_configure()
        if loop.aimed_at is Aim.ACTIVE:
            self.trigger_activate()

    def destroy_node(self) -> None:
        """rclpy leaves the state machine, which keeps the node in the graph."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def _on_change_state(self, asked: Asked) -> None:
        try:
            aim = self._begin(asked)
        except rclpy_implementation.RCLError as error:  # rclpy raises for a transition that the state does not have
            self._refuse(asked, f"refused: {error}")
        else:
            if aim is not None:
                self._loop.aim(aim, lambda outcome: self._end(asked, aim, outcome))

    def _begin(self, asked: Asked) -> Aim | None:
        """What the transition that begins aims at; None: it was refused."""
        wanted, machine = asked.request.transition, self._state_machine
        number = machine.get_transition_by_label(wanted.label) if wanted.label else wanted.id
        aim = AIMS.get(number)
        if aim is None:
            self._refuse(asked, "refused: this transition cannot be requested")
            return None
        old = refusal(self.request_times.waited(time.monotonic()), asked.sent_s, time.time())
        if old and aim > self._loop.aimed_at:
            self._refuse(asked, old)
            return None
        machine.trigger_transition_by_id(number, True)
        return aim

    def _end(self, asked: Asked, aim: Aim, outcome: RequestOutcome) -> None:
        taken_back = self._loop.aimed_at is not aim
        end = TransitionCallbackReturn.FAILURE if taken_back else TransitionCallbackReturn.SUCCESS
        self._state_machine.trigger_transition_by_label(end.to_label(), True)
        if outcome.done:
            self.get_logger().info(f"lifecycle: {outcome.sentence}")
        else:
            self.get_logger().error(f"lifecycle: {outcome.sentence}")
        asked.response.success = outcome.done
        asked.answer()

    def _refuse(self, asked: Asked, why: str) -> None:
        self.get_logger().warning(
            f"lifecycle: transition {asked.request.transition.id} {why}", throttle_duration_sec=1.0
        )
        asked.response.success = False
        asked.answer()
