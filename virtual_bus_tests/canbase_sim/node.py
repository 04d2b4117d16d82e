"""A simulated motor controller: the CiA 301 services and one or two CiA 402 axes, wired together. Pure.

`on_frame` takes what is on the bus, `tick` returns the frames of the node. The world moves the wheels in between.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from canopen import SdoAbortedError

from canbase_sim.axis_parts import AxisParts, StateChange
from canbase_sim.cia301 import abort, emcy, heartbeat, life_guarding, nmt, sdo_server, store
from canbase_sim.cia301.dictionary import AXIS_STRIDE, FIRST_AXIS, VOLATILE, Dictionary, key
from canbase_sim.cia301.nmt import NmtCommand, NmtState
from canbase_sim.cia301.rpdo import Rpdo
from canbase_sim.cia301.sdo_channels import SdoChannels
from canbase_sim.cia301.tpdo import Tpdo
from canbase_sim.cia305 import lss_slave
from canbase_sim.cia305.lss_slave import LssSlave
from canbase_sim.cia402.axis import Axis
from canbase_sim.cia402.states import POWERED, State, Transition
from canbase_sim.command_watch import CommandWatch
from canbase_sim.frame import Frame
from canbase_sim.line import Line
from canbase_sim.personality import GENERIC, Personality
from canbase_sim.plant.battery import REST_V
from canbase_sim.plant.encoder import Encoder

COMMUNICATION_FAULT = 0x7500
"""603Fh when NMT stop or a reset meets an axis with 6007h = 1."""
GUARD = 0
"""In the place of a node id: the master whose requests guard the node."""
LOST = ((0x100C, 0x1029), (0x6000, 0x9FFF))
"""First and last index of what `lose_settings` loses."""
RESET_S = 0.01
"""From NMT reset communication to the boot-up message [s]."""
OFFSET_STEP = 1_000_003
"""The encoder shows other counts after each power cycle: it has no battery."""


def _unloaded() -> float:
    return REST_V


class SimulatedNode:
    """One node on the bus. `line` has the switches for what is wrong between it and the others."""

    def __init__(
        self,
        node_id: int,
        axes: Sequence[AxisParts],
        now_s: float,
        boot_delay_s: float = 0.1,
        fixed: Mapping[int, int] | None = None,
        personality: Personality = GENERIC,
        sdo_delay_s: float = 0.0,
        supply_v: Callable[[], float] = _unloaded,
        bitrate: int = 500_000,
    ) -> None:
        """`supply_v`: what feeds its power stage [V]. `node_id` and `bitrate` [bit/s] are stored in it; LSS
        sets both."""
        self.node_id, self.personality = node_id, personality
        self.boot_delay_s = boot_delay_s if personality.boot_delay_s is None else personality.boot_delay_s
        self.line = self._make_line(sdo_delay_s if personality.sdo_delay_s is None else personality.sdo_delay_s)
        self.state = NmtState.INITIALISING
        self.settings_lost = False
        """It runs with the settings of its EDS, or those stored in it, in place of those of its boot."""
        self.changes: deque[StateChange] = deque(maxlen=1000)
        self.lost_producers: deque[int] = deque(maxlen=100)
        """Node ids whose heartbeat this node has missed, GUARD for a master that guarded it; the reader that reports
        them empties it."""
        self._now = now_s
        self._bus_on_at: float | None = None
        d = self.dictionary = Dictionary(node_id, len(axes), fixed, personality)
        self._supply_v = supply_v
        self._supply_places = [
            (place + (AXIS_STRIDE << 8) * axis if place >> 8 in FIRST_AXIS else place, volts)
            for place, volts in personality.voltage.items()
            for axis in range(len(axes))
        ]
        d.before_read = self._measure
        self.emcy = emcy.EmcyService(d, self._send_emcy)
        self.sdo = self._make_sdo(lambda frame: self.line.answer(frame, self._now))
        self.channels = SdoChannels(d, lambda frame: self.line.answer(frame, self._now), lambda: self._route())
        self.lss = LssSlave(
            lambda sub: d.values[key(0x1018, sub)], node_id, bitrate, self.line.say, self._apply_node_id
        )
        self._producer = heartbeat.HeartbeatProducer(d)
        self._consumer = heartbeat.HeartbeatConsumer(d, self._on_lost, self._on_alive)
        self.guarding = life_guarding.LifeGuarding(d, partial(self._on_lost, GUARD), partial(self._on_alive, GUARD))
        self.axes = tuple(self._axis(number, parts) for number, parts in enumerate(axes))
        self._rpdos = [Rpdo(n, d, self.emcy, self._operational, self._on_deadline) for n in range(1, 5)]
        self._tpdos = [Tpdo(n, d, self.line.say, self._operational) for n in range(1, 5)]
        self._command_watch = CommandWatch(d, self._rpdos)
        store.StoreService(d)
        d.guard(0x1019, lambda subindex, value: _check_overflow(value))
        d.on_write(0x1005, lambda subindex, value: self._route())
        for n in range(4):
            d.on_write(0x1400 + n, partial(self._pdo_written, self._rpdos[n]))
            d.on_write(0x1800 + n, partial(self._pdo_written, self._tpdos[n]))
        self._boot_at, self._loader_s = now_s, 0.0
        self._power_up(now_s, 0.0)

    # The bus

    @property
    def bitrate(self) -> int:
        """At which it sends and receives [bit/s]; 0: it does neither, as the rate is being changed."""
        return self.lss.bitrate if self.lss.is_on_bus else 0

    def on_frame(self, cob_id: int, data: bytes, now_s: float) -> None:
        """One frame from the bus, at `now_s`. What the node does not understand is ignored."""
        if not self.line.hears:
            return
        self._now = now_s
        take = self._routes.get(cob_id)
        if take is not None:
            take(data, now_s)
        elif cob_id > heartbeat.COB_ID and self.state is not NmtState.INITIALISING:
            self._consumer.receive(cob_id - heartbeat.COB_ID, data, now_s)

    def on_request(self, cob_id: int, now_s: float) -> None:
        """A remote frame: a request for the frame with this COB-ID. Node guarding alone uses it."""
        guarded = cob_id == heartbeat.COB_ID + self.node_id and key(0x100C) in self.dictionary.entries
        if not (guarded and self.line.hears and self.line.answers_requests) or self.state is NmtState.INITIALISING:
            return
        self._now = now_s
        answer = self.guarding.answer(self.state, now_s)
        if answer is not None:
            self.line.say(Frame(cob_id, answer))

    def takes(self, cob_id: int) -> bool:
        """Whether a frame with this COB-ID may mean anything to the node as it is now; most are feedback of others."""
        return cob_id > heartbeat.COB_ID or self._heeds[cob_id]

    def tick(self, now_s: float) -> list[Frame]:
        """Whatever is due by `now_s`, and every frame since the last call, in order."""
        self._now = now_s
        self.line.say_late_answers(now_s)
        if self._bus_on_at is not None and now_s >= self._bus_on_at:
            self._recover_from_bus_off()
        if self.lss.switch_at is not None:
            self.lss.tick(now_s)
        if self.state is not NmtState.INITIALISING:
            self._tick_watches(now_s)
        elif now_s >= self._boot_at:
            self._boot()
        if self.state is NmtState.OPERATIONAL:
            self._tick_pdos(now_s)
        return self.line.take_out()

    # Faults for tests

    def power_cycle(self, now_s: float, off_s: float = 0.5) -> None:
        """Supply off, and on again after `off_s`: motors coast, objects as saved, the encoder starts elsewhere."""
        for axis in self.axes:
            axis.encoder_offset = (axis.encoder_offset + OFFSET_STEP + 2**31) % 2**32 - 2**31
        self._power_up(now_s, off_s)

    def reset_node(self, now_s: float) -> None:
        """As by NMT reset node: everything restarts, the encoder goes on."""
        self._power_up(now_s, 0.0)

    def bus_off(self, now_s: float, off_s: float = 0.2) -> None:
        """Too many errors: the CAN controller leaves the bus and comes back after `off_s`; a loss like any other."""
        self.line.cut, self._bus_on_at = True, now_s + off_s
        self._lose_connection(emcy.BUS_OFF_RECOVERED)

    def lose_settings(self) -> None:
        """While it runs: its parameters, and what it watches, are those stored in it, or of its EDS."""
        values = self.dictionary.values
        kept = {place: values[place] for place in values if place >> 8 in VOLATILE}
        for first, last in LOST:
            self.dictionary.reset(first, last)
        values |= kept
        self._consumer.configure()
        self.guarding.reset()
        self.settings_lost = True

    def leave_operational(self) -> None:
        """By itself: what watches its program has found something. The motors go on."""
        self._enter(NmtState.PRE_OPERATIONAL)

    def say_boot_up(self) -> None:
        """A boot-up message. Called by a test it is one too many: nothing was restarted."""
        self.line.say_boot_up(Frame(heartbeat.COB_ID + self.node_id, bytes([NmtState.INITIALISING])))

    def fail(self, axis: int, code: int, holds: bool = False) -> None:
        """A fault of one axis with EMCY `code`; while it `holds`, fault resets are in vain (see `heal`)."""
        if holds:
            self.axes[axis].causes.add(code)
        self.axes[axis].fail(code)

    def heal(self, axis: int) -> None:
        """The causes of the faults of one axis are gone; it still needs a fault reset."""
        self.axes[axis].causes.clear()

    def thin_out(self, axis: int, every: int) -> None:
        """Of the setpoint PDOs of an axis it takes every n-th only, 0: none."""
        self._rpdos[axis].takes_every = every

    def lose_feedback(self, axis: int, lost: bool = True) -> None:
        """The feedback PDOs of an axis, status and velocity, do not get onto the bus."""
        for number in (0, 1):
            self._tpdos[2 * axis + number].lost = lost

    # NMT

    def _on_nmt(self, data: bytes, now_s: float) -> None:
        command = nmt.command_for(self.node_id, data)
        if command is None:
            return
        if command is NmtCommand.RESET_NODE:
            self.reset_node(now_s)
        elif command is NmtCommand.RESET_COMMUNICATION:
            self._leave_bus()
            self._reset_communication(now_s + RESET_S)
        else:
            self._enter(nmt.ENTERS[command])

    def _enter(self, state: NmtState) -> None:
        if state is self.state:
            return
        self.state = state
        pdos: list[Rpdo | Tpdo] = [*self._rpdos, *self._tpdos]
        for pdo in pdos:
            pdo.start() if state is NmtState.OPERATIONAL else pdo.stop()
        self._list_pdos()
        self._producer.restart()
        if state is NmtState.STOPPED:
            self._leave_bus()

    def _pdo_written(self, pdo: Rpdo | Tpdo, subindex: int, value: int) -> None:
        """In OPERATIONAL the only write that passes the guard switches the PDO off; elsewhere it is off anyway."""
        pdo.stop()
        self._list_pdos()

    def _list_pdos(self) -> None:
        self._on_sync_tpdos = [t for t in self._tpdos if t.on_sync_active]
        self._on_event_tpdos = [t for t in self._tpdos if t.on_event_active]
        self._active_rpdos = [r for r in self._rpdos if r.cob_id is not None]
        self._route()

    def _boot(self) -> None:
        if self.lss.is_unconfigured:
            self._boot_at = math.inf
            self._route()
            return
        if self._loader_s:
            self.say_boot_up()
            self._boot_at, self._loader_s = self._boot_at + self._loader_s, 0.0
            return
        self._enter(NmtState.PRE_OPERATIONAL)
        self.say_boot_up()
        for axis in self.axes:
            if axis.state is State.NOT_READY_TO_SWITCH_ON:
                axis.boot()
        if self.personality.starts_operational:
            self._enter(NmtState.OPERATIONAL)

    def _apply_node_id(self) -> None:
        """LSS has given the node its first id: it starts by itself."""
        self._reset_communication(self._now + RESET_S)

    def _power_up(self, now_s: float, off_s: float) -> None:
        self.lss.power_on()
        self.settings_lost = False
        self.dictionary.reset(0x2000, 0x9FFF)
        for axis in self.axes:
            axis.restart()
        self._reset_communication(now_s + off_s + self.boot_delay_s, self.personality.second_boot_up_s or 0.0)

    def _reset_communication(self, boot_at: float, loader_s: float = 0.0) -> None:
        self._enter(NmtState.INITIALISING)
        self.line.forget()
        self.lss.reset_communication()
        if self.lss.node_id != self.node_id:
            self._renumber(self.lss.node_id)
        self.dictionary.reset(0x1000, 0x1FFF)
        self.emcy.reset()
        self.sdo.reset()
        self.channels.reset()
        self._consumer.configure()
        self.guarding.reset()
        for axis in self.axes:
            axis.causes.discard(emcy.HEARTBEAT_LOST)
        self._boot_at, self._loader_s = boot_at, loader_s
        self._route()

    def _renumber(self, node_id: int) -> None:
        """Another node id, or 255: none."""
        self.node_id = node_id
        if not self.lss.is_unconfigured:
            self.dictionary.renumber(node_id)
            self.sdo.renumber(node_id)

    def _route(self) -> None:
        """What listens to which COB-ID in this NMT state."""
        self._routes: dict[int, Callable[[bytes, float], None]] = {}
        if self.state is not NmtState.INITIALISING:
            self._add_routes()
        if self.state is not NmtState.INITIALISING or self._boot_at == math.inf:
            self._routes[lss_slave.REQUEST] = self.lss.on_frame
        self._heeds = [False] * (heartbeat.COB_ID + 1)
        """By identifier: it has a route."""
        for cob_id in self._routes:
            if cob_id <= heartbeat.COB_ID:
                self._heeds[cob_id] = True

    def _add_routes(self) -> None:
        if self.state is NmtState.OPERATIONAL:
            self._routes |= {r.cob_id: r.receive for r in self._active_rpdos if r.cob_id is not None}
        if self.state in nmt.HAS_SDO:
            self._routes[self.sdo.rx_cobid] = lambda data, now_s: self.sdo.receive(data)
            self._routes |= self.channels.routes()
            if key(0x1005) in self.dictionary.entries:
                self._routes[self.dictionary.values[key(0x1005)] & 0x7FF] = self._on_sync
        self._routes[nmt.COB_ID] = self._on_nmt

    # PDO

    def _on_sync(self, data: bytes, now_s: float) -> None:
        """Feedback is sampled at the SYNC, then what came before it takes effect. With 1019h it carries a counter."""
        if len(data) != bool(self.dictionary.values[key(0x1019)]):
            self.emcy.raise_error(emcy.SYNC_LENGTH)
            return
        self.emcy.clear_error(emcy.SYNC_LENGTH)
        if self.state is not NmtState.OPERATIONAL:
            return
        self._refresh()
        for tpdo in self._on_sync_tpdos:
            tpdo.on_sync()
        for rpdo in self._active_rpdos:
            rpdo.on_sync()

    def _tick_watches(self, now_s: float) -> None:
        self._consumer.tick(now_s)
        self.guarding.tick(now_s)
        if self._command_watch.ran_out(now_s):
            for axis in self.axes:
                axis.starve()
        if self._producer.due(now_s):
            self.line.say(Frame(heartbeat.COB_ID + self.node_id, bytes([self.state])))

    def _tick_pdos(self, now_s: float) -> None:
        for rpdo in self._active_rpdos:
            rpdo.tick(now_s)
        if self._on_event_tpdos:
            self._refresh()
            for tpdo in self._on_event_tpdos:
                tpdo.tick(now_s)

    def _operational(self) -> bool:
        return self.state is NmtState.OPERATIONAL

    def _refresh(self) -> None:
        for axis in self.axes:
            axis.refresh()
        self.dictionary.pack()

    def _measure(self) -> None:
        """What SDO alone reads, too."""
        self._refresh()
        supply_v = self._supply_v()
        for place, volts in self._supply_places:
            self.dictionary.values[place] = round(supply_v / volts)

    # Loss of the connection

    def _on_lost(self, producer: int) -> None:
        """A heartbeat, or the guard, is gone: EMCY 8130h."""
        self.lost_producers.append(producer)
        self.emcy.raise_error(emcy.HEARTBEAT_LOST, producer)
        for axis in self.axes:
            axis.causes.add(emcy.HEARTBEAT_LOST)
        self._lose_connection(emcy.HEARTBEAT_LOST)

    def _recover_from_bus_off(self) -> None:
        self.line.cut, self._bus_on_at = False, None
        self.emcy.raise_error(emcy.BUS_OFF_RECOVERED)

    def _lose_connection(self, code: int) -> None:
        """6007h for the motors, 1029h:1 for the NMT state."""
        self._abort_connection(code)
        behaviour = self.dictionary.values[key(0x1029, 1)]
        if behaviour == 2:
            self._enter(NmtState.STOPPED)
        elif behaviour == 0 and self.state is NmtState.OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)

    def _on_alive(self, producer: int) -> None:
        self.emcy.clear_error(emcy.HEARTBEAT_LOST, producer)
        needs_reset = self.personality.heartbeat_fault_needs_communication_reset
        lost = self._consumer.any_lost or self.guarding.life is life_guarding.Life.LOST
        if not (lost or needs_reset):
            for axis in self.axes:
                axis.causes.discard(emcy.HEARTBEAT_LOST)

    def _on_deadline(self) -> None:
        """An RPDO's event timer ran out; the EMCY is sent, the motors act as on any lost connection."""
        self._abort_connection(emcy.RPDO_TIMEOUT)

    def _leave_bus(self) -> None:
        """NMT stop or reset communication: 6007h, for the axes that move or could; the others have nothing to abort."""
        for axis in self.axes:
            if axis.state in POWERED:
                axis.abort_connection(COMMUNICATION_FAULT)

    def _abort_connection(self, code: int) -> None:
        for axis in self.axes:
            axis.abort_connection(code)

    # Wiring

    def _make_line(self, answer_delay_s: float) -> Line:
        """Its end of the bus."""
        return Line(answer_delay_s)

    def _make_sdo(self, send: Callable[[Frame], None]) -> sdo_server.SdoService:
        """Its SDO server."""
        return sdo_server.SdoService(self.node_id, self.dictionary, send)

    def _axis(self, number: int, parts: AxisParts) -> Axis:
        def on_change(before: State, transition: Transition) -> None:
            self.changes.append(StateChange(self.node_id, number, before, *transition))

        return Axis(
            self.dictionary,
            number,
            parts.motor,
            parts.scale,
            Encoder(parts.travel_m, parts.motor.step_s),
            parts.encoder_offset,
            tell_error=lambda code: self._tell_fault(code, number),
            tell_clear=lambda code: self.emcy.clear_error(code, number),
            on_change=on_change,
            hold=parts.hold,
            personality=self.personality,
        )

    def _tell_fault(self, code: int, axis: int) -> None:
        """EMCY of an axis' fault; 81xxh and 82xxh were sent by the service that found them."""
        if code >> 8 not in (0x81, 0x82):
            self.emcy.raise_error(code, axis)

    def _send_emcy(self, frame: Frame) -> None:
        if self.state in nmt.HAS_SDO:
            self.line.say_emcy(frame)


def _check_overflow(value: int) -> None:
    if value == 1:
        raise SdoAbortedError(abort.INVALID_VALUE)
