"""An odd drive on the bus: the simulated drive with a manner of its own."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from random import Random

from canbase_sim.axis_parts import AxisParts
from canbase_sim.cia301 import nmt, sdo_server
from canbase_sim.cia301.dictionary import AXIS_STRIDE, key
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
"""From one to the "no error" after it [s]."""


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
            self._emcy_at = now_s + (EMCY_S if self._is_error else self.manner.emcy_every_s)
            code = MAKERS_CODE if self._is_error else NO_ERROR
            self._send_emcy(Frame(0x080 + self.node_id, struct.pack("<HB5x", code, 0x80 * self._is_error)))
        self._follow_modes(now_s)
        return super().tick(now_s)

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
            if manner.velocity_noise:
                noise = self._random.randint(-manner.velocity_noise, manner.velocity_noise)
                velocity = key(0x606C + base)
                values[velocity] = axis.scale.limited(values[velocity] + noise)
            counts = key(0x6064 + base)
            if manner.position_range:
                values[counts] %= manner.position_range + 1
            elif manner.counts_per_m:
                scaled = values[counts] * manner.counts_per_m / axis.scale.counts_per_m
                values[counts] = (round(scaled) + 2**31) % 2**32 - 2**31
            values[key(0x606C + base)] *= manner.velocity_sign
            if manner.status_bits:
                values[key(0x6041 + base)] |= self._random.getrandbits(16) & manner.status_bits
