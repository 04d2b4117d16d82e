"""The network that a recording shows, without any configuration: nodes and their states, what changes, what is missing.

Pure, and of a size that does not grow with the recording. Each frame and note goes in; the events that it makes come
out. CiA 301, CiA 402-2, and canbase's watchdog (docs/bus.md).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

from canbase_config.bus_load import frame_bits
from canbase_config.object_map import CONTROLWORD, STATUSWORD
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID
from canbase_driver.cia301.frame import MAX_COB_ID, Frame
from canbase_driver.cia301.nmt import EMCY, HEARTBEAT, NMT, SDO_TO_CLIENT, SDO_TO_SERVER, NmtCommand, NmtState
from canbase_driver.cia301.sdo_client import NO_OBJECT, NO_SUB_INDEX, abort_text
from canbase_driver.supervision.watchdog_link import (
    COUNTERS_COB_ID,
    RESET_COB_ID,
    RUNGS,
    STATE_COB_ID,
    TRIPPED,
    WATCHING,
    WatchdogState,
    parse_state,
)
from canbase_recording.axis_events import HALTED_S, OnWord, on_controlword, on_statusword, on_watchdog_word
from canbase_recording.beat import Beat
from canbase_recording.entry import FrameKind, RecordedFrame
from canbase_recording.event import Event, EventKind, Level
from canbase_recording.frame_words import NMT_COMMANDS, QUICK_STOP_COB_ID, SYNC, Decoder, is_pdo, nmt_state, nmt_text
from canbase_recording.load_series import LoadSeries
from canbase_recording.node_seen import NodeSeen
from canbase_recording.pdo_layouts import DEVICE_TYPE, PdoLayouts, Source
from canbase_recording.sdo_words import SdoChannels, SdoDone

LOOK_S: Final = 0.02
"""Between two looks for what is missing."""
MOST_UNKNOWN: Final = 500
MOST_ABORTS: Final = 200
"""Different ones of a node that are counted apart."""
NONE: Final[Sequence[Event]] = ()
_STOPPING_COMMANDS: Final = (0x02, 0x80, 0x81, 0x82)
_LADDER_COMMANDS: Final = (NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.RESET_NODE)
"""Of canbase's watchdog (docs/bus.md). What starts a node, or resets its communication, is the boot of the driver."""
"""NMT: stop, pre-operational, the two resets."""


class Network:
    """Takes frames in the order of their time."""

    def __init__(self, decoder: Decoder, layouts: PdoLayouts, bitrate: int) -> None:
        """`bitrate` [bit/s]: what the bus load is worked out with."""
        self.nodes: dict[int, NodeSeen] = {}
        self.load = LoadSeries(bitrate)
        self.sync = Beat()
        self.kinds: Counter[str] = Counter()
        """Frames by service of CiA 301, in words."""
        self.unknown_pdos: Counter[tuple[int, int]] = Counter()
        """Frames whose contents are not known, by COB-ID and length."""
        self.error_frames = 0
        self.watchdog: WatchdogState | None = None
        self._decoder, self._layouts = decoder, layouts
        self._sdo = SdoChannels()
        self._look_at_s = 0.0

    def on_frame(self, frame: RecordedFrame) -> Sequence[Event]:
        """What this frame changes, and what is missing by its time."""
        at_s, cob_id, data, _, kind = frame
        self.load.on_frame(at_s, frame_bits(min(len(data), 8)))
        missing = self._missing(at_s) if at_s >= self._look_at_s else NONE
        found = NONE
        if kind is FrameKind.DATA and 0 <= cob_id <= MAX_COB_ID:
            found = self._on_data(at_s, cob_id, data)
        elif kind is FrameKind.ERROR:
            self.error_frames += 1
            self.kinds["error frames"] += 1
            first = self.error_frames == 1
            found = (
                [Event(at_s, EventKind.ERROR_FRAME, Level.WARNING, "bus", "the first error frame")] if first else NONE
            )
        else:
            self.kinds["remote and 29-bit frames"] += 1
            if kind is FrameKind.REMOTE and cob_id & 0x780 == HEARTBEAT and (polled := self.nodes.get(cob_id & 0x7F)):
                polled.polled_s = at_s
        return [*missing, *found] if missing else found

    def end(self, at_s: float) -> Sequence[Event]:
        """What is missing at the end of the recording."""
        return self._missing(at_s)

    @property
    def is_enabled(self) -> bool:
        """A drive reports operation enabled."""
        return any(node.is_enabled for node in self.nodes.values())

    def _on_data(self, at_s: float, cob_id: int, data: bytes) -> Sequence[Event]:
        node_id, function = cob_id & 0x7F, cob_id & 0x780
        if cob_id == SYNC:
            return self._on_sync(at_s)
        if cob_id == NMT:
            return self._on_nmt(at_s, data)
        if cob_id == STATE_COB_ID and (state := parse_state(Frame(cob_id, data))):
            return self._on_watchdog(at_s, state)
        if not node_id:
            self.kinds["other"] += 1
            return NONE
        if function == HEARTBEAT:
            return self._on_heartbeat(at_s, node_id, data)
        if function == EMCY:
            return self._on_emergency(at_s, node_id, data)
        if function in (SDO_TO_CLIENT, SDO_TO_SERVER):
            return self._on_sdo(at_s, node_id, data, by_client=function == SDO_TO_SERVER)
        return self._on_pdo(at_s, cob_id, data)

    def _known(self, node_id: int, at_s: float) -> NodeSeen:
        """The node that a frame is about, though another one sent it."""
        node = self.nodes.get(node_id)
        if node is None:
            node = self.nodes[node_id] = NodeSeen(node_id, first_s=at_s, last_s=at_s)
        return node

    def _seen(self, node_id: int, at_s: float) -> NodeSeen:
        """The node that has sent a frame."""
        node = self._known(node_id, at_s)
        node.frames += 1
        node.last_s = at_s
        return node

    def _on_sync(self, at_s: float) -> Sequence[Event]:
        self.kinds["SYNC"] += 1
        was_lost, since_s = self.sync.is_lost, self.sync.last_s
        self.sync.on_beat(at_s)
        self.sync.is_lost = False
        if not was_lost:
            return NONE
        return [Event(at_s, EventKind.SYNC_BACK, Level.INFO, "bus", f"SYNC is back after {at_s - since_s:.2f} s")]

    def _on_nmt(self, at_s: float, data: bytes) -> Sequence[Event]:
        self.kinds["NMT"] += 1
        if len(data) != 2:
            return NONE
        hit = [node for node in self.nodes.values() if data[1] in (0, node.node_id)]
        for node in hit:
            node.ordered = NMT_COMMANDS.get(data[0], node.ordered)
        if data[0] in _LADDER_COMMANDS and self._watchdog_stops(at_s):
            return [
                Event(at_s, EventKind.NMT_COMMAND, Level.INFO, "watchdog", f"its ladder: {nmt_text(data)}", data[1])
            ]
        stops = data[0] in _STOPPING_COMMANDS and any(node.is_enabled for node in hit)
        level = Level.ALARM if stops else Level.INFO
        text = nmt_text(data) + (", while a drive has power" if stops else "")
        return [Event(at_s, EventKind.NMT_COMMAND, level, "NMT master", text, data[1])]

    def _watchdog_stops(self, at_s: float) -> bool:
        """Canbase's watchdog has tripped, or has begun to stop a drive: its NMT commands are its ladder."""
        if self.watchdog is None:
            return False
        axes = (axis for node in self.nodes.values() for axis in node.axes.values())
        return self.watchdog.state == TRIPPED or any(at_s - axis.halted_s <= HALTED_S for axis in axes)

    def _on_heartbeat(self, at_s: float, node_id: int, data: bytes) -> Sequence[Event]:
        self.kinds["heartbeat"] += 1
        if len(data) != 1:
            return NONE
        node = self._seen(node_id, at_s)
        who, state, before = self._decoder.who(node_id), nmt_state(data[0]), node.nmt
        node.ordered = ""
        if data[0] == NmtState.INITIALISING:
            node.boot_ups += 1
            node.nmt = NmtState.PRE_OPERATIONAL
            level = Level.ALARM if node.is_enabled else Level.WARNING
            return [Event(at_s, EventKind.BOOT_UP, level, who, "boot-up: it has started", node_id)]
        node.guarded = node.guarded or bool(data[0] & 0x80)
        events = []
        if node.heartbeat.is_lost:
            away_s = at_s - node.heartbeat.last_s
            events.append(
                Event(
                    at_s, EventKind.HEARTBEAT_BACK, Level.INFO, who, f"heartbeat is back after {away_s:.2f} s", node_id
                )
            )
        node.heartbeat.on_beat(at_s)
        node.heartbeat.is_lost = False
        node.nmt = state
        if state is not before:
            text = f"{state.text if state else 'unknown NMT state'}{f', before {before.text}' if before else ''}"
            worse = before is NmtState.OPERATIONAL
            level = Level.WARNING if worse else Level.INFO
            events.append(Event(at_s, EventKind.NMT_STATE, level, who, text, node_id))
        return events

    def _on_emergency(self, at_s: float, node_id: int, data: bytes) -> Sequence[Event]:
        self.kinds["EMCY"] += 1
        node = self._seen(node_id, at_s)
        if len(data) < 2:
            return NONE
        code = int.from_bytes(data[:2], "little")
        if len(node.emergencies) < MOST_ABORTS or code in node.emergencies:
            node.emergencies[code] += 1
        level = Level.ALARM if code >> 8 else Level.INFO
        text = f"EMCY {self._decoder.emergency(node_id, code)}"
        return [Event(at_s, EventKind.EMERGENCY, level, self._decoder.who(node_id), text, node_id)]

    def _on_sdo(self, at_s: float, node_id: int, data: bytes, *, by_client: bool) -> Sequence[Event]:
        self.kinds["SDO"] += 1
        if by_client:
            done = self._sdo.on_request(node_id, data)
        else:
            self._seen(node_id, at_s)
            done = self._sdo.on_answer(node_id, data)
        if done is None:
            return NONE
        return self._on_abort(at_s, done) if done.abort else self._on_transfer(at_s, done)

    def _on_abort(self, at_s: float, done: SdoDone) -> Sequence[Event]:
        node = self._known(done.node_id, at_s)
        key = done.at, done.abort
        if len(node.aborts) >= MOST_ABORTS and key not in node.aborts:
            return NONE
        node.aborts[key] += 1
        is_question = not done.is_write and done.abort in (NO_OBJECT, NO_SUB_INDEX)  # as each boot asks them
        if is_question or node.aborts[key] > 1:
            return NONE
        name = self._decoder.known(done.node_id, done.at).name
        what = f"SDO {'write' if done.is_write else 'read'} {done.at}{f' {name}' if name else ''}"
        text = f"{what} aborted: {abort_text(done.abort)}"
        return [Event(at_s, EventKind.SDO_ABORT, Level.WARNING, self._decoder.who(done.node_id), text, done.node_id)]

    def _on_transfer(self, at_s: float, done: SdoDone) -> Sequence[Event]:
        """Mappings and identities are learned; statusword and controlword by SDO count like those in PDOs."""
        if not 1 <= len(done.data) <= 4:
            return NONE
        value = int.from_bytes(done.data, "little")
        index, sub, node_id = done.at.index, done.at.sub, done.node_id
        if index == DEVICE_TYPE or 0x1400 <= index < 0x1C00:
            self._layouts.on_object(node_id, index, sub, value)
            self._drop_refuted(node_id)
        elif index == 0x1018 and sub:
            self._known(node_id, at_s).identity[sub] = value
        elif index == STATUSWORD and not sub and len(done.data) == 2 and not done.is_write:
            return self._on_word(at_s, self._known(node_id, at_s), 0, value, on_statusword)
        elif index == CONTROLWORD and not sub and done.is_write:
            return self._on_word(at_s, self._known(node_id, at_s), 0, value, on_controlword)
        return NONE

    def _on_pdo(self, at_s: float, cob_id: int, data: bytes) -> Sequence[Event]:
        self.kinds["PDO" if is_pdo(cob_id) else "other"] += 1
        if self.watchdog is not None and cob_id in (COUNTERS_COB_ID, RESET_COB_ID):
            return NONE
        layout = self._layouts.of(cob_id, len(data))
        if layout is None or not layout.fits(len(data)):
            if len(self.unknown_pdos) < MOST_UNKNOWN or (cob_id, len(data)) in self.unknown_pdos:
                self.unknown_pdos[cob_id, len(data)] += 1
            self._drop_refuted(cob_id & 0x7F)
            return NONE
        node = self._seen(layout.node_id, at_s) if layout.name[0] == "T" else self._known(layout.node_id, at_s)
        node.is_assumed = node.is_assumed or layout.source is Source.CIA_402
        is_watchdog = self.watchdog is not None and cob_id & 0x780 == QUICK_STOP_COB_ID
        on_command = on_watchdog_word if is_watchdog else on_controlword
        events: Sequence[Event] = NONE
        for mapped in layout.mapped:
            base, value = mapped.base, mapped.value(data)
            if base == STATUSWORD:
                found = self._on_word(at_s, node, mapped.axis, value, on_statusword)
            elif base == CONTROLWORD:
                found = self._on_word(at_s, node, mapped.axis, value, on_command)
            else:
                node.axis(mapped.axis).on_speed(base, value)
                continue
            events = [*events, *found] if found else events
        return events

    def _drop_refuted(self, node_id: int) -> None:
        """What was read by an assumed mapping that the node turns out not to have is no state of a drive."""
        node = self.nodes.get(node_id)
        if node is not None and node.is_assumed and node_id in self._layouts.refuted:
            node.axes.clear()
            node.is_assumed = False

    def _on_word(self, at_s: float, node: NodeSeen, number: int, word: int, on_word: OnWord) -> Sequence[Event]:
        event = on_word(at_s, node.axis(number), self._decoder.who(node.node_id, number), node.node_id, word)
        return NONE if event is None else (event,)

    def _on_watchdog(self, at_s: float, state: WatchdogState) -> Sequence[Event]:
        self.kinds["canbase's watchdog"] += 1
        self._layouts.on_canbase()
        self._seen(WATCHDOG_NODE_ID, at_s)
        before, self.watchdog = self.watchdog, state
        if before is not None and (before.state, before.cause, before.rung) == (state.state, state.cause, state.rung):
            return NONE
        who = "watchdog"
        about = f", {self._decoder.who(state.node_id)}" if state.node_id else ""
        if state.state == TRIPPED:
            news = before is not None and before.state != TRIPPED
            rung = f": {RUNGS[state.rung]}" if 0 < state.rung < len(RUNGS) else ""
            if not news and before is not None:
                return [Event(at_s, EventKind.WATCHDOG, Level.INFO, who, f"its ladder{rung}", state.node_id)]
            text = f"tripped: {state.cause_text}{about}{'' if news else ' (since before the recording)'}"
            return [Event(at_s, EventKind.TRIP, Level.ALARM if news else Level.INFO, who, text, state.node_id)]
        text = "watching" if state.state == WATCHING else "starting"
        return [Event(at_s, EventKind.WATCHDOG, Level.INFO, who, text)]

    def _missing(self, now_s: float) -> Sequence[Event]:
        """Heartbeats and SYNC that should have come by now, each once."""
        self._look_at_s = now_s + LOOK_S
        events: list[Event] = []
        if not self.sync.is_lost and self.sync.is_missing(now_s):
            self.sync.is_lost = True
            level = Level.ALARM if self.is_enabled else Level.WARNING
            events.append(Event(now_s, EventKind.SYNC_LOST, level, "bus", _lost("SYNC", self.sync)))
        for node in self.nodes.values():
            beat = node.heartbeat
            if not beat.is_lost and beat.is_missing(now_s) and node.owes_heartbeat:
                beat.is_lost = True
                is_ours = node.node_id in (DRIVER_NODE_ID, WATCHDOG_NODE_ID)
                was_up = self.is_enabled if is_ours else node.nmt is NmtState.OPERATIONAL
                who = self._decoder.who(node.node_id)
                level = Level.ALARM if was_up else Level.WARNING
                text = _lost("answer to node guarding" if node.guarded else "heartbeat", beat)
                events.append(Event(now_s, EventKind.HEARTBEAT_LOST, level, who, text, node.node_id))
        return events


def _lost(what: str, beat: Beat) -> str:
    return f"no {what} since {beat.last_s:.3f} s, its period was {1000.0 * beat.period_s:.0f} ms"
