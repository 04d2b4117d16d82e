"""What an odd drive does that others do not: what it refuses, how it answers, what it adds to its frames. Only data.

All of it is legal: oddities.py has the clause for each. What a kind of drive lacks or has elsewhere is its personality.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from canbase_sim.personality import GENERIC, Personality


@dataclass(frozen=True, slots=True)
class Bounds:
    """Values that an entry takes: from `low` to `high`, in steps. `code`: how it aborts others; 0: it takes the nearest
    of its own in their place."""

    low: int
    high: int
    step: int = 1
    code: int = 0

    def nearest(self, value: int) -> int:
        """What it takes in place of `value`."""
        inside = min(max(value, self.low), self.high)
        return self.low + (inside - self.low) // self.step * self.step


@dataclass(frozen=True, slots=True)
class Manner:
    """How one odd drive behaves. Entries are `index << 8 | sub-index`."""

    personality: Personality = GENERIC
    refused_reads: Mapping[int, int] = field(default_factory=dict)
    """Abort codes of entries that cannot be read."""
    refused_writes: Mapping[int, int] = field(default_factory=dict)
    bounds: Mapping[int, Bounds] = field(default_factory=dict)
    answers_sized: bool = True
    """False: expedited uploads have neither e's count of bytes nor the size bit, and always four bytes."""
    answers_expedited: bool = True
    """False: each upload takes segments, however short the object is."""
    answer_jitter_s: float = 0.0
    """Each SDO answer may come so much later [s]."""
    answers_lost: float = 0.0
    """Share of its SDO requests that it never answers."""
    frames_twice: float = 0.0
    """Share of its frames that are on the bus twice."""
    pdo_late_s: float = 0.0
    """Its synchronous TPDOs come up to so much after the SYNC [s]."""
    reset_s: float = 0.0
    """From NMT reset communication to the boot-up message, beyond what others need [s]."""
    boot_ups: bool = True
    """False: it sends no boot-up message."""
    status_bits: int = 0
    """Bits that come and go in its statusword."""
    velocity_noise: int = 0
    """606Ch is up to so many bits beside the speed."""
    emcy_every_s: float = 0.0
    """An emergency message of the manufacturer's, followed by "no error", so often [s]; 0: none."""
    start_count: int | None = None
    """6064h after power on."""
    tpdo_padding: int = 0
    """Its first TPDO has so many bytes behind those that are mapped."""
    refuses_first: bool = False
    """The first write to each entry after power on is refused with 0800 0022h."""
    heartbeat_late_s: float = 0.0
    """From a boot-up message to the first heartbeat [s]."""
    mode_late_s: float = 0.0
    """6061h follows 6060h so late, and the motor with it [s]."""
    counts_per_m: float = 0.0
    """Increments of 6064h for one metre of the rim, whatever robot.yaml has; 0: as robot.yaml has it."""
    position_range: int = 0
    """6064h wraps within 0 to this (607Bh)."""
    velocity_sign: int = 1
    """Of 606Ch, against 60FFh and 6064h."""
    velocity_held_s: float = 0.0
    """606Ch has a new value so often [s]; 0: always."""
    velocity_spike: int = 0
    """606Ch is so many bits beside the speed in a sample of SPIKE_SHARE."""
    answers_again: float = 0.0
    """Share of its SDO answers that are on the bus a second time, some milliseconds later."""
    heartbeat_jitter_s: float = 0.0
    """Each heartbeat comes up to so much after its time [s]."""
    heartbeat_bits: int = 0
    """Bits that are set beside the NMT state."""
    nmt_late_s: float = 0.0
    """It obeys an NMT command so late [s]."""
    enable_late_s: float = 0.0
    """From "enable operation" to operation enabled [s]: a brake, a search for the commutation angle."""
    motionless_s: float = 0.0
    """After operation enabled it follows no setpoint for so long [s]."""
    remote_late_s: float = 0.0
    """Bit 9 of the statusword is set so long after power on [s]; before it ignores the controlword."""
    local_after_s: float = 0.0
    """So long after its first motion somebody takes it into local mode [s]: bit 9 is 0, and it stops by itself."""
    fails_after_s: float = 0.0
    """So long after its first motion it has a fault, over-voltage, that clears itself FAULT_S later [s]."""
