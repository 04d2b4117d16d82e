"""`canbase bus scan` on the bus, and its table. What is queried and concluded is in `commissioning`."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from typing import Final

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from canbase_commissioning.bus_monitor import OURS, Listener, ListenSession
from canbase_commissioning.identification import Identification
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.scan_rows import ScanRow, missing, scan_rows, silent, twins_advice
from canbase_config.robot import Bus, Robot
from canbase_driver.cia301.nmt import MAX_NODE_ID
from canbase_runtime.terminal import FAILED, agreed, fail, warn


def run(
    bus: Bus, robot: Robot | None, seconds: float, timeout_s: float, *, passive: bool, yes: bool, as_json: bool
) -> None:
    """Listens, reads, prints; exits with 1 when no node or not every node is there."""
    with open_line(bus) as line:
        listening = ListenSession(seconds)
        line.run(listening)
        heard = listening.heard
        masters = heard.masters(listening.now_s)
        asks = not passive and (not masters or _may_ask(masters, yes))
        roster = Identification(
            (n for n in range(1, MAX_NODE_ID + 1) if n not in OURS), heard, timeout_s, with_texts=not masters
        )
        if asks:
            line.run(roster)
        rows = scan_rows(heard.nodes, roster.cards, robot, roster.twins)
        problem = _bus_problem(line, rows)
        errors = line.error_frames
    _print(rows, as_json)
    _explain(roster, heard, errors)
    absent = missing(rows)
    if roster.twins:
        fail(twins_advice(roster.twins), FAILED)
    if problem or len(absent) == len(rows):
        cure = "check power, cable, termination, bit rate (canbase bus adopt searches it)"
        if bus.is_virtual:
            cure = "do the simulated drives run (canbase up, or canbase serve sim), on this bus?"
        fail(problem or f"no node sends or answers; {cure}", FAILED)
    if absent:
        fail(f"node {', '.join(map(str, absent))} of robot.yaml is not on the bus: power, cable, node id?", FAILED)


def _explain(roster: Identification, heard: Listener, errors: int) -> None:
    for text in silent(heard.nodes, roster.cards):
        print(text, file=sys.stderr)
    for reason in roster.lost.values():
        print(f"lost while it was read: {reason}", file=sys.stderr)
    if errors:
        advice = "two drives with one node id, cable, termination, or a drive with another bit rate (canbase bus adopt)"
        print(f"{errors} errors on the wire meanwhile: {advice}?", file=sys.stderr)


def _may_ask(masters: list[str], yes: bool) -> bool:
    """Somebody else commands this bus: our questions are harmless to it in most cases, not in all."""
    signs = "\n".join(f"  {sign}" for sign in masters)
    warn(f"another master is on this bus:\n{signs}")
    if yes:
        return True
    told = "scan would send SDO reads beside it; an answer to them may confuse a master that is asking the same node"
    if not sys.stdin.isatty():
        print(f"{told}. Listened only; use --yes to read anyway", file=sys.stderr)
        return False
    return agreed(f"{told}. Read anyway?")


def _bus_problem(line: BusSession, rows: list[ScanRow]) -> str:
    if line.problem:
        return line.problem
    if line.send_errors and not any(row.nmt_state for row in rows):
        return f"{line.send_errors} frames were not sent: no node acknowledges them (power, cable, bit rate?)"
    return ""


def _print(rows: list[ScanRow], as_json: bool) -> None:
    if as_json:
        print(json.dumps([asdict(row) for row in rows]))
    elif rows:
        Console().print(_table(rows))


_BROKEN: Final = ("what", "heartbeat", "identity")
"""Columns that a narrow terminal breaks; the names in the others are whole, because people copy them."""


def _table(rows: list[ScanRow]) -> Table:
    title = f"{len(rows)} nodes; identity: vendor:product:revision:serial (1018h, hexadecimal)"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, collapse_padding=True, pad_edge=False)
    for column in ("node", "what", "state", "heartbeat", "profile", "identity", "robot.yaml"):
        table.add_column(column, overflow="fold", no_wrap=column not in _BROKEN)
    for row in rows:
        identity = ":".join("–" if n is None else f"{n:X}" for n in _identity(row))
        joints = row.in_robot.replace(", ", "\n")
        cells = (str(row.node_id), row.what, row.nmt_state, row.heartbeat, row.profile or "–", identity, joints)
        table.add_row(*(Text(cell) for cell in cells))
    return table


def _identity(row: ScanRow) -> tuple[int | None, ...]:
    return row.vendor_id, row.product_code, row.revision, row.serial
