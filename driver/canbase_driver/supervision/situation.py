"""What is measured at one cycle of the driver, and what was requested of it: all that the state machine decides by."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_runtime.watchdog_view import WatchdogView


@dataclass(frozen=True, slots=True)
class Situation:
    """What is measured at one cycle. The sentences name joint, node and values; empty: not so."""

    bus: str = ""  # the bus failed
    booting: str = ""  # what is still waited for
    missing: str = ""  # a drive that could not be booted for timeouts.boot_s
    unproven: str = ""  # a drive is not proven to stop by itself, and must be
    fault: str = ""  # a drive is in fault or fault reaction
    absent: str = ""  # a node restarted, or is not in NMT operational
    silent: str = ""  # statusword or heartbeat too old
    disabled: str = ""  # an axis is not in operation enabled
    unprepared: str = ""  # an axis is not switched on yet: STO open, no main voltage
    unarmed: str = ""  # the records on disk are not LIVE yet
    watchdog: WatchdogView = WatchdogView.OK
    watchdog_detail: str = ""
    watchdog_about_drive: bool = False  # it tripped because a drive sent nothing or was down
    commanded: str = ""  # a fresh command orders motion
    stalled: str = ""  # much torque, no speed, though motion is ordered
    wrapping: str = ""  # a position wraps, and the odometry misses travel
    overdue: str = ""  # zero was ordered, and the wheels still turn
    standstill: bool = True  # measured, on all wheels
    turning: str = ""  # which wheel does not stand
    speed_mps: float = 0.0  # of the fastest wheel, measured
    braking_mps: float = 0.0  # of the fastest one with power and fresh feedback
    begin_mps: float = 0.0  # the same, or what it was ordered last where that is more
    turn_radps: float = 0.0  # of the base, ordered last
    doubted: str = ""  # a wheel's sensors are no evidence of anything
    powered: bool = False  # some axis may produce torque
    unconfigured: str = ""  # the node's lifecycle: nothing may be sent
    inactive: str = ""  # the node's lifecycle: nothing may have power
    resetting: bool = False
    stop_requested: bool = False
    shutdown_requested: bool = False

    @property
    def unready(self) -> str:
        """A drive that is being booted, must be booted or sends nothing: nothing of it is measured."""
        return self.booting or self.absent or self.silent
