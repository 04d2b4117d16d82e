"""The states of motor_driver, as canbase/msg/DriverStatus numbers them: for the driver and its listeners."""

from __future__ import annotations

from enum import IntEnum


class DriverState(IntEnum):
    """State of the whole driver."""

    OFFLINE = 0
    BOOTING = 1
    DISARMED = 2
    ENABLING = 3
    ENABLED = 4
    """The only one in which commands move the wheels."""
    STOPPING = 5
    LATCHED = 6

    @property
    def word(self) -> str:
        """In a sentence."""
        return self.name.lower()

    @property
    def passes(self) -> bool:
        """On its way: of a healthy robot it ends by itself. OFFLINE, DISARMED and LATCHED wait for something else."""
        return self in _PASSING


def driver_state(number: int) -> DriverState:
    """The state with this number; one that is not in the interface counts as offline."""
    return DriverState(number) if number in _NUMBERS else DriverState.OFFLINE


_NUMBERS = frozenset(DriverState)
_PASSING = frozenset({DriverState.BOOTING, DriverState.ENABLING, DriverState.STOPPING})
