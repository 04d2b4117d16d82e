"""`canbase bus emcy` on the bus. What is read and said is decided in `error_history.py`."""

from __future__ import annotations

from collections.abc import Mapping

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.error_history import clear_history, read_history
from canbase_commissioning.onbus.alone import alone, confirmed, run_alone
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.onbus.params_command import listen
from canbase_commissioning.onbus.params_source import result_of, sdo_session
from canbase_commissioning.parameters.reading import read_identity
from canbase_config.profile_file import guess, load_profile
from canbase_config.robot import Bus, Robot
from canbase_runtime.terminal import FAILED, CommandError, fail


def run_emcy(bus: Bus, robot: Robot | None, node: int, timeout_s: float) -> None:
    """Prints the errors of one drive; exits with 1 when it does not answer, or keeps no history."""
    with open_line(bus) as line:
        heard = listen(line)
        makers = _makers(line, heard, robot, node, timeout_s)
        session = sdo_session(node, read_history(), heard, timeout_s)
        line.run(session)
        history = result_of(session.tasks[node], line)
    for text in history.lines(makers):
        print(f"node {node}: {text}")
    if history.entries is None:
        raise CommandError("", FAILED)


def _makers(line: BusSession, heard: Listener, robot: Robot | None, node: int, timeout_s: float) -> Mapping[int, str]:
    """The manufacturer's codes in words: of the profile in robot.yaml, or of the one that knows the drive."""
    for drive in robot.drives if robot else ():
        if drive.node_id == node:
            return drive.kind.emcy
    asked = sdo_session(node, read_identity(), heard, timeout_s)
    line.run(asked)
    identity = asked.tasks[node].result
    profile = guess(identity.vendor_id, identity.product_code) if identity else None
    return load_profile(profile).emcy if profile else {}


def run_clear(bus: Bus, node: int, timeout_s: float, *, yes: bool) -> None:
    """Empties 1003h; exits with 1 when the drive does not do it, or a master is on the bus."""
    with alone(bus) as (line, heard):
        if not confirmed(f"Node {node} forgets its error history for good. Go on?", yes=yes):
            fail("nothing changed", FAILED)
        session = sdo_session(node, clear_history(), heard, timeout_s)
        if masters := run_alone(line, heard, session):
            fail(f"{masters}: whether the history is empty is unknown", FAILED)
        refused = result_of(session.tasks[node], line)
    if refused:
        fail(f"node {node}: the history is not cleared: {refused}", FAILED)
    print(f"node {node}: the history is empty")
