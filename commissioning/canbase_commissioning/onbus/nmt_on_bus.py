"""`canbase bus nmt` on the bus: asks, sends, and shows what the nodes report. See `nmt_command.py`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from canbase_commissioning.bus_monitor import OURS, Listener, ListenSession
from canbase_commissioning.nmt_command import NodePower, Order, outcome, power_of
from canbase_commissioning.nmt_session import NmtSession
from canbase_commissioning.onbus.alone import alone, confirmed
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.sdo_access import status_places
from canbase_commissioning.sdo_session import SdoSession
from canbase_config.robot import Bus, Robot
from canbase_driver.cia301.nmt import ALL_NODES, nmt
from canbase_driver.cia301.sdo_client import SdoClient
from canbase_runtime.terminal import FAILED, CommandError, fail, warn

LISTEN_S: Final = 1.0
WATCH_S: Final = 5.0
"""A heartbeat comes within it, also from slow drives and on a loaded computer."""
SILENT_S: Final = 2.0
"""The same where no node has sent a heartbeat before."""
RESET_S: Final = 8.0
"""A drive has started anew by then."""
ATTEMPTS: Final = 3


def run_nmt(
    bus: Bus, robot: Robot | None, node: int, order: Order, timeout_s: float, *, force: bool, yes: bool
) -> None:
    """`node` 0: all nodes. Exits with 1 when it is refused, or a node has not obeyed."""
    with _bus(bus, force) as (line, heard):
        nodes = [node] if node else _nodes(heard, robot)
        if not nodes:
            fail("no node is on the bus, as far as it shows; name one", FAILED)
        powers = _powers(line, heard, nodes, robot, timeout_s)
        for power in powers:
            print(str(power))
        whom = f"node {node}" if node else f"all nodes ({', '.join(map(str, nodes))})"
        print(f"NMT {order.value} to {whom}: {order.effect}")
        needs_a_person = any(power.needs_a_person for power in powers)
        if needs_a_person and not confirmed("A motor may have power. Send it?", yes=yes):
            fail("nothing sent", FAILED)
        beats = any(each.heartbeats_at for each in heard.nodes.values())
        after = _send(line, node, order, nodes, WATCH_S if beats else SILENT_S)
    _tell(order, nodes, after)


@contextmanager
def _bus(bus: Bus, force: bool) -> Iterator[tuple[BusSession, Listener]]:
    """Alone on it; by force beside whoever is there."""
    if not force:
        with alone(bus) as found:
            yield found
        return
    with open_line(bus) as line:
        listening = ListenSession(LISTEN_S)
        line.run(listening)
        for sign in listening.heard.masters(listening.now_s):
            warn(f"another master is on this bus: {sign}")
        yield line, listening.heard


def _nodes(heard: Listener, robot: Robot | None) -> list[int]:
    ours = {drive.node_id for drive in robot.drives} if robot else set()
    return sorted((set(heard.nodes) | ours) - set(OURS))


def _powers(
    line: BusSession, heard: Listener, nodes: list[int], robot: Robot | None, timeout_s: float
) -> list[NodePower]:
    steps = {node: power_of(node, status_places(node, robot)) for node in nodes}
    session = SdoSession(steps, heard, lambda node_id: SdoClient(node_id, timeout_s, ATTEMPTS))
    line.run(session)
    unseen = "another program uses its SDO channel"
    return [task.result or NodePower(node, {}, unknown=unseen) for node, task in session.tasks.items()]


def _send(line: BusSession, node: int, order: Order, nodes: list[int], watch_s: float) -> Listener:
    """What was received since the command: until all nodes have obeyed, or for the longest time."""
    is_reset = order in (Order.RESET, Order.RESET_COMM)
    frame = nmt(order.command, node or ALL_NODES)
    session = NmtSession([frame], Listener(0.0), RESET_S if is_reset else watch_s)
    while not session.done:
        line.turn(session)
        found = [session.heard.nodes.get(each) for each in nodes]
        if all(each is not None and each.nmt_state in order.reached for each in found):
            break
    return session.heard


def _tell(order: Order, nodes: list[int], after: Listener) -> None:
    outcomes = [outcome(order, after.nodes.get(each), each) for each in nodes]
    for _, text in outcomes:
        print(text)
    if not all(obeyed for obeyed, _ in outcomes):
        raise CommandError("", FAILED)
