"""Each stop of a recording: its first cause, who caught it, and what every part did then. Pure.

The table RULES is what this package is for. How it is read:
1. The first part that reacts begins a stop; what a rule looks at lies before that. What comes later is a consequence.
2. Rows stand in the order of cause and effect: who orders a stop comes before what breaks, the bus before the drives on
   it, the drives before what their sensors show, and what parts report without anything to be seen comes last.
3. The first row that has evidence names the first cause. Other rows that have evidence too are reported beside it.
4. No evidence is not "nothing": the story says "reported only", or "cannot tell". What has no time in the recording is
   no evidence: before its first sample nothing can be seen to end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from canbase_driver.causes import DriverCause
from canbase_recording import evidence_bus as bus
from canbase_recording import evidence_drive as drive
from canbase_recording import evidence_masters as masters
from canbase_recording import evidence_motion as motion
from canbase_recording import evidence_orders as orders
from canbase_recording.cause import ADVICE, Cause, Found
from canbase_recording.event import Event, EventKind, Level
from canbase_recording.scene import Scene
from canbase_recording.standstill import Standstill, standstill_of


@dataclass(frozen=True, slots=True)
class Rule:
    """One possible first cause, and what shows it; None: nothing does."""

    cause: Cause
    seen: Callable[[Scene], Found | None]


RULES: Final = (
    # who orders a stop: a person, or a part that did its work
    Rule(Cause.EMERGENCY_STOP, orders.filter_stops(orders.ESTOP)),
    Rule(Cause.BUTTON_SILENT, orders.filter_stops(orders.BUTTON)),
    Rule(Cause.SCANNER, orders.filter_stops(orders.SCANNER)),
    Rule(Cause.OBSTACLE, orders.filter_stops(orders.OBSTACLE)),
    Rule(Cause.FILTER, orders.filter_stops(orders.OTHER)),
    Rule(Cause.SOURCE_LOST, orders.source_lost),
    Rule(Cause.STOP_REQUESTED, orders.driver_reports(DriverCause.STOP_REQUESTED)),
    Rule(Cause.SHUTDOWN, orders.driver_reports(DriverCause.SHUTDOWN)),
    Rule(Cause.DEACTIVATED, orders.driver_reports(DriverCause.INACTIVE)),
    Rule(Cause.WATCHDOG_ENDED, bus.watchdog_ended),
    # who is on the bus, and who is not any more
    Rule(Cause.RECORDER_PAUSED, bus.recorder_paused),
    Rule(Cause.ADAPTER_FAILED, orders.driver_reports(DriverCause.BUS_FAILED)),
    Rule(Cause.SECOND_MASTER, masters.second_master),
    Rule(Cause.NMT_COMMAND, masters.nmt_command),
    Rule(Cause.TWIN_NODE, masters.twin_node),
    Rule(Cause.NODE_RESTARTED, bus.node_restarted),
    Rule(Cause.DRIVER_SILENT, bus.driver_silent),
    Rule(Cause.WATCHDOG_SILENT, bus.watchdog_silent),
    Rule(Cause.BUS_CUT, bus.bus_cut),
    Rule(Cause.NODE_SILENT, bus.node_silent),
    Rule(Cause.DRIVES_DEAF, bus.drives_deaf),
    Rule(Cause.FEEDBACK_LOST, bus.feedback_lost),
    Rule(Cause.BUS_ERRORS, bus.bus_errors),
    # what a drive reports about itself
    Rule(Cause.DRIVE_FAULT, drive.drive_fault),
    Rule(Cause.DRIVE_DISABLED, drive.drive_disabled),
    # what reaches the drives, and what was ordered
    Rule(Cause.SETPOINTS_MISSING, drive.setpoints_missing),
    Rule(Cause.TWO_COMMANDERS, orders.two_commanders),
    Rule(Cause.SETPOINTS_KEPT, orders.setpoints_kept),
    Rule(Cause.LEASES_LOST, orders.leases_lost),
    Rule(Cause.COMMANDS_LOST, orders.commands_lost),
    # what the sensors of a wheel show
    Rule(Cause.ENCODER_JUMPS, motion.encoder_jumps),
    Rule(Cause.POSITION_STUCK, motion.position_stuck),
    Rule(Cause.VELOCITY_STUCK, motion.velocity_stuck),
    Rule(Cause.WRONG_WAY, motion.wrong_way),
    Rule(Cause.NO_MOTION, motion.no_motion),
    Rule(Cause.WHEEL_SLOW, motion.wheel_slow),
    Rule(Cause.WHEEL_RUNS_ON, motion.wheel_runs_on),
    # what a part says, and a master that takes the power away: the reason is not in the recording
    Rule(Cause.REPORTED, orders.reported),
    Rule(Cause.ORDERED_OFF, drive.ordered_off),
)

CATCHERS: Final = {
    EventKind.TRIP: "watchdog",
    EventKind.WATCHDOG: "watchdog",
    EventKind.DRIVER: "motor_driver",
    EventKind.FILTER: "safety_filter",
    EventKind.MUX: "velocity_mux",
    EventKind.DRIVE_STATE: "the drive itself",
    EventKind.CONTROL: "the master",
    EventKind.COMMAND: "motor_driver",
}
"""Parts that act. What only reports (EMCY, a heartbeat that is missing) catches nothing."""


@dataclass(frozen=True, slots=True)
class Story:
    """One stop. `also`: other things that the recording shows before it; `chain`: what happened, in order."""

    cause: Cause
    found: Found
    caught_by: str
    caught_s: float
    """When that part acted [s]; infinity: none did."""
    reported: str
    also: tuple[tuple[Cause, Found], ...]
    chain: tuple[Event, ...]
    standstill: Standstill
    scene: Scene

    @property
    def kind(self) -> str:
        """Stop; or Alarm: neither a drive nor a part that acts is in the recording; nothing shows a stop."""
        return "Stop" if self.caught_by or self.scene.drive_nodes else "Alarm"

    @property
    def advice(self) -> str:
        """What to look at first."""
        return ADVICE[self.cause]

    @property
    def caught(self) -> str:
        """Who acted, how long after the cause, and its reason; empty: nobody."""
        delay_ms = 1000.0 * (self.caught_s - self.found.at_s)
        return self.caught_by and f"{self.caught_by}, {delay_ms:.0f} ms later: {self.reported}"


def tell(scene: Scene) -> Story:
    """The story of one stop."""
    evidence = ((rule.cause, rule.seen(scene)) for rule in RULES)
    seen = [(cause, found) for cause, found in evidence if found is not None and math.isfinite(found.at_s)]
    cause, found = seen[0] if seen else _unknown(scene)
    chain = tuple(event for event in scene.events if event.at_s >= found.at_s - BEFORE_S)
    caught_by, caught_s, reported = _catcher(scene, chain, found.sender)
    return Story(
        cause=cause,
        found=found,
        caught_by=caught_by,
        caught_s=caught_s,
        reported=reported,
        also=tuple(each for each in seen[1:] if each[0] not in (Cause.REPORTED, Cause.ORDERED_OFF)),
        chain=chain,
        standstill=standstill_of(scene, found.at_s),
        scene=scene,
    )


BEFORE_S: Final = 0.001
"""A cause and the event that shows it may have one time."""


def _catcher(scene: Scene, chain: tuple[Event, ...], sender: str) -> tuple[str, float, str]:
    """The first part that acted, when, and what it gave as its reason. A missing message is noticed before.

    `sender`: of the quick stops on the watchdog's PDOs; empty: the watchdog.
    """
    first = next((event for event in chain if event.level is Level.ALARM and event.kind in CATCHERS), None)
    if first is None:
        return "", math.inf, ""
    if first.kind is EventKind.WATCHDOG and sender:
        return sender, first.at_s, first.text
    is_driver = first.kind is EventKind.CONTROL and scene.is_canbase
    who = CATCHERS[EventKind.DRIVER if is_driver else first.kind]
    trips = (event.text for event in chain if event.kind is EventKind.TRIP and event.at_s <= first.at_s + SAYS_S)
    return who, first.at_s, next(trips, first.text) if who == CATCHERS[EventKind.TRIP] else first.text


SAYS_S: Final = 0.1
"""A part acts first and reports then."""


def _unknown(scene: Scene) -> tuple[Cause, Found]:
    """No rule has evidence, and nobody says why."""
    alarms = (event for event in scene.events if event.level is Level.ALARM)
    said = next((event for event in alarms if event.at_s >= scene.reaction_s), None)
    if said is None:
        return Cause.UNKNOWN, Found(scene.reaction_s, "nothing in this recording shows what began the stop")
    text = f"it begins with: {said.who} {said.text}; nothing before it shows why"
    return Cause.UNKNOWN, Found(said.at_s, text, said.node_id)
