"""A small robot in virtual time for the watchdog's tests: driver, filter and drives that a test can make misbehave.

It is not the simulated motor controller of the bench: only what the watchdog looks at, so that a test can lie to it.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

from canbase_config.watchdog import WatchdogConfig, WatchedDrive
from canbase_watchdog.frames import Frame
from canbase_watchdog.watchdog import Watchdog

BITS_PER_MPS = 1000
SOD, ENABLED, QUICK_STOP, FAULT = 0x0240, 0x0237, 0x0217, 0x0218
PRE_OPERATIONAL, OPERATIONAL = 0x7F, 0x05


def config(*drives: tuple[int, int], uid: int | None = None) -> WatchdogConfig:
    """Drives as (node id, axis), 1 mm/s per bit, 0.1 mm per count, with the default times of robot.yaml."""
    sides = ("left", "right")
    places = drives or ((1, 0), (2, 0))
    watched = tuple(
        WatchedDrive(f"wheel_{n}_{a}", n, a, sides[i % 2], 0.001, 0.0001) for i, (n, a) in enumerate(places)
    )
    return WatchdogConfig(
        bus_arguments={"interface": "virtual", "channel": "none"},
        drives=watched,
        track_m=0.4,
        control_hz=100.0,
        lease_socket="/nowhere",
        lease_timeout_s=0.25,
        drive_heartbeat_s=0.3,
        feedback_timeout_s=0.1,
        loop_late_s=0.1,
        bus_failed_s=0.1,
        standstill_mps=0.005,
        linear_mps=1.0,
        angular_radps=4.0,
        acceleration_mps2=1.0,
        deceleration_mps2=1.0,
        angular_acceleration_radps2=5.0,
        angular_deceleration_radps2=5.0,
        max_wheel_mps=1.0,
        order_hold_s=0.35,
        drive_lag_s=0.1,
        target_tolerance_mps=0.03,
        target_tolerance_share=0.03,
        motion_tolerance_mps=0.05,
        motion_tolerance_share=0.1,
        feedback_samples=5,
        overspeed_factor=1.2,
        travel_tolerance_m=0.05,
        braking_mps2=0.5,
        coasting_s=2.0,
        motion_missing_s=0.25,
        motion_missing_m=0.01,
        jolt_mps2=20.0,
        slow_wheel_share=0.3,
        slow_wheel_s=0.5,
        slowest_ramp_mps2=0.25,
        twist_tolerance_mps=0.01,
        twist_tolerance_share=0.08,
        twist_s=0.5,
        lease_uid=uid,
    )


def lease(sequence: int, stamp_s: float, linear: float = 0.0, angular: float = 0.0, flags: int = 0) -> bytes:
    """A lease as docs/bus.md lays it out, written here once more."""
    body = struct.pack("<4sQQddI", b"CBL1", sequence, round(stamp_s * 1e9), linear, angular, flags)
    return body + struct.pack("<I", zlib.crc32(body))


@dataclass
class FakeDrive:
    """One axis per node, or two. `target` and `speed` in bits; fields below are the ways in which it misbehaves."""

    node_id: int
    axes: tuple[int, ...] = (0,)
    option: int = 2
    hears_quick_stop: bool = True
    hears_pdo: bool = True
    hears_sdo: bool = True
    hears_nmt: bool = True
    brakes: bool = True
    runs_away_mps2: float = 0.0
    """Above 0: quick stop makes it faster, as with a sensor of the wrong sign."""
    shows: int | None = None
    """606Ch, whatever it does."""
    mute: bool = False
    nmt: int = OPERATIONAL
    words: dict[int, int] = field(default_factory=dict)
    speed: dict[int, float] = field(default_factory=dict)
    travel: dict[int, float] = field(default_factory=dict)
    target: dict[int, int] = field(default_factory=dict)
    pending: dict[int, tuple[int, int]] = field(default_factory=dict)
    beat_at: float = 0.0

    def __post_init__(self) -> None:
        for axis in self.axes:
            self.words[axis], self.speed[axis], self.travel[axis], self.target[axis] = SOD, 0.0, 0.0, 0

    def control(self, axis: int, word: int) -> None:
        """The controlword, as far as the watchdog is concerned; a live driver enables from SOD in one step here."""
        state = self.words[axis]
        if word & 0x8F == 0x0F and state in (SOD, QUICK_STOP):
            self.words[axis] = ENABLED if state == SOD or self.option >= 5 else state
        elif word & 0x06 == 0x02 and state == ENABLED and self.hears_quick_stop:
            self.words[axis] = QUICK_STOP
        elif word & 0x02 == 0 and state != FAULT:
            self.words[axis] = SOD

    def on_frame(self, frame: Frame) -> list[Frame]:
        """Take a frame from the bus and answer."""
        cob_id, data, node = frame.cob_id, frame.data, self.node_id
        if cob_id == 0x000 and data[1] == node and self.hears_nmt:
            self.nmt = {0x80: PRE_OPERATIONAL, 0x81: PRE_OPERATIONAL, 0x01: OPERATIONAL}[data[0]]
            if data[0] == 0x81:
                self.words = dict.fromkeys(self.axes, SOD)
        if cob_id == 0x600 + node and self.hears_sdo:
            return self._answer(data)
        if self.nmt == OPERATIONAL and self.hears_pdo:
            self._on_pdo(cob_id, data)
        if cob_id == 0x080 and self.nmt == OPERATIONAL:
            return self._on_sync()
        return []

    def _on_pdo(self, cob_id: int, data: bytes) -> None:
        for place, axis in enumerate(self.axes):
            if cob_id == (0x200, 0x300)[place] + self.node_id:
                self.pending[axis] = struct.unpack("<Hi", data)
            if cob_id == 0x500 + self.node_id:
                self.control(axis, struct.unpack_from("<H", data, 2 * place)[0])

    def _on_sync(self) -> list[Frame]:
        out = []
        for place, axis in enumerate(self.axes):
            if axis in self.pending:
                word, self.target[axis] = self.pending.pop(axis)
                self.control(axis, word)
            status = struct.pack("<Hi", self.words[axis], self.position(axis))
            out.append(Frame((0x180, 0x380)[place] + self.node_id, status))
            out.append(Frame((0x280, 0x480)[place] + self.node_id, struct.pack("<ih", self.velocity(axis), 1)))
        return [] if self.mute else out

    def position(self, axis: int) -> int:
        """6064h: 0.1 mm per count."""
        return round(self.travel[axis] * 10)

    def velocity(self, axis: int) -> int:
        """606Ch: 1 mm/s per bit."""
        return round(self.speed[axis]) if self.shows is None else self.shows

    def _answer(self, data: bytes) -> list[Frame]:
        index = int.from_bytes(data[1:3], "little")
        axis, index = (index - 0x6000) // 0x800, 0x6000 + (index - 0x6000) % 0x800
        out = data[1:4]
        if data[0] == 0x2B and index == 0x6040:
            self.control(axis, int.from_bytes(data[4:6], "little"))
            out = b"\x60" + out + bytes(4)
        elif index == 0x6041:
            out = b"\x4b" + out + struct.pack("<HH", self.words[axis], 0)
        elif index == 0x6064:
            out = b"\x43" + out + struct.pack("<i", self.position(axis))
        else:
            out = b"\x43" + out + struct.pack("<i", self.velocity(axis))
        return [] if self.mute else [Frame(0x580 + self.node_id, out)]

    def step(self, dt: float, now_s: float) -> list[Frame]:
        """Let the motors turn for `dt` s: 1000 bits/s² up and down."""
        for axis in self.axes:
            goal = self.target[axis] if self.words[axis] == ENABLED else 0
            change = max(-1000 * dt, min(1000 * dt, goal - self.speed[axis]))
            if self.runs_away_mps2 and self.words[axis] == QUICK_STOP:
                change = 1000 * self.runs_away_mps2 * dt
            self.speed[axis] += change if self.brakes else 0.0
            self.travel[axis] += self.speed[axis] * dt
            if self.words[axis] == QUICK_STOP and self.speed[axis] == 0 and self.option < 5:
                self.words[axis] = SOD
        if now_s < self.beat_at or self.mute:
            return []
        self.beat_at = now_s + 0.1
        return [Frame(0x700 + self.node_id, bytes([self.nmt]))]


class Story:
    """Everybody on one bus, in steps of 1 ms. `t`: seconds since the watchdog started."""

    def __init__(self, *drives: FakeDrive, uid: int | None = None) -> None:
        self.drives = drives or (FakeDrive(1), FakeDrive(2))
        places = [(drive.node_id, axis) for drive in self.drives for axis in drive.axes]
        self.config = config(*places, uid=uid)
        self.watchdog = Watchdog(self.config, 0.0)
        self.ms = 0
        self.word, self.speed, self.sequence = 0x06, 0, 0
        self.driver = self.heartbeat = self.sync = self.filter = self.ticking = True
        self.ordered_mps: float | None = None
        self.leased = 0.0
        self.obedient = True
        self.sent: list[tuple[float, Frame]] = []
        self.on_step: Callable[[], None] = lambda: None

    @property
    def t(self) -> float:
        return self.ms / 1000

    def run(self, seconds: float) -> None:
        """Go on for this long."""
        for _ in range(round(seconds * 1000)):
            self._step()

    def drive_at(self, bits: int, seconds: float = 1.0) -> None:
        """Enabled and commanded with leases, until it turns so fast."""
        self.word, self.speed = 0x0F, bits
        self.run(seconds)

    def reset(self, number: int) -> int:
        """Send a reset request and return the answer."""
        self.put(Frame(0x27E, bytes([number]) + b"RST"))
        return int(self.watchdog.status.reset[1])

    def put(self, frame: Frame) -> None:
        """A frame for all, and what it leads to."""
        if not frame.remote:
            self.watchdog.on_frame(frame.cob_id, frame.data, self.t)
        for drive in self.drives:
            for answer in drive.on_frame(frame):
                self.watchdog.on_frame(answer.cob_id, answer.data, self.t)

    def since(self, t: float, cob_id: int) -> list[tuple[float, Frame]]:
        """What the watchdog sent with this identifier, from `t` on."""
        return [(at, frame) for at, frame in self.sent if at >= t and frame.cob_id == cob_id]

    def _step(self) -> None:
        self.ms += 1
        self.on_step()
        ordered = self.speed / BITS_PER_MPS if self.ordered_mps is None else self.ordered_mps
        if self.filter and (self.ms % 20 == 0 or ordered != self.leased):
            self.sequence, self.leased = self.sequence + 1, ordered
            self.watchdog.on_lease(lease(self.sequence, self.t, ordered), 1000, self.t)
        if self.driver:
            self._driver()
        for drive in self.drives:
            for frame in drive.step(0.001, self.t):
                self.put(frame)
        if self.ticking and self.ms % 5 == 0:
            for frame in self.watchdog.tick(self.t):
                self.sent.append((self.t, frame))
                self.put(frame)

    def _driver(self) -> None:
        if self.obedient and int(self.watchdog.status.state) == 2:
            self.word, self.speed = 0x00, 0
        if self.heartbeat and self.ms % 100 == 0:
            self.put(Frame(0x77F, b"\x05"))
        if self.ms % 10:
            return
        for drive in self.drives:
            for place, _ in enumerate(drive.axes):
                cob_id = (0x200, 0x300)[place] + drive.node_id
                self.put(Frame(cob_id, struct.pack("<Hi", self.word, self.speed)))
        if self.sync:
            self.put(Frame(0x080, b""))
