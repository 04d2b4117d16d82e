"""Which wheels turn, are ordered to, have power or are off, by what the watchdog sees. What follows: policy.py."""

from __future__ import annotations

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.frames import DriveState
from canbase_watchdog.view import NEVER, Axis, View


def moving(axis: Axis, config: WatchdogConfig) -> bool:
    """True for a wheel that turns under power. One that is pushed by hand, its power off, may turn."""
    return axis.powered and not axis.standing


def commanded(axis: Axis, config: WatchdogConfig) -> bool:
    """True for a wheel that is ordered to turn: enabled, or ordered to be while it reports nothing itself."""
    unreported = axis.asks_for_power and axis.command_at >= axis.status_at + config.feedback_timeout_s
    return axis.target_mps != 0.0 and (axis.enabled or unreported)


def in_motion(view: View, config: WatchdogConfig) -> Axis | None:
    """The first wheel that turns or is ordered to, None: all rest."""
    for axis in view.axes:
        if moving(axis, config) or commanded(axis, config):
            return axis
    return None


def near_power(axis: Axis) -> bool:
    """It has power, is ordered to, or is one step before it: from here on the record on disk must be LIVE."""
    return axis.powered or axis.state is DriveState.SWITCHED_ON or axis.asks_for_power


def is_off(axis: Axis, view: View, config: WatchdogConfig, now_s: float) -> bool:
    """Fresh feedback shows it, or there is no such drive."""
    if near_power(axis):
        return False
    reported = axis.state is not None and now_s < axis.status_at + config.feedback_timeout_s
    return reported or view.node(axis.drive.node_id).last_frame_at == NEVER


def velocity_ordered(view: View, config: WatchdogConfig, now_s: float) -> bool:
    """True while the driver's setpoints or the filter's leases of the last moments order anything but zero."""
    recent = now_s - config.lease_timeout_s
    by_setpoint = any(axis.target_mps != 0.0 and axis.command_at > recent for axis in view.axes)
    return by_setpoint or (view.lease is not None and view.lease.orders_motion and view.lease_at > recent)
