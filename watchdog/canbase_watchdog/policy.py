"""When the watchdog trips: an ordered table of checks on what the bus and the leases say. What it does then: ladder.py.

Each check names when it trips, and when its cause still stands, which keeps a reset away.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.observer import Axis, Node, View


class Cause(enum.IntEnum):
    """Byte 1 of the state frame. The numbers between are kept free by docs/bus.md."""

    NONE = 0
    LEASE_LOST = 1
    DRIVER_SILENT = 2
    DRIVE_SILENT = 3
    LOOP_LATE = 10
    ENDED = 11


@dataclass(frozen=True, slots=True)
class Verdict:
    """Why to trip: the cause, the node that it is about (0: none), and one sentence with the values."""

    cause: Cause = Cause.NONE
    node_id: int = 0
    detail: str = ""


FINE = Verdict()


def moving(axis: Axis, config: WatchdogConfig) -> bool:
    """True for a wheel that turns under power. One that is pushed by hand, its power off, may turn."""
    return axis.powered and abs(axis.velocity_mps) > config.standstill_mps


def commanded(axis: Axis, config: WatchdogConfig) -> bool:
    """True for a wheel that is ordered to turn: enabled, or told to be while it tells nothing itself."""
    unheard = axis.asks_for_power and axis.command_at >= axis.status_at + config.feedback_timeout_s
    return axis.target_mps != 0.0 and (axis.enabled or unheard)


def in_motion(view: View, config: WatchdogConfig) -> Axis | None:
    """The first wheel that turns or is ordered to, None: all rest."""
    return next((axis for axis in view.axes if moving(axis, config) or commanded(axis, config)), None)


def velocity_ordered(view: View, config: WatchdogConfig, now: float) -> bool:
    """True while the driver's setpoints or the filter's leases of the last moments order anything but zero."""
    recent = now - config.lease_timeout_s
    by_setpoint = any(axis.target_mps != 0.0 and axis.command_at > recent for axis in view.axes)
    return by_setpoint or (view.lease is not None and view.lease.orders_motion and view.lease_at > recent)


def _lease_is_lost(view: View, config: WatchdogConfig, now: float) -> bool:
    return now >= max(view.lease_at, view.started_at) + config.lease_timeout_s


def _lease_lost(view: View, config: WatchdogConfig, now: float) -> Verdict:
    axis = in_motion(view, config)
    if axis is None or not _lease_is_lost(view, config, now):
        return FINE
    detail = (
        f"no valid lease for {now - view.lease_at:.3f} s (allowed {config.lease_timeout_s:.3f} s) while "
        f"{axis.drive.joint} turns at {axis.velocity_mps:.3f} m/s, ordered {axis.target_mps:.3f} m/s"
    )
    return Verdict(Cause.LEASE_LOST, 0, detail)


def _driver_is_silent(view: View, since: float, config: WatchdogConfig, now: float) -> bool:
    """Its heartbeat or its SYNC is missing: both come from its control loop itself."""
    return now >= max(min(view.driver_at, view.sync_at), since) + config.drive_heartbeat_s


def _driver_silent(view: View, config: WatchdogConfig, now: float) -> Verdict:
    for axis in view.axes:
        if axis.enabled and _driver_is_silent(view, max(axis.enabled_since, view.started_at), config, now):
            detail = (
                f"driver's heartbeat is {now - view.driver_at:.3f} s old, its SYNC {now - view.sync_at:.3f} s "
                f"(allowed {config.drive_heartbeat_s:.3f} s) while {axis.drive.joint} is enabled"
            )
            return Verdict(Cause.DRIVER_SILENT, 0, detail)
    return FINE


def _driver_still_silent(view: View, node_id: int, config: WatchdogConfig, now: float) -> bool:
    return now >= view.driver_at + config.drive_heartbeat_s


def _unfed(axis: Axis, view: View, config: WatchdogConfig, now: float) -> bool:
    """SYNCs go on and its TPDOs do not answer them."""
    synced = now < view.sync_at + config.feedback_timeout_s
    return synced and now >= max(axis.fed_at, axis.enabled_since, view.sync_since) + config.feedback_timeout_s


def _beatless(node: Node, axis: Axis, config: WatchdogConfig, now: float) -> bool:
    return now >= max(node.heartbeat_at, axis.enabled_since) + config.drive_heartbeat_s


def _drive_silent(view: View, config: WatchdogConfig, now: float) -> Verdict:
    for axis in view.axes:
        node = view.node(axis.drive.node_id)
        if axis.enabled and (_unfed(axis, view, config, now) or _beatless(node, axis, config, now)):
            detail = (
                f"{axis.drive.joint} is enabled, its feedback is {now - axis.fed_at:.3f} s old (allowed "
                f"{config.feedback_timeout_s:.3f} s), its heartbeat {now - node.heartbeat_at:.3f} s "
                f"(allowed {config.drive_heartbeat_s:.3f} s)"
            )
            return Verdict(Cause.DRIVE_SILENT, node.node_id, detail)
    return FINE


def _loop_late(view: View, config: WatchdogConfig, now: float) -> Verdict:
    if view.tick_gap_s <= config.loop_late_s or not any(axis.enabled for axis in view.axes):
        return FINE
    detail = f"own loop stood still for {view.tick_gap_s:.3f} s (allowed {config.loop_late_s:.3f} s)"
    return Verdict(Cause.LOOP_LATE, 0, detail)


@dataclass(frozen=True, slots=True)
class Check:
    """One row: `trips` finds the cause; `stands` tells, for the node that it was about, whether it is still there."""

    cause: Cause
    trips: Callable[[View, WatchdogConfig, float], Verdict]
    stands: Callable[[View, int, WatchdogConfig, float], bool]


CHECKS = (
    Check(Cause.LEASE_LOST, _lease_lost, lambda view, node_id, config, now: _lease_is_lost(view, config, now)),
    Check(Cause.DRIVER_SILENT, _driver_silent, _driver_still_silent),
    Check(
        Cause.DRIVE_SILENT,
        _drive_silent,
        lambda view, node_id, config, now: now >= view.node(node_id).heard_at + config.drive_heartbeat_s,
    ),
    Check(Cause.LOOP_LATE, _loop_late, lambda view, node_id, config, now: False),
)
"""The first row that trips is the cause. A cause without a row does not stand: nothing of it is left to see."""


def decide(view: View, config: WatchdogConfig, now: float) -> Verdict:
    """The first cause to trip in what is seen at the monotonic time `now` [s], or FINE."""
    for check in CHECKS:
        verdict = check.trips(view, config, now)
        if verdict.cause is not Cause.NONE:
            return verdict
    return FINE


def stands(verdict: Verdict, view: View, config: WatchdogConfig, now: float) -> bool:
    """True while the cause of a trip is still there at the monotonic time `now` [s]."""
    rows = (check for check in CHECKS if check.cause is verdict.cause)
    return any(check.stands(view, verdict.node_id, config, now) for check in rows)


def next_expiry(view: View, config: WatchdogConfig, now: float) -> float:
    """When the lease or the driver times out next if nothing comes [s]: a tick just then stops without delay."""
    ends = (
        view.lease_at + config.lease_timeout_s,
        view.driver_at + config.drive_heartbeat_s,
        view.sync_at + config.drive_heartbeat_s,
    )
    return min((end for end in ends if end > now), default=now + config.lease_timeout_s)
