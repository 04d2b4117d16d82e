"""The part of `canbase doctor` that looks at the bus: listens, reads the nodes, queries the system's interface."""

from __future__ import annotations

import copy
from typing import Final

from canbase_base.frame_socket import BusError
from canbase_commissioning.bus_monitor import Listener, ListenSession
from canbase_commissioning.can_interface import Link
from canbase_commissioning.onbus.bus_session import BusSession
from canbase_commissioning.onbus.cable import read_link
from canbase_commissioning.sdo_session import SdoSession
from canbase_config.robot import Robot
from canbase_doctor.bus_checks import IN_USE, BusEvidence
from canbase_doctor.inspection import Inspection, inspect
from canbase_driver.boot.node_boot import sdo_client

LISTEN_S: Final = 1.2
"""Long enough for heartbeats of a second."""
GAP_S: Final = 0.01
"""Between two questions to a node beside a running driver: its own come first."""


def look(robot: Robot) -> BusEvidence:
    """What is to be seen on the bus of `robot`. Sends SDO reads alone."""
    link = read_link(robot.bus.channel) if robot.bus.interface == "socketcan" else None
    try:
        line = BusSession(robot.bus)
    except BusError as error:
        return BusEvidence(robot, Listener(0.0), 0.0, str(error), link)
    with line:
        listening = ListenSession(LISTEN_S)
        line.run(listening)
        heard, now_s = copy.deepcopy(listening.heard), listening.now_s  # answers to our own requests are no evidence
        inquiry = ask(robot, listening.heard)
        line.run(inquiry)
        problem = line.problem
    return evidence(robot, heard, now_s, inquiry, problem, link)


def ask(robot: Robot, heard: Listener) -> SdoSession[Inspection]:
    """The reading of all nodes."""
    by_node = {d.node_id: tuple(e for e in robot.drives if e.node_id == d.node_id) for d in robot.drives}
    return SdoSession(
        {node_id: inspect(node_id, drives, robot) for node_id, drives in by_node.items()},
        heard,
        lambda node_id: sdo_client(node_id, by_node[node_id][0].kind.sdo, robot.timeouts.sdo_s),
        gap_s=GAP_S if heard.driver_lives else 0.0,
    )


def evidence(
    robot: Robot, heard: Listener, now_s: float, inquiry: SdoSession[Inspection], problem: str, link: Link | None
) -> BusEvidence:
    """What came of it."""
    unread = {
        node_id: IN_USE if task.blocked else str(task.error)
        for node_id, task in inquiry.tasks.items()
        if task.result is None
    }
    found = {node_id: task.result for node_id, task in inquiry.tasks.items() if task.result is not None}
    return BusEvidence(robot, heard, now_s, problem, link, found, unread)
