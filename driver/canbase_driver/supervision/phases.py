"""The phases of the driver: the state that topics report in each, and what the core orders there."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from canbase_driver.cia402 import PowerGoal
from canbase_runtime.driver_state import DriverState


class Phase(Enum):
    """The phase of the driver. The state that topics report is in `SHOWN`, what it orders there in `ORDERS`."""

    __hash__ = object.__hash__  # that of Enum is written in Python, and tables are looked up in every cycle

    OFFLINE = "offline"
    BOOTING = "booting"
    DISARMED = "disarmed"
    PREPARING = "preparing"
    """Nothing forbids power but drives that are not switched on."""
    ARMING = "arming"
    """... but the records on disk, which are not LIVE yet."""
    ENABLING = "enabling"
    ENABLED = "enabled"
    RAMP = "ramp"
    QUICK_STOP = "quick stop"
    POWER_OFF = "power off"
    LATCHED = "latched"


WAITING = (Phase.OFFLINE, Phase.BOOTING, Phase.DISARMED, Phase.PREPARING, Phase.ARMING)
"""Without power, and without a stop that needs a reset."""
STOPPING = (Phase.RAMP, Phase.QUICK_STOP, Phase.POWER_OFF)
"""The way down."""
SHOWN = {
    **dict.fromkeys(WAITING, DriverState.DISARMED),
    Phase.OFFLINE: DriverState.OFFLINE,
    Phase.BOOTING: DriverState.BOOTING,
    Phase.ENABLING: DriverState.ENABLING,
    Phase.ENABLED: DriverState.ENABLED,
    **dict.fromkeys(STOPPING, DriverState.STOPPING),
    Phase.LATCHED: DriverState.LATCHED,
}
"""The state in canbase/msg/DriverStatus."""
NO_POWER = (DriverState.OFFLINE, DriverState.BOOTING, DriverState.DISARMED, DriverState.LATCHED)


class Drive(Enum):
    """What the setpoints do."""

    ZERO = "zero"
    FOLLOW = "follow the command"
    RAMP = "ramp to zero"


@dataclass(frozen=True, slots=True)
class Orders:
    """What the core does in this cycle."""

    goal: PowerGoal
    drive: Drive


ORDERS: dict[Phase, Orders] = {
    Phase.OFFLINE: Orders(PowerGoal.OFF, Drive.ZERO),
    Phase.BOOTING: Orders(PowerGoal.OFF, Drive.ZERO),
    Phase.DISARMED: Orders(PowerGoal.OFF, Drive.ZERO),
    Phase.PREPARING: Orders(PowerGoal.READY, Drive.ZERO),
    Phase.ARMING: Orders(PowerGoal.READY, Drive.ZERO),
    Phase.ENABLING: Orders(PowerGoal.ON, Drive.ZERO),
    Phase.ENABLED: Orders(PowerGoal.ON, Drive.FOLLOW),
    Phase.RAMP: Orders(PowerGoal.ON, Drive.RAMP),
    Phase.QUICK_STOP: Orders(PowerGoal.QUICK_STOP, Drive.ZERO),
    Phase.POWER_OFF: Orders(PowerGoal.OFF, Drive.ZERO),
    Phase.LATCHED: Orders(PowerGoal.OFF, Drive.ZERO),
}
