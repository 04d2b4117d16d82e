"""`canbase bus params restore`, `store` and `defaults`: what changes a drive, alone on the bus and after a question."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Final

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.nmt_session import NmtSession
from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.onbus.alone import alone, confirmed, run_alone
from canbase_commissioning.onbus.bus_session import BusSession
from canbase_commissioning.onbus.params_source import bar, read_drive, result_of, sdo_session
from canbase_commissioning.parameters.comparison import firmware_differs
from canbase_commissioning.parameters.dcf_reader import holds_values, read_parameters
from canbase_commissioning.parameters.guard import axes_of, why_not_now
from canbase_commissioning.parameters.parameter_kinds import why_no_setting
from canbase_commissioning.parameters.reading import objects_to_read
from canbase_commissioning.parameters.restore_plan import Plan, plan, why_another_product
from canbase_commissioning.parameters.restoring import Restored, restore
from canbase_commissioning.parameters.saved import Parameters
from canbase_commissioning.parameters.storing import Order, order
from canbase_commissioning.sdo_access import status_places
from canbase_config.eds_file import Eds, EdsError
from canbase_config.robot import Bus, Robot
from canbase_driver.cia301.nmt import NmtCommand, nmt
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, warn

STORE_TIMEOUT_S: Final = 10.0
"""A drive may write a flash memory before it answers."""
KEPT: Final = "The drive has them until its power goes or it is reset: canbase bus params store"


def read_dcf(path: Path, node: int | None) -> tuple[Parameters, Eds]:
    """The parameters of a file for a node. Exits with 2 for a file that has none."""
    try:
        saved, eds = read_parameters(path)
    except EdsError as error:
        fail(str(error), WRONG_INPUT)
    if not holds_values(eds):
        fail(
            f"{path} has no ParameterValue: it is an EDS, not a DCF that canbase bus params save has written",
            WRONG_INPUT,
        )
    target = node or saved.node_id
    if target is None:
        fail(f"{path} does not name a node id ([DeviceComissioning]): add --node", WRONG_INPUT)
    return saved.for_node(target, eds), eds


def run_restore(
    bus: Bus, robot: Robot | None, file: Path, node: int | None, timeout_s: float,
    *, yes: bool, other_firmware: bool, without_statusword: bool,
) -> None:  # fmt: skip
    """Writes what differs; exits with 1 when anything of the file is not in the drive at the end."""
    saved, eds = read_dcf(file, node)
    target = saved.node_id or 0
    status_at = axes_of(eds, status_places(target, robot))
    with alone(bus) as (line, heard):
        guard = sdo_session(target, why_not_now(status_at, without_statusword=without_statusword), heard, timeout_s)
        line.run(guard)
        if why := result_of(guard.tasks[target], line):
            fail(f"nothing written: {why}", FAILED)
        settings = [entry for entry in objects_to_read(eds) if _is_wanted(entry.index, entry.sub, saved, eds)]
        now = read_drive(line, heard, target, eds, timeout_s, settings)
        what = _planned(saved, now, eds)
        if what.orders and _agreed(saved, now, what, yes=yes, other_firmware=other_firmware):
            done = _restore(line, heard, target, what, status_at, timeout_s, without_statusword)
            _tell_restored(done)
    if not what.orders:
        print(f"nothing to write: {what.alike} objects have their value")
    if what.missing:
        fail(f"{len(what.missing)} objects of the file are not in the drive", FAILED)


def _is_wanted(index: int, sub: int, saved: Parameters, eds: Eds) -> bool:
    """Settings of the file, and the COB-ID of each PDO, which it needs to be switched off by."""
    return Address(index, sub) in saved.values and not why_no_setting(eds.objects[index, sub])


def _planned(saved: Parameters, now: Parameters, eds: Eds) -> Plan:
    if why := why_another_product(saved, now):
        fail(f"nothing written: {why}", FAILED)
    what = plan(saved, now, eds)
    for change in what.changes:
        print(str(change))
    for change, why in what.left:
        print(f"  stays: {change} ({why})")
    for at, why in what.missing:
        print(f"  not in the drive: {at} ({why})")
    return what


def _agreed(saved: Parameters, now: Parameters, what: Plan, *, yes: bool, other_firmware: bool) -> bool:
    firmware = firmware_differs(saved.identity, now.identity)
    if firmware:
        warn(f"other firmware: {firmware}. Objects may mean something else there")
        if not confirmed("Restore all the same?", yes=other_firmware, option="--other-firmware"):
            fail("nothing written", FAILED)
    if not confirmed(f"Write {len(what.changes)} objects of {now.source} ({now.identity})?", yes=yes):
        fail("nothing written", FAILED)
    return True


def _restore(
    line: BusSession, heard: Listener, node: int, what: Plan, status_at: tuple[Address, ...], timeout_s: float,
    without_statusword: bool,
) -> Restored:  # fmt: skip
    if what.maps_pdos:
        line.run(NmtSession([nmt(NmtCommand.ENTER_PRE_OPERATIONAL, node)], heard))
        print(f"node {node}: NMT pre-operational, because PDOs change")
    so_far = Restored(len(what.orders))
    steps = restore(what, status_at, so_far, without_statusword=without_statusword)
    session = sdo_session(node, steps, heard, timeout_s)
    with bar(f"node {node}", so_far.total) as show:
        masters = run_alone(line, heard, session, lambda: show(so_far.orders))
    if session.tasks[node].blocked:
        so_far.stopped = "another program uses its SDO channel"
    return replace(so_far, stopped=masters or so_far.stopped)


def _tell_restored(done: Restored) -> None:
    print(f"{len(done.written)} objects written and read back")
    for change, why in done.failed:
        print(f"  not written: {change} ({why})", file=sys.stderr)
    if done.stopped:
        fail(f"stopped: {done.stopped}", FAILED)
    if done.failed:
        fail(f"{len(done.failed)} writes were refused", FAILED)
    print(KEPT)


def run_order(
    bus: Bus, robot: Robot | None, node: int, what: Order, group: str, *, yes: bool, without_statusword: bool
) -> None:
    """1010h or 1011h; exits with 1 when the drive does not do it."""
    texts = {
        Order.STORE: (f"Node {node} keeps its present parameters ({group}) over a power cycle, in place of those that "
                      "it has stored. Go on?", "stored"),
        Order.DEFAULTS: (f"Node {node} gets its manufacturer's parameters ({group}) with its next reset: units, "
                         "limits and its node id may be others then. Go on?", "the defaults come with its next reset: "
                         f"canbase bus nmt {node} reset, or a power cycle"),
    }  # fmt: skip
    question, told = texts[what]
    status_at = status_places(node, robot)
    with alone(bus) as (line, heard):
        if not confirmed(question, yes=yes):
            fail("nothing changed", FAILED)
        steps = order(what, group, status_at, without_statusword=without_statusword)
        session = sdo_session(node, steps, heard, STORE_TIMEOUT_S, attempts=1)
        masters = run_alone(line, heard, session)
        if masters:
            fail(f"{masters}: whether node {node} has done it is unknown", FAILED)
        done = result_of(session.tasks[node], line)
    if done.refused:
        fail(f"node {node}: nothing changed: {done.refused}", FAILED)
    print(f"node {node}: {told}")
