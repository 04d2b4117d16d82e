"""`canbase doctor` before a world in virtual time: its own listening, readings and rows, without the shells.

Left out: `ip link` (a virtual bus has none), the files and processes of the computer, and the ROS graph.
"""

from __future__ import annotations

import copy
from functools import partial
from typing import Any

from builtin_interfaces.msg import Time

from canbase_campaign.can_bus import REMOTE, Receiver
from canbase_campaign.process import Process
from canbase_campaign.world import World
from canbase_commissioning.bus_monitor import ListenSession
from canbase_commissioning.session import Session
from canbase_doctor import default_checks as parts
from canbase_doctor.bus_checks import bus_checks
from canbase_doctor.bus_probe import LISTEN_S, ask, evidence
from canbase_doctor.check import Check
from canbase_doctor.evidence import Evidence, Heard
from canbase_driver.cia301.frame import Frame
from canbase_driver.ros.messages import status_message
from canbase_velocity.messages import safety_state
from canbase_velocity.mux_messages import mux_state

TURN_S, LONGEST_S = 0.002, 120.0
SECONDS_S = 3.0
"""`--seconds`, as it is when nobody gives it."""
PARTS = (parts.watchdog, parts.driver, parts.drives, parts.safety_filter, parts.scanners, parts.velocity_mux)


class _Line(Receiver):
    """Its end of the bus: on the driver's computer, cut off where that is."""

    def __init__(self, world: World) -> None:
        self._clock, self._session = world.clock, ListenSession(0.0)
        self._member = world.bus.join("doctor", self)
        blocked = world.bus.disturbance.blocked
        blocked |= {("doctor", there) for here, there in blocked if here == "driver" and there != "watchdog"}
        blocked |= {(here, "doctor") for here, there in blocked if there == "driver" and here != "watchdog"}

    def hear(self, cob_id: int, data: bytes) -> None:
        """A frame of anybody else."""
        if cob_id < REMOTE:
            self._session.on_frame(Frame(cob_id, data), self._clock.now_s)

    def run(self, session: Session) -> None:
        """Until it is done."""
        self._session = session  # type: ignore[assignment]
        end = self._clock.now_s + LONGEST_S
        while not session.done:
            assert self._clock.now_s < end, "the reading does not end"
            for frame in session.tick(self._clock.now_s):
                self._member.send(frame.cob_id, frame.data)
            self._clock.run_until(self._clock.now_s + TURN_S)


class _Node(Process):
    """Its subscriptions, as observe.py has them."""

    name = "doctor"

    def __init__(self, world: World) -> None:
        super().__init__(world.computer)
        self._world = world
        self.kept: dict[str, list[tuple[float, Any]]] = {topic: [] for topic in _MESSAGES}
        for topic in _MESSAGES:
            world.topics.subscribe(topic, self, partial(self._keep, topic))

    def _keep(self, topic: str, message: Any) -> None:
        self.kept[topic].append((self.clock.now_s, _MESSAGES[topic](self._world, message)))


def _filter_state(world: World, decision: Any) -> Any:
    now_s, found = world.clock.now_s, world.velocity.filter
    return safety_state(decision, found.inputs(now_s), found.clearances(now_s), Time())


_MESSAGES: dict[str, Any] = {
    "motor_driver/status": lambda world, snapshot: status_message(snapshot, Time()),
    "safety_filter/state": _filter_state,
    "velocity_mux/state": lambda world, decision: mux_state(decision, Time()),
}


def doctor(world: World) -> list[Check]:
    """All rows of `canbase doctor`, in its order. Time goes on in the world."""
    line, listening = _Line(world), ListenSession(LISTEN_S)
    line.run(listening)
    heard, now_s = copy.deepcopy(listening.heard), listening.now_s
    inquiry = ask(world.robot, listening.heard)
    line.run(inquiry)
    seen = evidence(world.robot, heard, now_s, inquiry, "", None)
    rows = bus_checks(seen)
    if not seen.canbase_runs:
        return rows
    node = _Node(world)
    world.clock.run_until(world.clock.now_s + SECONDS_S)
    messages = {
        topic: Heard(*zip(*((m, at) for at, m in kept), strict=True)) for topic, kept in node.kept.items() if kept
    }
    told = Evidence(world.robot, "robot.yaml", world.computer.now_s, heard=messages)
    return rows + [row for part in PARTS for row in part(told)]
