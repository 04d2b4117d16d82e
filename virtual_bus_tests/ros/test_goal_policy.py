"""The goal policies over DDS: one owner of the base, whatever several clients send and cancel at the same time.

Each policy under storms of goals: unit/action_server/test_goal_queue.py. `reject`: test_action_server.py.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from canbase.action import DriveDistance
from rclpy.action import ActionClient

from canbase_action_server.goal_client import SERVICE_QOS
from canbase_action_server.outcome import ErrorCode, Status
from support.goal_stage import PATIENT_S, GoalStage, goal_stage

pytestmark = pytest.mark.ros


class Crowd:
    """A server, its base, and several clients that neither wait nor ask twice."""

    def __init__(self, stage: GoalStage) -> None:
        self.stage, self.node = stage, stage.node
        self.clients = [
            ActionClient(stage.node.node, DriveDistance, "drive_distance", goal_service_qos_profile=SERVICE_QOS,
                         result_service_qos_profile=SERVICE_QOS, cancel_service_qos_profile=SERVICE_QOS)
            for _ in range(4)
        ]  # fmt: skip
        ready = lambda: all(client.server_is_ready() for client in self.clients)  # noqa: E731
        stage.node.wait_for(ready, PATIENT_S, "all clients")
        self.results: dict[str, list[Any]] = {}
        self.handles: dict[str, Any] = {}
        self.sent = self.answered = 0

    def send(self, distance_m: float, speed_mps: float, client: int = 0) -> None:
        """A goal of this client; what becomes of it goes to `handles` and `results`."""
        self.sent += 1
        goal = DriveDistance.Goal(distance_m=distance_m, max_speed_mps=speed_mps)
        self.clients[client].send_goal_async(goal).add_done_callback(self._on_answer)

    def accepted(self, count: int) -> list[str]:
        """The UUIDs of the accepted goals, in their order, when there are that many."""
        self.node.wait_for(lambda: len(self.handles) >= count, 10.0, f"{count} accepted goals")
        return list(self.handles)

    def wait_for_the_end(self, timeout_s: float = 30.0) -> None:
        """Every goal was answered, and every accepted goal has its result."""
        self.node.wait_for(lambda: self.answered == self.sent, timeout_s, "all answers")
        self.node.wait_for(lambda: len(self.results) == len(self.handles), timeout_s, "all results")

    def end(self, uuid: str) -> tuple[Status, ErrorCode]:
        """Status and error code of a goal that ended once."""
        (wrapped,) = self.results[uuid]
        return Status(wrapped.status), ErrorCode(wrapped.result.error_code)

    def _on_answer(self, future: Any) -> None:
        self.answered += 1
        handle = future.result()
        if handle.accepted:
            uuid = bytes(handle.goal_id.uuid).hex()
            self.handles[uuid] = handle
            result = handle.get_result_async()
            result.add_done_callback(lambda done: self.results.setdefault(uuid, []).append(done.result()))


@contextmanager
def crowd_before(**action: Any) -> Iterator[Crowd]:
    with goal_stage({"timeouts": {"odometry_s": 1.0}, "action": {"progress_timeout_s": 5.0, **action}}) as stage:
        yield Crowd(stage)


def test_60_goals_and_cancels_of_several_clients_each_end_once_and_rightly() -> None:
    with crowd_before(goal_policy="preempt") as crowd:
        chance, canceled = random.Random(1), set()
        for _ in range(60):
            way_m = chance.choice((-1, 1)) * chance.uniform(0.01, 0.1)
            crowd.send(way_m, chance.uniform(0.1, 0.5), client=chance.randrange(4))
            crowd.node.spin_for(chance.choice((0.0, 0.01, 0.05, 0.3)))
            living = [uuid for uuid in crowd.handles if uuid not in crowd.results]
            if living and chance.random() < 0.5:
                canceled.add(living[-1])
                crowd.handles[living[-1]].cancel_goal_async()
        crowd.wait_for_the_end()
        allowed = {
            (Status.SUCCEEDED, ErrorCode.OK): set(crowd.handles),
            (Status.CANCELED, ErrorCode.CANCELED): canceled,
            (Status.ABORTED, ErrorCode.PREEMPTED): set(crowd.handles),
        }
        ends = {uuid: crowd.end(uuid) for uuid in crowd.handles}
        assert {uuid: end for uuid, end in ends.items() if uuid not in allowed.get(end, set())} == {}
        assert (Status.ABORTED, ErrorCode.PREEMPTED) in ends.values()
        assert one_at_a_time(crowd.stage.steps())
        assert len(crowd.handles) > 10
        assert crowd.node.node.count_publishers("cmd_vel_action") == 1


def one_at_a_time(steps: list[dict[str, Any]]) -> bool:
    """In the server's own log no goal starts before the one that started before it has ended, and each ends once."""
    running: set[str] = set()
    ended: list[str] = []
    for step in steps:
        if step["step"] == "started":
            if running - set(ended):
                return False
            running.add(step["uuid"])
        elif step["step"] == "ended":
            ended.append(step["uuid"])
    return len(ended) == len(set(ended))


def test_a_queue_drives_in_order_and_a_queued_goal_can_be_canceled() -> None:
    # A server that a loaded machine holds up by 0.2 s brakes too late for 5 mm: OVERSHOOT. This is about order.
    with crowd_before(goal_policy="queue", queue_length=2, tolerance_m=0.04) as crowd:
        for distance_m in (0.3, 0.2, -0.1):
            crowd.send(distance_m, 0.3)
            crowd.node.wait_for(lambda: crowd.answered == crowd.sent, 5.0, "the answer")
            crowd.node.spin_for(0.1)
        first, second, third = crowd.accepted(3)
        crowd.send(0.1, 0.3)  # one runs, two wait: no place
        crowd.handles[second].cancel_goal_async()
        crowd.node.wait_for(lambda: second in crowd.results, 5.0, "the end of the queued goal")
        assert first not in crowd.results
        crowd.wait_for_the_end()
        assert crowd.sent - len(crowd.handles) == 1
        assert [crowd.end(uuid) for uuid in (first, second, third)] == [
            (Status.SUCCEEDED, ErrorCode.OK),
            (Status.CANCELED, ErrorCode.CANCELED),
            (Status.SUCCEEDED, ErrorCode.OK),
        ]
        assert crowd.stage.base.x_m == pytest.approx(0.2, abs=0.09)  # the two that ran, each within its tolerance
