"""The state of the bus, per axis and node: the last values and when they came. No judgement here: that is policy.py.

Ages count from the local monotonic receive time. A frame that cannot be understood is counted and changes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from canbase_config.watchdog import WatchdogConfig, WatchedDrive
from canbase_watchdog import frames
from canbase_watchdog.bad_cycles import BadCycles
from canbase_watchdog.copies import Copies
from canbase_watchdog.frames import DriveState
from canbase_watchdog.guarding import GuardAnswers
from canbase_watchdog.plausibility import Plausibility
from canbase_watchdog.second_master import Foreign, guard_pace
from canbase_watchdog.standstill import StandstillWatch
from canbase_watchdog.torque_evidence import TorqueWatch
from canbase_watchdog.view import NEVER, Axis, BusView, Node

ENABLED = DriveState.OPERATION_ENABLED
_Key = tuple[int, int]
"""Node id and axis."""


class _Record:
    """The last values of one axis, as they come."""

    __slots__ = (
        "answers",
        "asks_for_power",
        "command_at",
        "copies",
        "disabled_since",
        "double_statuses",
        "doubles",
        "drive",
        "enabled_since",
        "fed_status_at",
        "fed_velocity_at",
        "feedback",
        "fresh",
        "misses",
        "setpoint_at",
        "setpoint_mps",
        "stand",
        "state",
        "status_at",
        "statuses",
        "target_mps",
        "torque",
        "velocity_at",
        "velocity_mps",
    )

    def __init__(self, drive: WatchedDrive, config: WatchdogConfig, now_s: float) -> None:
        self.drive = drive
        self.feedback = Plausibility(drive, config, now_s)
        self.torque, self.stand = TorqueWatch(drive, config), StandstillWatch(drive, config)
        self.state: DriveState | None = None
        self.status_at = self.enabled_since = self.disabled_since = NEVER
        self.velocity_mps, self.velocity_at = 0.0, NEVER
        self.fed_status_at = self.fed_velocity_at = NEVER
        self.target_mps, self.command_at = 0.0, NEVER
        self.setpoint_mps, self.setpoint_at = 0.0, NEVER
        self.asks_for_power = self.fresh = False
        self.misses, self.doubles, self.double_statuses = BadCycles(), BadCycles(), BadCycles()
        self.answers = self.statuses = 0
        self.copies = Copies()

    def axis(self) -> Axis:
        return Axis(
            self.drive,
            self.state,
            self.status_at,
            self.enabled_since,
            self.disabled_since,
            self.velocity_mps,
            self.velocity_at,
            self.target_mps,
            self.asks_for_power,
            self.command_at,
            self.setpoint_mps,
            self.setpoint_at,
            self.feedback.last,
            self.feedback.evidence.last,
            min(self.fed_status_at, self.fed_velocity_at),
            self.stand.stands,
            self.stand.position_at,
            self.misses.value,
            max(self.doubles.value, self.double_statuses.value),
            self.torque.last,
            self.stand.sudden,
            self.stand.unproven,
            self.copies.at,
        )

    def rests(self, still_mps: float) -> bool:
        """Nothing is ordered, and what it measures is noise."""
        return self.setpoint_mps == 0.0 and abs(self.velocity_mps) <= still_mps

    def on_sync(self, now_s: float) -> None:
        """What came before it counts from now on; each SYNC wants one setpoint, and one status and one velocity from
        one drive. They count apart: the timers of two TPDOs drift along the SYNCs at different moments.

        One that takes no synchronous PDO has been set to the same pace: its answers come by its own timer.
        """
        if self.state is ENABLED:
            self.misses.count(not self.fresh)
            if self.drive.answers_sync:
                self.doubles.balance(self.answers)
                self.double_statuses.balance(self.statuses)
        else:
            self.misses.clear()
            self.doubles.clear()
            self.double_statuses.clear()
        self.answers = self.statuses = 0
        if self.fresh:
            self.setpoint_mps, self.setpoint_at, self.fresh = self.target_mps, now_s, False
            self.feedback.evidence.on_setpoint(self.setpoint_mps, now_s)


class Observer:
    """Keeps the last values of everything on the bus that concerns the configured drives."""

    def __init__(self, config: WatchdogConfig, now_s: float, *, loopback: bool = True) -> None:
        """Listens for the drives in `config`; the lower axis number of a node uses the PDOs of its first axis.
        `loopback`: what this watchdog sends comes back to it."""
        self._hard = False
        self._gap_s = config.feedback_timeout_s
        self._still_mps = config.motion_tolerance_mps
        self._records = {(drive.node_id, drive.axis): _Record(drive, config, now_s) for drive in config.drives}
        self._in_order = tuple(self._records.values())
        self._heartbeat_at = {node_id: NEVER for node_id, _ in self._records}
        self._last_frame_at, self._boot_up_at = dict(self._heartbeat_at), dict(self._heartbeat_at)
        self._configured_at = dict(self._heartbeat_at)
        self._operational = dict.fromkeys(self._heartbeat_at, False)
        self._answers = {drive.node_id: GuardAnswers() for drive in config.drives if drive.guarded}
        self._guards = {node_id: guard_pace(config) for node_id in self._answers}
        self._guard_period_s = config.guard_period_s
        self._foreign = Foreign(config, loopback=loopback)
        self._driver_at = self._sync_at = self._sync_since = NEVER
        self._routes: dict[int, Callable[[bytes, float], bool]] = {}
        self._view: BusView | None = None
        """As it was looked at last; None: a frame has come since."""
        self.dropped = 0
        """Frames with a watched identifier that could not be understood."""
        self.ours_since = math.inf
        """NMT, quick stop PDO and SDO from then on [s] are our own that come back: no signs of another master."""
        self._add_routes()

    def on_frame(self, cob_id: int, data: bytes, now_s: float) -> None:
        """Take in one received frame. Never raises for what is on the bus."""
        route = self._routes.get(cob_id)
        if route is None:
            return
        self._view = None
        if not route(data, now_s):
            self.dropped += 1

    def bus_view(self) -> BusView:
        """Everything as it stands; the same object as long as nothing has come."""
        if self._view is None:
            self._view = self._build_view()
        return self._view

    def _build_view(self) -> BusView:
        return BusView(
            tuple([record.axis() for record in self._in_order]),
            tuple([self._node(node_id) for node_id in self._heartbeat_at]),
            self._driver_at,
            self._sync_at,
            self._sync_since,
            self._foreign.last,
        )

    def _node(self, node_id: int) -> Node:
        heartbeat_at, last_frame_at = self._heartbeat_at[node_id], self._last_frame_at[node_id]
        boot_up_at, configured_at = self._boot_up_at[node_id], self._configured_at[node_id]
        return Node(node_id, heartbeat_at, last_frame_at, boot_up_at, configured_at, self._operational[node_id])

    def brake(self, hard: bool) -> None:
        """Whether from now on each wheel has to follow setpoints that fall with the emergency deceleration."""
        if hard is self._hard:
            return
        self._hard = hard
        for record in self._in_order:
            record.feedback.brake(hard)

    def trust(self) -> None:
        """A reset was accepted: the evidence against the sensors is dropped."""
        self._view = None
        for record in self._records.values():
            record.feedback.trust()
            record.torque.trust()
            record.stand.trust()

    @property
    def driver_at(self) -> float:
        """When the older one of the driver's heartbeat and SYNC came."""
        return min(self._driver_at, self._sync_at)

    def _add_routes(self) -> None:
        self._routes[frames.NMT] = self._on_nmt
        self._routes[frames.SYNC] = self._on_sync
        self._routes[frames.DRIVER_HEARTBEAT] = self._on_driver_heartbeat
        self._routes[frames.WATCHDOG_HEARTBEAT] = self._on_watchdog_heartbeat
        self._routes[frames.LSS_REQUEST] = self._on_lss
        for node_id in self._last_frame_at:
            self._add_node_routes(node_id)
            for place, key in enumerate(sorted(key for key in self._records if key[0] == node_id)):
                self._add_axis_routes(place, key)

    def _add_node_routes(self, node_id: int) -> None:
        routes = self._routes
        on_answer = self._on_guard_answer if node_id in self._answers else self._on_heartbeat
        routes[frames.HEARTBEAT + node_id] = lambda data, now_s: on_answer(node_id, data, now_s)
        routes[frames.SDO_ANSWER + node_id] = lambda data, now_s: self._on_sdo_answer(node_id, data, now_s)
        routes[frames.SDO_REQUEST + node_id] = lambda data, now_s: self._on_sdo_request(node_id, data, now_s)
        routes[frames.QUICK_STOP_RPDO + node_id] = lambda data, now_s: self._on_quick_stop(node_id, data, now_s)

    def _add_axis_routes(self, place: int, key: _Key) -> None:
        node_id, record, routes = key[0], self._records[key], self._routes
        setpoint = frames.SETPOINT_RPDO[place] + node_id
        routes[frames.STATUS_TPDO[place] + node_id] = lambda data, now_s: self._on_status(record, data, now_s)
        routes[frames.VELOCITY_TPDO[place] + node_id] = lambda data, now_s: self._on_velocity(record, data, now_s)
        routes[setpoint] = lambda data, now_s: self._on_setpoint(record, setpoint, data, now_s)

    def _on_sync(self, data: bytes, now_s: float) -> bool:
        if len(data) > 1:
            return False
        self._foreign.on_sync(now_s)
        rests = True
        for record in self._in_order:
            record.on_sync(now_s)
            rests = rests and record.rests(self._still_mps)
        for record in self._in_order:
            record.torque.on_sync(record.setpoint_mps, rests)
            record.feedback.evidence.on_sync(rests)
        if now_s >= self._sync_at + self._gap_s:
            self._sync_since = now_s
        self._sync_at = now_s
        return True

    def _on_driver_heartbeat(self, data: bytes, now_s: float) -> bool:
        if len(data) != 1:
            return False
        self._foreign.on_heartbeat(now_s)
        self._driver_at = now_s
        return True

    def _on_watchdog_heartbeat(self, data: bytes, now_s: float) -> bool:
        self._foreign.on_watchdog_heartbeat(now_s)
        return True

    def _on_heartbeat(self, node_id: int, data: bytes, now_s: float) -> bool:
        if len(data) != 1:
            return False
        self._heartbeat_at[node_id] = self._last_frame_at[node_id] = now_s
        self._operational[node_id] = data[0] & ~frames.TOGGLE == frames.OPERATIONAL  # some set bit 7 in heartbeats
        if data == frames.BOOT_UP and self._is_enabled(node_id, now_s):
            self._boot_up_at[node_id] = now_s
        return True

    def _on_guard_answer(self, node_id: int, data: bytes, now_s: float) -> bool:
        state = self._answers[node_id].take_answer(data)
        if data != frames.BOOT_UP and self._guards[node_id].too_fast(now_s):
            period_s = self._guard_period_s
            often = f"more answers to node guarding than one each {period_s:.3f} s (heartbeats, 1017h, count too)"
            self._note_foreign(node_id, often, now_s, self._foreign.note_too_many)
        return state is not None and self._on_heartbeat(node_id, state, now_s)

    def _is_enabled(self, node_id: int, now_s: float) -> bool:
        """A TPDO of the last moments showed it."""
        records = (record for key, record in self._records.items() if key[0] == node_id)
        return any(each.state is ENABLED and now_s < each.fed_status_at + self._gap_s for each in records)

    def _on_status(self, record: _Record, data: bytes, now_s: float) -> bool:
        status = frames.decode_status(data, record.drive.layout, record.drive.axis)
        if status is None or not self._note_state(record, status[0], now_s):
            return False
        record.fed_status_at = now_s
        record.statuses += 1
        record.copies.note_frame(data, now_s)
        record.feedback.on_position(status[1])
        record.torque.on_position(status[1])
        record.stand.on_position(status[1], now_s)
        bits = frames.decode_joined_velocity(data, record.drive.layout)
        if bits is not None:
            self._note_tpdo_velocity(record, bits, None, now_s)
        return True

    def _note_state(self, record: _Record, statusword: int, now_s: float) -> bool:
        state = frames.decode_state(statusword)
        if state is None:
            return False
        if state is ENABLED and record.state is not ENABLED:
            record.enabled_since = now_s
        elif state is not ENABLED and record.state is ENABLED:
            record.disabled_since = now_s
        record.state, record.status_at = state, now_s
        self._last_frame_at[record.drive.node_id] = now_s
        return True

    def _on_velocity(self, record: _Record, data: bytes, now_s: float) -> bool:
        bits = frames.decode_velocity(data, record.drive.layout)
        if bits is None:
            return False
        self._note_tpdo_velocity(record, bits, frames.decode_torque(data, record.drive.layout), now_s)
        return True

    def _note_tpdo_velocity(self, record: _Record, bits: int, torque: float | None, now_s: float) -> None:
        """Out of a TPDO, behind the position of the same SYNC."""
        self._note_velocity(record, bits, now_s)
        record.fed_velocity_at = now_s
        record.answers += 1
        enabled, powered = record.state is ENABLED, frames.is_powered(record.state)
        record.torque.on_sample(torque, powered, now_s)
        record.feedback.on_velocity(record.velocity_mps, powered, enabled, now_s, record.torque.last.share)
        if record.torque.contradicts_encoder:
            record.feedback.evidence.doubt()

    def _note_velocity(self, record: _Record, bits: int, now_s: float) -> None:
        record.velocity_mps, record.velocity_at = bits * record.drive.velocity_mps_per_bit, now_s
        record.stand.on_velocity(record.velocity_mps, now_s, frames.is_powered(record.state))
        self._last_frame_at[record.drive.node_id] = now_s

    def _on_setpoint(self, record: _Record, cob_id: int, data: bytes, now_s: float) -> bool:
        setpoint = frames.decode_setpoint(data, record.drive.layout)
        if setpoint is None:
            return False
        self._foreign.on_setpoint(cob_id, record.drive.node_id, data, now_s)
        word, bits = setpoint
        record.target_mps, record.command_at, record.fresh = bits * record.drive.mps_per_bit, now_s, True
        record.asks_for_power = frames.asks_for_power(word)
        record.feedback.on_target(record.target_mps, now_s)
        return True

    def _on_sdo_answer(self, node_id: int, data: bytes, now_s: float) -> bool:
        """Answers to anybody's reading of 6041h, 6064h and 606Ch are as true as a TPDO; all others are not for us."""
        self._last_frame_at[node_id] = now_s
        answer = frames.decode_sdo(data)
        understood = True
        for key, record in self._records.items():
            if answer is not None and key[0] == node_id:
                understood = self._note_answer(record, *answer, now_s) and understood
        return understood

    def _note_answer(self, record: _Record, place: tuple[int, int], value: int, now_s: float) -> bool:
        drive = record.drive
        if place == frames.place_of(frames.STATUSWORD, drive.axis, drive.layout):
            return self._note_state(record, frames.own_statusword(value, drive.layout, drive.axis), now_s)
        if place == frames.place_of(frames.VELOCITY, drive.axis, drive.layout):
            self._note_velocity(record, frames.own_velocity(value, drive.layout), now_s)
        if place == frames.place_of(frames.POSITION, drive.axis, drive.layout):
            record.stand.on_position(value, now_s)
        return True

    def _on_nmt(self, data: bytes, now_s: float) -> bool:
        command = frames.decode_nmt(data)
        if command is None:
            return False
        for node_id in self._last_frame_at:
            if command[1] in (0, node_id):
                self._note_foreign(node_id, f"NMT command {command[0]} for node {command[1]}", now_s)
        return True

    def _on_lss(self, data: bytes, now_s: float) -> bool:
        for node_id in self._last_frame_at:
            self._note_foreign(node_id, f"an LSS request {data.hex(' ')} (CiA 305: node ids, bit rate)", now_s)
        return True

    def _on_quick_stop(self, node_id: int, data: bytes, now_s: float) -> bool:
        self._note_foreign(
            node_id, f"quick stop PDO with {data.hex(' ')} (sent as well when driver or watchdog has ended)", now_s
        )
        return True

    def _on_sdo_request(self, node_id: int, data: bytes, now_s: float) -> bool:
        written = frames.decode_sdo_download(data)
        stops = written in _CONTROLWORDS and frames.takes_power_away(data)
        if written is not None and not stops:
            self._note_foreign(node_id, f"an SDO that writes {written:04X}h", now_s)
        if not frames.concerns_motion(data):
            self._configured_at[node_id] = now_s
        return True

    def _note_foreign(
        self, node_id: int, detail: str, now_s: float, note: Callable[[int, str, float], None] | None = None
    ) -> None:
        enabled = any(record.state is ENABLED for key, record in self._records.items() if key[0] == node_id)
        if enabled and now_s < self.ours_since:
            (note or self._foreign.note)(node_id, f"{detail}, while it is enabled", now_s)


_CONTROLWORDS = (frames.CONTROLWORD, frames.CONTROLWORD + frames.AXIS_OFFSET)
