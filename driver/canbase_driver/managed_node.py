"""A managed node (lifecycle_msgs, rclpy.lifecycle) whose transitions are aims of the control thread.

configure boots the drives, activate gives them power, deactivate and shutdown stop the base first, cleanup lets the
drives go. Whatever the state of the node, the driver's own states decide what moves (`supervisor.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from canbase_driver.readiness import Aim
from canbase_driver.reset import Outcome


class ManagedNode(LifecycleNode):
    """`go` asks for an aim and waits for the outcome: spin this node in a thread that may wait."""

    def __init__(self, name: str, go: Callable[[Aim], Outcome], autostart: bool) -> None:
        super().__init__(name)
        self._go = go
        self._starts_by_itself = autostart
        service = self._service_change_state
        service.callback = self._guarded(service.callback)

    def start(self) -> None:
        """With autostart the node is active at once, and the driver boots and enables as soon as it can."""
        if self._starts_by_itself:
            self.trigger_configure()
            self.trigger_activate()
            self._starts_by_itself = False

    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Boot the drives; FAILURE when one is not there within timeouts.boot_s."""
        return self._reach(Aim.CONFIGURED)

    def on_activate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Give the drives power; FAILURE when something forbids it."""
        return self._reach(Aim.ACTIVE)

    def on_deactivate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the base to a stand, then take the power away."""
        return self._reach(Aim.CONFIGURED)

    def on_cleanup(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Let the drives go."""
        return self._reach(Aim.RELEASED)

    def on_shutdown(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Stop, power off, let the drives go. The process stays until it is ended: nothing would start it again."""
        return self._reach(Aim.RELEASED)

    def _reach(self, aim: Aim) -> TransitionCallbackReturn:
        if self._starts_by_itself:
            return TransitionCallbackReturn.SUCCESS
        outcome = self._go(aim)
        if outcome.done:
            self.get_logger().info(f"lifecycle: {outcome.sentence}")
            return TransitionCallbackReturn.SUCCESS
        self.get_logger().error(f"lifecycle: {outcome.sentence}")
        return TransitionCallbackReturn.FAILURE

    def _guarded(self, callback: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """rclpy raises for a transition that the state does not have, and a request must not end the process."""

        def guarded(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except rclpy_implementation.RCLError as error:
                self.get_logger().warning(f"lifecycle: transition {request.transition.id} refused: {error}")
                response.success = False
                return response

        return guarded
