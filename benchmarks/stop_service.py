"""How soon motor_driver/stop answers while a reset waits for an absent drive. The answer means that it is obeyed.

The whole bench robot as real processes; one drive is off the bus, nothing has power. Each trial requests a reset, which
waits for the drive, and then for a stop, which breaks it off. The floor, in turn with it: a bare rclpy node that
answers the same service at once.
"""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from std_srvs.srv import Trigger

from figures import Figure, quantile, spread
from support.ros_harness import Process, TestNode
from support.running_robot import own_domain, robot_on

TRIALS = 200
BUDGET_S = 0.1
RESET_WAITS_S = 0.15
"""The watchdog has answered the reset by then, and it waits for the drive."""
ABSENT_NODE = 1
FLOOR_CODE = """
import rclpy
from rclpy.experimental import EventsExecutor
from std_srvs.srv import Trigger

def answer(request, response):
    response.success = True
    return response

rclpy.init()
node = rclpy.create_node("floor")
node.create_service(Trigger, "floor", answer)
executor = EventsExecutor()
executor.add_node(node)
while True:
    executor.spin_once(timeout_sec=0.1)
"""


def measure(trials: int = TRIALS) -> list[Figure]:
    """The figure; each trial takes about 0.2 s."""
    with ExitStack() as stack:
        robot = stack.enter_context(robot_on(stack.enter_context(own_domain())))
        floor = Process([sys.executable, "-c", FLOOR_CODE], robot.folder / "floor.log", robot.env)
        stack.callback(floor.close)
        reset, stop, bare = (_client(robot.node, name) for name in ("motor_driver/reset", "motor_driver/stop", "floor"))
        change = robot.node.node.create_client(ChangeState, "motor_driver/change_state")
        deactivate = Transition(id=Transition.TRANSITION_DEACTIVATE)
        _timed(robot.node, change, ChangeState.Request(transition=deactivate))
        robot.sim.fault(ABSENT_NODE, "cut")
        robot.node.spin_for(1.0)
        ours, theirs = [], []
        for _ in range(trials):
            pending = reset.call_async(Trigger.Request())
            robot.node.spin_for(RESET_WAITS_S)
            if pending.done():
                raise RuntimeError(f"the reset does not wait: {pending.result().message}")
            ours.append(_timed(robot.node, stop))
            robot.node.wait_for(pending.done, 5.0, "the reset to be broken off")
            theirs.append(_timed(robot.node, bare))
    p99 = quantile(ours, 0.99)
    what = f"driver: stop requested → answered, while a reset waits for an absent drive, {trials} stops"
    beside = f"a node that answers at once: {spread(theirs)}"
    ratio, budget = p99 / quantile(theirs, 0.99), f"p99 ≤ {1e3 * BUDGET_S:.0f} ms"
    return [Figure(what, spread(ours), beside, ratio, budget, p99 <= BUDGET_S)]


def _client(node: TestNode, name: str) -> Any:
    client = node.node.create_client(Trigger, name)
    node.wait_for(client.service_is_ready, 20.0, name)
    return client


def _timed(node: TestNode, client: Any, request: Any = None) -> float:
    """From the request to the answer, which is yes [s]."""
    asked_s = time.monotonic()
    answer = client.call_async(request or Trigger.Request())
    node.wait_for(answer.done, 20.0, client.srv_name)
    took_s = time.monotonic() - asked_s
    if not answer.result().success:
        raise RuntimeError(f"{client.srv_name} was refused: {answer.result()}")
    return took_s
