"""An odd drive on the bus: the simulated drive with a manner of its own."""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from random import Random

from canbase_sim.axis_parts import AxisParts
from canbase_sim.cia301 import nmt, sdo_server
from canbase_sim.cia301.dictionary import AXIS_STRIDE, key
from canbase_sim.cia402.axis import Axis
from canbase_sim.cia402.states import State
from canbase_sim.frame import Frame
from canbase_sim.line import Line
from canbase_sim.node import SimulatedNode
from canbase_sim.odd.manner import Manner
from canbase_sim.odd.odd_line import OddLine
from canbase_sim.odd.odd_sdo import OddSdoService
from canbase_sim.plant.battery import REST_V

MAKERS_CODE, NO_ERROR = 0xFF01, 0x0000
"""Emergency codes: FFxxh is the manufacturer's (CiA 301)."""
EMCY_S = 0.05
"""From one to the "no error" after it, at most [s]."""
OVERVOLTAGE, FAULT_S = 0x3210, 0.3
SPIKE_SHARE = 0.005
REMOTE = 0x0200
"""Bit of the statusword."""


def _unloaded() -> float:
    return REST_V


class OddNode(SimulatedNode):
    """What is random is drawn from `seed`."""

    def __init__(
        self,
        node_id: int,
        axes: Sequence[AxisParts],
        now_s: float,
        manner: Manner,
        seed: int,
        boot_delay_s: float = 0.1,
        fixed: Mapping[int, int] | None = None,
        sdo_delay_s: float = 0.0,
        supply_v: Callable[[], float] = _unloaded,
    ) -> None:
        self.manner, self._random = manner, Random(f"odd {seed} {node_id}")
        self._emcy_at, self._is_error = now_s, False
        self._is_up = False
        self._modes: dict[int, tuple[int, float]] = {}
        self._commands: deque[tuple[float, bytes]] = deque()
        self._moved_at = self._fault_at = math.inf
        self._on_at, self._held = now_s, [(-math.inf, 0)] * len(axes)
        self._switched_on_at, self._enabled_at = [math.inf] * len(axes), [math.inf] * len(axes)
        super().__init__(node_id, axes, now_s, boot_delay_s, fixed, manner.personality, sdo_delay_s, supply_v)
        self._is_up = True
        for tpdo in self._tpdos:
            tpdo._send = self._odd_line.say_pdo
        if manner.start_count is not None:
            for axis in self.axes:
                axis.encoder_offset = manner.start_count

    def tick(self, now_s: float) -> list[Frame]:
        """As every drive, and its emergency messages."""
        if self.manner.emcy_every_s and now_s >= self._emcy_at and self.state in nmt.HAS_SDO:
            self._is_error = not self._is_error
            every_s = self.manner.emcy_every_s
            self._emcy_at = now_s + (min(EMCY_S, every_s) if self._is_error else every_s)
            code = MAKERS_CODE if self._is_error else NO_ERROR
            self._send_emcy(Frame(0x080 + self.node_id, struct.pack("<HB5x", code, 0x80 * self._is_error)))
        self._follow_modes(now_s)
        while self._commands and now_s >= self._commands[0][0]:
            super()._on_nmt(self._commands.popleft()[1], now_s)
        for number, axis in enumerate(self.axes):
            self._take_power(number, axis, now_s)
            self._lose_it(axis, now_s)
        return super().tick(now_s)

    def _on_nmt(self, data: bytes, now_s: float) -> None:
        """Some time later."""
        self._commands.append((now_s + self.manner.nmt_late_s, data))

    def _take_power(self, number: int, axis: Axis, now_s: float) -> None:
        """Slowly, and not before it is remote."""
        manner = self.manner
        waits_for_power, waits_for_motion = axis.state is State.SWITCHED_ON, axis.state is State.OPERATION_ENABLED
        self._switched_on_at[number] = min(self._switched_on_at[number], now_s) if waits_for_power else math.inf
        self._enabled_at[number] = min(self._enabled_at[number], now_s) if waits_for_motion else math.inf
        is_late = now_s < self._switched_on_at[number] + manner.enable_late_s
        if manner.enable_late_s and axis.faults.cannot_enable is not is_late:
            axis.faults.cannot_enable = is_late
            axis._obey()
        is_motionless = now_s < self._enabled_at[number] + manner.motionless_s
        if manner.motionless_s and axis.faults.ignores_setpoints is not is_motionless:
            axis.faults.ignores_setpoints = is_motionless
            axis._steer()
        if waits_for_motion and axis._target_mps():
            self._moved_at = min(self._moved_at, now_s)

    def _lose_it(self, axis: Axis, now_s: float) -> None:
        """Local mode, or a fault that does not stay."""
        manner = self.manner
        if self._is_taken(now_s) and not axis.faults.ignores_setpoints:
            axis._stop(axis._value(0x5D), lambda: None)
            axis.faults.ignores_setpoints = True
        if manner.fails_after_s and self._fault_at == math.inf and now_s >= self._moved_at + manner.fails_after_s:
            self._fault_at = now_s
            axis.fail(OVERVOLTAGE)
        if axis.state is State.FAULT and now_s >= self._fault_at + FAULT_S:
            axis._reset_fault()

    def _is_taken(self, now_s: float) -> bool:
        """Into local mode."""
        return self.manner.local_after_s > 0.0 and now_s >= self._moved_at + self.manner.local_after_s

    def _follow_modes(self, now_s: float) -> None:
        """6061h and the motor, some time after 6060h."""
        if not self.manner.mode_late_s:
            return
        for number, axis in enumerate(self.axes):
            mode = self.dictionary.values[key(0x6060 + AXIS_STRIDE * number)]
            if mode != self._modes.get(number, (0, 0.0))[0]:
                self._modes[number] = mode, now_s
            waits = now_s < self._modes.get(number, (0, -math.inf))[1] + self.manner.mode_late_s
            if waits or axis.faults.ignores_setpoints:
                self.dictionary.values[key(0x6061 + AXIS_STRIDE * number)] = 0 if waits else mode
                axis.faults.ignores_setpoints = waits
                axis._steer()

    def _make_line(self, answer_delay_s: float) -> Line:
        self._odd_line = OddLine(answer_delay_s, self.manner, self._random)
        return self._odd_line

    def _make_sdo(self, send: Callable[[Frame], None]) -> sdo_server.SdoService:
        return OddSdoService(self.node_id, self.dictionary, send, self.manner)

    def _reset_communication(self, boot_at: float, loader_s: float = 0.0) -> None:
        super()._reset_communication(boot_at + self.manner.reset_s * self._is_up, loader_s)

    def _refresh(self) -> None:
        super()._refresh()
        self._odd_line.now_s = self._now
        values, manner = self.dictionary.values, self.manner
        for number, axis in enumerate(self.axes):
            base = AXIS_STRIDE * number
            values[key(0x606C + base)] = self._shown_velocity(number, axis, values[key(0x606C + base)])
            counts = key(0x6064 + base)
            if manner.position_range:
                values[counts] %= manner.position_range + 1
            elif manner.counts_per_m:
                scaled = values[counts] * manner.counts_per_m / axis.scale.counts_per_m
                values[counts] = (round(scaled) + 2**31) % 2**32 - 2**31
            if manner.status_bits:
                values[key(0x6041 + base)] |= self._random.getrandbits(16) & manner.status_bits
            if self._now < self._on_at + manner.remote_late_s or self._is_taken(self._now):
                values[key(0x6041 + base)] &= ~REMOTE

    def _shown_velocity(self, number: int, axis: Axis, velocity: int) -> int:
        """606Ch."""
        manner = self.manner
        if manner.velocity_noise:
            velocity = axis.scale.limited(
                velocity + self._random.randint(-manner.velocity_noise, manner.velocity_noise)
            )
        velocity *= manner.velocity_sign
        if manner.velocity_spike and self._random.random() < SPIKE_SHARE:
            velocity = axis.scale.limited(velocity + manner.velocity_spike)
        at_s, held = self._held[number]
        if self._now >= at_s + manner.velocity_held_s:
            self._held[number] = self._now, velocity
            return velocity
        return held
