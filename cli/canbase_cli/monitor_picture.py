"""What `canbase monitor` shows, drawn from a snapshot: no ROS, no terminal, no clock. The shell is monitor.py."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final, TypeVar

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from canbase_driver.cia402 import DriveState
from canbase_runtime.driver_state import DriverState, driver_state
from canbase_runtime.last_message import NOT_RECEIVED, LastMessage
from canbase_runtime.source_standing import SourceStanding, lock_standing, source_standing
from canbase_runtime.stop_cause import StopCause, stop_cause
from canbase_runtime.watchdog_view import WatchdogView, watchdog_view

ACTIONS: Final = ("passes", "limits", "slows", "STOPS")
"""SafetyState.action in words."""
GOOD: Final = "green"
WARN: Final = "yellow"
BAD: Final = "bold red"

Named = TypeVar("Named", bound=Enum)


@dataclass(frozen=True, slots=True)
class Snapshot:
    """What is known of a robot at one moment. mux: MuxState, safety: SafetyState, driver: DriverStatus."""

    robot: str
    mux: LastMessage = NOT_RECEIVED
    safety: LastMessage = NOT_RECEIVED
    driver: LastMessage = NOT_RECEIVED
    event: LastMessage = NOT_RECEIVED
    """The last StopEvent."""


def picture(snapshot: Snapshot) -> RenderableType:
    """The whole screen."""
    return Group(
        Panel(
            headline(snapshot), title=f"canbase: {snapshot.robot}", subtitle="Ctrl-C ends the picture, not the robot"
        ),
        _part("Who may drive: velocity_mux", snapshot.mux, _mux),
        _part("What gets through: safety_filter", snapshot.safety, _safety),
        _part("The wheels: motor_driver and watchdog", snapshot.driver, _driver),
        _event(snapshot.event),
    )


def headline(snapshot: Snapshot) -> Text:
    """The one line that matters."""
    parts = [_mux_word(snapshot.mux), _safety_word(snapshot.safety), *_driver_words(snapshot.driver)]
    return Text("  |  ").join(parts)


def line(snapshot: Snapshot) -> str:
    """The headline and everything else that changes in steps, for an output that is no terminal. No ages, no speeds."""
    words = [headline(snapshot).plain]
    if snapshot.mux.fresh:
        words += [
            f"lock {lock.name} {lock_standing(lock.standing).word}" for lock in snapshot.mux.message.locks if lock.holds
        ]
        unexpected = snapshot.mux.message.foreign
        words += [f"foreign publisher {each.node} on {each.topic}: {each.problem}" for each in unexpected]
    if snapshot.driver.fresh:
        words += [f"{drive.joint} {drive.state}" for drive in snapshot.driver.message.drives]
    return "  |  ".join(words)


def _mux_word(last: LastMessage) -> Text:
    if not last.fresh:
        return _silence("velocity_mux", last)
    state = last.message
    holder = next((source for source in state.sources if source.active), None)
    if holder is None:
        return Text("no active source", WARN)
    if source_standing(holder.standing) is not SourceStanding.FOLLOWED:
        return Text(f"{holder.name} is not followed: {holder.reason}", BAD)
    return Text(f"{holder.name} drives", GOOD)


def _safety_word(last: LastMessage) -> Text:
    if not last.fresh:
        return _silence("safety_filter", last)
    action, cause = last.message.action, last.message.cause
    style = (GOOD, WARN, WARN, BAD)[action]
    none = stop_cause(cause) is StopCause.NONE
    return Text(f"filter {ACTIONS[action]}" + ("" if none else f": {cause}"), style)


def _driver_words(last: LastMessage) -> list[Text]:
    if not last.fresh:
        return [_silence("motor_driver", last)]
    status = last.message
    state = driver_state(status.state)
    style = {DriverState.ENABLED: GOOD, DriverState.LATCHED: BAD, DriverState.OFFLINE: BAD}.get(state, WARN)
    cause = "" if state is DriverState.ENABLED else f": {status.cause}"
    well = watchdog_view(status.watchdog) is WatchdogView.OK
    watchdog = Text(f"watchdog {status.watchdog}", GOOD if well else BAD)
    return [Text(f"driver {state.name}{cause}", style), watchdog]


def _part(title: str, last: LastMessage, draw: Callable[[Any], RenderableType]) -> Panel:
    """The last state of a node that no longer publishes is left out: it must not be taken for the present one."""
    body = draw(last.message) if last.fresh else _silence("the node", last)
    return Panel(body, title=title, title_align="left", border_style="none" if last.fresh else BAD)


def _silence(who: str, last: LastMessage) -> Text:
    return Text(f"{who}: {last.silence}", BAD)


def _mux(state: Any) -> RenderableType:
    table = _table("", "source", "age", "late by", "timeout", "refused", "why not")
    for source in state.sources:
        standing = source_standing(source.standing)
        style = GOOD if standing is SourceStanding.FOLLOWED else BAD if source.active else ""
        refused = Text(str(source.refused), BAD if source.refused else "")
        unarmed = "" if source.armed or standing is SourceStanding.UNARMED else "; needs a zero first"
        reason = "drives" if standing is SourceStanding.FOLLOWED else source.reason + unarmed
        times = (_seconds(source.age_s), _seconds(source.delay_s), _seconds(source.timeout_s))
        values = (str(source.priority), source.name, *times)
        table.add_row(*values, refused, reason, style=style)
    for lock in state.locks:
        limit = _seconds(lock.timeout_s) if lock.required else "none"
        times = (_seconds(lock.age_s), "", limit)
        style = BAD if lock.holds else ""
        table.add_row(str(lock.priority), f"lock {lock.name}", *times, "", lock.reason or "free", style=style)
    strangers = [Text(f"{found.node} publishes on {found.topic}: {found.problem}", BAD) for found in state.foreign]
    ready = [] if state.ready else [Text(f"The base cannot move: {state.not_ready}", WARN)]
    return Group(table, *ready, *strangers)


def _safety(state: Any) -> RenderableType:
    order = f"orders {state.ordered_linear_mps:+.2f} m/s  {state.ordered_angular_radps:+.2f} rad/s"
    free = f"free ahead {_metres(state.clearance_ahead_m)}, behind {_metres(state.clearance_behind_m)}"
    ages = f"command {_seconds(state.command_age_s)} old, scan {_seconds(state.scan_age_s)}"
    first = Text.assemble(_safety_word(LastMessage(state, 0.0)), f"   {order}   {free}   {ages}")
    leases = [Text(f"{state.lease_errors} leases were not delivered", WARN)] if state.lease_errors else []
    return Group(first, *_why(state), *map(_scanner, state.scanners), *leases)


def _scanner(scanner: Any) -> Text:
    share = "" if math.isnan(scanner.usable_share) else f", {scanner.usable_share:.0%} of its beams usable"
    dropped = f", {scanner.dropped} scans dropped" if scanner.dropped else ""
    problem = f": {scanner.problem}" if scanner.problem else ""
    style = (WARN if scanner.dropped else GOOD) if scanner.fresh else (BAD if scanner.required else WARN)
    return Text(f"scanner {scanner.topic} {_seconds(scanner.age_s)} old{share}{dropped}{problem}", style)


def _driver(status: Any) -> RenderableType:
    standing = "stands" if status.standstill else "MOVES"
    first = Text("   ").join([*_driver_words(LastMessage(status, 0.0)), Text(standing)])
    table = _table("node", "wheel", "NMT", "drive state", "target", "measured", "heartbeat", "error")
    for drive in status.drives:
        good = _member(DriveState, drive.state) is DriveState.OPERATION_ENABLED
        error = Text(f"{drive.error_code:04X}h {drive.error_text}" if drive.error_code else "", BAD)
        speeds = (f"{drive.target_radps:+.2f} rad/s", f"{drive.velocity_radps:+.2f} rad/s")
        state = Text(drive.state, GOOD if good else WARN)
        table.add_row(
            str(drive.node_id), drive.joint, drive.nmt_state, state, *speeds, _seconds(drive.heartbeat_age_s), error
        )
    tripped = watchdog_view(status.watchdog) is WatchdogView.TRIPPED
    trip = [Text(f"watchdog: {status.watchdog_cause}", BAD)] if tripped else []
    return Group(first, *_why(status), *trip, table)


def _why(state: Any) -> list[Text]:
    """Detail and what ends it, where there is something to end."""
    clears = f"; ends with: {state.clears_on}" if state.clears_on else ""
    return [Text(f"{state.detail}{clears}", WARN)] if state.detail or clears else []


def _event(last: LastMessage) -> Text:
    if last.age_s is None:
        return Text("No stop since this picture was opened.", "dim")
    event = last.message
    latched = ", latched" if event.latched else ""
    return Text(f"Last stop, {last.age_s:.0f} s ago: {event.stopped_by}: {event.cause}{latched}. {event.detail}")


def _member(kind: type[Named], text: str) -> Named | None:
    """The state that a message names in words; None: this canbase knows none of that name."""
    return next((member for member in kind if member.value == text), None)


def _table(*titles: str) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in titles:
        table.add_column(title, no_wrap=title not in ("why not", "error"))
    return table


def _seconds(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.2f} s"


def _metres(value: float) -> str:
    if math.isnan(value):
        return "unknown"
    return "all" if math.isinf(value) else f"{value:.2f} m"
