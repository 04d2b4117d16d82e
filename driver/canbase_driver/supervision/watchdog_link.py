"""The driver's view of the watchdog: its frames 1FEh and 2FEh and the reset request (27Eh), laid out in docs/bus.md.

The watchdog has these layouts a second time, on purpose; a test compares both. Pure: time is an argument.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from canbase_config.robot import WATCHDOG_NODE_ID
from canbase_driver.cia301.frame import Frame
from canbase_runtime.watchdog_view import WatchdogView

STATE_COB_ID = 0x180 + WATCHDOG_NODE_ID
RESET_COB_ID = 0x200 + WATCHDOG_NODE_ID
COUNTERS_COB_ID = 0x280 + WATCHDOG_NODE_ID
STATE_LAYOUT = struct.Struct("<BBBBHBB")
COUNTERS_LAYOUT = struct.Struct("<HHHBB")
LEASE_AGE_UNKNOWN = 0xFFFF
RESET_KEY = b"RST"

STARTING, WATCHING, TRIPPED = 0, 1, 2
BRAKES_HARD, ARMED = 0x40, 0x80
"""Bits of byte 2, above the rung: brake with the emergency deceleration; its record on disk is LIVE."""

CAUSES = {
    0: "none",
    1: "lease lost",
    2: "driver silent",
    3: "drive silent",
    4: "target outside the envelope",
    5: "motion outside the envelope",
    6: "overspeed",
    7: "drive in fault or off while another moves",
    8: "foreign master, or stop frames of canbase itself",
    9: "bus failed",
    10: "own loop late",
    11: "shut down while a wheel turned",
    12: "feedback implausible",
    13: "motion missing",
    14: "base motion not as ordered",
    15: "setpoint missing",
    16: "two drives with one node id",
    17: "power at an unproven standstill",
    18: "boot-up of an enabled drive",
    20: "ended while a drive had power",
    21: "record of its last trip unusable",
}
SENSOR_CAUSES = (12, 13, 17)
"""After these, what the node in the state frame reports about its motion is no evidence."""
MOTION_CAUSES = (5, 12, 13, 14)
"""A wheel does not move as it was ordered to."""
RUNGS = ("none", "quick stop", "NMT pre-operational", "disable voltage", "heartbeat withheld", "NMT reset node")
"""How far up its ladder it has gone; the numbers are those of its state frame and of DriverStatus."""
DRIVE_CAUSES = (3, 7, 18)
"""What the driver sees at its drives itself, and can report in more detail."""
ANSWERS = {
    1: "reset done",
    2: "its cause persists, or a wheel is not proven to be at standstill. After a lost encoder, reset again when its "
    "power has been off for as long as it may roll (some seconds). `canbase doctor` names what remains",
    3: "a velocity is ordered; release the joystick or cancel the goal, then reset",
    4: "not tripped",
}
ACCEPTED = (1, 4)
"""Answers after which the watchdog is not tripped."""


@dataclass(frozen=True, slots=True)
class WatchdogState:
    """One state frame. `lease_age_ms`: FFFFh when there is none."""

    state: int
    cause: int
    rung: int
    node_id: int
    lease_age_ms: int
    answered: int
    answer: int
    armed: bool = False
    """Its record on disk is LIVE: killed now, it comes back tripped."""
    brakes_hard: bool = False
    """The base has to brake with the emergency deceleration: the flag of the safety filter's leases."""

    @property
    def cause_text(self) -> str:
        """The cause in words; a number that this version does not know is given as it is."""
        return CAUSES.get(self.cause, f"cause {self.cause}")


@dataclass(frozen=True, slots=True)
class WatchdogCounters:
    """One frame of counters, since the watchdog's start. `pause_max_ms`: the longest since the frame before."""

    leases_refused: int = 0
    frames_dropped: int = 0
    bus_errors: int = 0
    trips: int = 0
    pause_max_ms: int = 0

    @property
    def events(self) -> dict[str, int]:
        """What should not grow, by its name in DriverStatus without `watchdog_`."""
        return {
            "trips": self.trips,
            "leases_refused": self.leases_refused,
            "frames_dropped": self.frames_dropped,
            "bus_errors": self.bus_errors,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchdogReport:
    """What the driver knows of the watchdog at one moment."""

    view: WatchdogView
    cause: str
    """Cause of its trip in words; "none"."""
    age_s: float
    """Since its last state frame [s]; NaN: none yet."""
    rung: int
    """How far up its ladder it has gone, 0 to 4."""
    lease_age_s: float
    """Age of the last valid lease, in its state frame [s]; NaN: none."""
    counters: WatchdogCounters = WatchdogCounters()
    """Since its start."""

    @property
    def pause_max_s(self) -> float:
        """Longest pause of its loop in the last half second [s], at most 0.255."""
        return self.counters.pause_max_ms / 1000.0


def parse_counters(frame: Frame) -> WatchdogCounters | None:
    """The watchdog's counters, or None when the frame is not one."""
    if frame.cob_id != COUNTERS_COB_ID or len(frame.data) != COUNTERS_LAYOUT.size:
        return None
    return WatchdogCounters(*COUNTERS_LAYOUT.unpack(frame.data))


def parse_state(frame: Frame) -> WatchdogState | None:
    """The watchdog's state, or None when the frame is not one."""
    if frame.cob_id != STATE_COB_ID or len(frame.data) != STATE_LAYOUT.size:
        return None
    number, cause, rung, node_id, age_ms, answered, answer = STATE_LAYOUT.unpack(frame.data)
    armed, hard = bool(rung & ARMED), bool(rung & BRAKES_HARD)
    rung &= ~(ARMED | BRAKES_HARD)
    state = WatchdogState(number, cause, rung, node_id, age_ms, answered, answer, armed, hard)
    return state if state.state in (STARTING, WATCHING, TRIPPED) else None


class WatchdogLink:
    """The last state of the watchdog, its age, and our requests to it."""

    def __init__(self, timeout_s: float) -> None:
        """`timeout_s`: a state frame older than this is none (timeouts.watchdog_s)."""
        self._timeout_s = timeout_s
        self._state: WatchdogState | None = None
        self._received_s = -math.inf
        self._hard_received = False
        self._request = 0
        self.counters = WatchdogCounters()
        """Its last state frame; zeros until then."""

    def on_frame(self, frame: Frame, now_s: float) -> bool:
        """Take a frame 1FEh. False: it was not understood."""
        state = parse_state(frame)
        if state is None:
            return False
        self._state, self._received_s = state, now_s
        self._hard_received = self._hard_received or state.brakes_hard
        return True

    def on_counters(self, frame: Frame, _now: float) -> bool:
        """Take a frame 2FEh. False: it was not understood. Only the state frame shows that the watchdog lives."""
        counters = parse_counters(frame)
        if counters is None:
            return False
        self.counters = counters
        return True

    @property
    def rung(self) -> int:
        """How far up its ladder it has gone, 0 to 4 (docs/bus.md); 0 until its first frame."""
        return self._state.rung if self._state else 0

    @property
    def unarmed(self) -> str:
        """A sentence until its record of trips is on disk, for which it waits before drives get power; else empty."""
        if self._state is not None and self._state.armed:
            return ""
        return "the watchdog's record of trips is not on disk yet; if it stays so, check the watchdog's log"

    @property
    def lease_age_s(self) -> float:
        """Age of the last valid lease in its last state frame [s]; NaN: none, or no frame yet."""
        if self._state is None or self._state.lease_age_ms == LEASE_AGE_UNKNOWN:
            return math.nan
        return self._state.lease_age_ms / 1000.0

    @property
    def reports(self) -> bool:
        """A state frame of it was received."""
        return self._state is not None

    def age_s(self, now_s: float) -> float:
        """Seconds since the last state frame; NaN: none yet."""
        return now_s - self._received_s if self._state else math.nan

    @property
    def cause(self) -> str:
        """Cause of the trip in words; "none" when it has not tripped or has not sent a frame."""
        return self._state.cause_text if self._state else "none"

    def report(self, now_s: float) -> WatchdogReport:
        """All of it at the time `now_s` [s, monotonic]."""
        view, _sentence = self.view(now_s)
        return WatchdogReport(
            view=view,
            cause=self.cause,
            age_s=self.age_s(now_s),
            rung=self.rung,
            lease_age_s=self.lease_age_s,
            counters=self.counters,
        )

    def view(self, now_s: float) -> tuple[WatchdogView, str]:
        """Whether it watches, and a sentence when it does not."""
        if self._state is None:
            return WatchdogView.MISSING, "no frame of it yet; start it with `canbase serve watchdog`"
        age_s = now_s - self._received_s
        if age_s > self._timeout_s:
            return WatchdogView.MISSING, f"no frame for {age_s:.2f} s (timeout {self._timeout_s:.2f} s)"
        if self._state.state == TRIPPED:
            about = f", node {self._state.node_id}" if self._state.node_id else ""
            return WatchdogView.TRIPPED, self._state.cause_text + about
        if self._state.state == STARTING:
            return WatchdogView.MISSING, "still starting"
        return WatchdogView.OK, ""

    def brakes_hard(self, now_s: float) -> bool:
        """Whether the base has to brake hard. Called once in each control cycle: one state frame with the bit since the
        last call is enough, whatever a later frame says. Without a recent state frame the base brakes hard."""
        received, self._hard_received = self._hard_received, False
        hard = received or self._state is None or self._state.brakes_hard
        return hard or now_s - self._received_s > self._timeout_s

    @property
    def about_drive(self) -> bool:
        """The last trip was about a drive that sends nothing or is down."""
        return self._state is not None and self._state.cause in DRIVE_CAUSES

    @property
    def not_moving_as_ordered(self) -> int | None:
        """The node whose wheel the last trip was about, 0: some wheel; None: it was not about motion."""
        return self._state.node_id if self._state is not None and self._state.cause in MOTION_CAUSES else None

    def lying_node(self, now_s: float) -> int:
        """The node whose sensors the watchdog has found faulty; 0: none."""
        if self._state is None or self.view(now_s)[0] is not WatchdogView.TRIPPED:
            return 0
        return self._state.node_id if self._state.cause in SENSOR_CAUSES else 0

    def request_reset(self) -> Frame:
        """A reset request with a new number. Send the same frame again until `answer` is not None."""
        self._request = self._request % 255 + 1
        if self._state is not None and self._request == self._state.answered:
            self._request = self._request % 255 + 1
        return Frame(RESET_COB_ID, bytes([self._request]) + RESET_KEY)

    def answer(self) -> int | None:
        """The answer to the last request (ANSWERS), None while there is none."""
        if self._state is None or self._request == 0 or self._state.answered != self._request:
            return None
        return self._state.answer
