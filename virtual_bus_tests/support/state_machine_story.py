"""A state machine stepped every 10 ms, and every situation that is wrong."""

from __future__ import annotations

from dataclasses import replace

from canbase_config.load import load_robot, sample
from canbase_driver.cia402 import PowerGoal
from canbase_driver.motion.braking import Braking
from canbase_driver.supervision.phases import Drive, Orders
from canbase_driver.supervision.situation import Situation
from canbase_driver.supervision.state_machine import StateMachine
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView

OFFLINE, BOOTING, DISARMED, ENABLING, ENABLED, STOPPING, LATCHED = DriverState
OFF, ON = Orders(PowerGoal.OFF, Drive.ZERO), Orders(PowerGoal.ON, Drive.ZERO)
FOLLOW, RAMP = Orders(PowerGoal.ON, Drive.FOLLOW), Orders(PowerGoal.ON, Drive.RAMP)
QUICK = Orders(PowerGoal.QUICK_STOP, Drive.ZERO)

READY = Situation(disabled="left is switch on disabled")
"""Without power, and nothing in the way of it."""
RUNNING = Situation(powered=True, standstill=False, turning="left turns", speed_mps=0.5, begin_mps=0.5)
"""Enabled, and turning at a speed that does not fall, whatever is ordered."""
STANDING = Situation(powered=True)

WRONG: dict[str, Situation] = {
    "bus failed": Situation(bus="bus-off"),
    "drive fault": Situation(fault="left: over-current"),
    "drive restarted": Situation(absent="node 1 restarted"),
    "booting": Situation(booting="waiting for node 1"),
    "drive silent": Situation(silent="node 1: no status"),
    "drive missing": Situation(missing="node 1 is missing"),
    "stop unproven": Situation(unproven="left_wheel: no proof"),
    "watchdog tripped": Situation(watchdog=WatchdogView.TRIPPED, watchdog_detail="lease lost"),
    "watchdog missing": Situation(watchdog=WatchdogView.MISSING, watchdog_detail="not heard yet"),
    "resetting": Situation(resetting=True),
    "drive disabled": Situation(disabled="left is switched on"),
    "stalled": Situation(stalled="left stalls"),
    "feedback implausible": Situation(wrapping="left wraps"),
    "did not stop": Situation(overdue="left turns"),
    "command not zero": Situation(commanded="0.3 m/s"),
    "not standing": Situation(standstill=False, turning="left turns"),
    "stop requested": Situation(stop_requested=True),
    "not configured": Situation(unconfigured="lifecycle: unconfigured"),
    "inactive": Situation(inactive="lifecycle: not active"),
    "shutdown": Situation(shutdown_requested=True),
}


def also(base: Situation, wrong: Situation) -> Situation:
    """`base`, and what is not as usual in `wrong`."""
    usual = Situation()
    fields = {name: getattr(wrong, name) for name in Situation.__dataclass_fields__}
    return replace(base, **{name: value for name, value in fields.items() if value != getattr(usual, name)})


class Story:
    """A state machine with a ramp of at most 3 s, stepped every 10 ms: 1 m/s², 0.12 s of lag."""

    def __init__(self) -> None:
        self.state_machine = StateMachine(Braking(load_robot(sample("bench")).robot), ramp_timeout_s=3.0)
        self.now_s = 10.0

    def step(self, situation: Situation, cycles: int = 1) -> Orders:
        for _ in range(cycles):
            self.now_s += 0.01
            orders = self.state_machine.step(situation, self.now_s)
        return orders

    def lasts(self, situation: Situation, orders: Orders, longest_s: float = 10.0) -> float:
        """How long it gives these orders [s]."""
        start = self.now_s
        while self.step(situation) == orders:
            assert self.now_s - start < longest_s
        return round(self.now_s - start, 3)

    @property
    def told(self) -> tuple[DriverState, str, bool]:
        """State, cause, and whether it needs a reset."""
        return self.state_machine.state, self.state_machine.finding.cause.value, self.state_machine.latches


def at(state: DriverState, wheels: Situation = STANDING) -> Story:
    """A state machine that has got into this state in the ordinary way."""
    story = Story()
    ways: dict[DriverState, tuple[Situation, ...]] = {
        OFFLINE: (WRONG["bus failed"],),
        BOOTING: (WRONG["booting"],),
        DISARMED: (WRONG["command not zero"],),
        ENABLING: (READY,),
        ENABLED: (READY, wheels),
        STOPPING: (READY, wheels, also(wheels, WRONG["stop requested"])),
        LATCHED: (WRONG["drive fault"],),
    }
    for situation in ways[state]:
        story.step(situation)
    assert story.state_machine.state is state
    return story
