"""Whether the base can move now, as far as the mux knows: the drives are enabled, and no emergency stop holds.

Unknown is not ready: before the first motor_driver/status, and when it is older than its timeout. A driver that counts
its cycles from the start again was restarted: that is not ready either, also when it is enabled already.
"""

from __future__ import annotations

from canbase_config.robot import Rates
from canbase_config.state_age import status_period_s
from canbase_runtime.driver_state import DriverState
from canbase_runtime.received import NEVER, Received

STATUS_TIMEOUT_S = 0.5
STATUS_PERIODS = 2.5
"""A status counts for STATUS_TIMEOUT_S, or for this many of its periods where it is published seldom."""
ESTOP_HOLDS = "the emergency stop is pressed or not reset"


def status_timeout_s(rates: Rates) -> float:
    """How long one motor_driver/status counts [s]."""
    return max(STATUS_TIMEOUT_S, STATUS_PERIODS * status_period_s(rates))


class BaseReady:
    """What is known of driver and emergency stop. Starts with nothing: not ready."""

    def __init__(self, timeout_s: float = STATUS_TIMEOUT_S) -> None:
        self._timeout_s = timeout_s
        self._status: Received[DriverState] = NEVER
        self._cycles = 0
        self._estop_free = False

    def on_driver(self, state: DriverState, cycles: int, received: float) -> bool:
        """Takes a motor_driver/status: its state and cycle counter. True: the driver was restarted."""
        restarted = cycles < self._cycles
        self._status, self._cycles = Received(state, received), cycles
        return restarted

    def state(self, now_s: float) -> DriverState:
        """Of the last motor_driver/status; offline at `now_s` [s, monotonic] when that is too old, or never came."""
        return self._status.within(self._timeout_s, now_s) or DriverState.OFFLINE

    def on_estop(self, free: bool) -> None:
        """Takes what the safety filter knows of the emergency stop. False: it holds, or waits for a reset or a zero."""
        self._estop_free = free

    def problem(self, now_s: float) -> str:
        """Why the base cannot move at `now_s` [s, monotonic]; empty: it can."""
        if self._status.never:
            return "nothing received on motor_driver/status yet"
        state = self._status.within(self._timeout_s, now_s)
        if state is None:
            return "no recent message on motor_driver/status"
        if state is not DriverState.ENABLED:
            return f"motor_driver is {state.name}"
        return "" if self._estop_free else ESTOP_HOLDS
