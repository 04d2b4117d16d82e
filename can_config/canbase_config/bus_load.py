"""How much of the bus the frames of every cycle take, worked out before anything is sent: ISO 11898-1, docs/bus.md.

Counted with as many stuff bits as there can be, so that the real load stays below. Boots, tools and other nodes come
on top. Pure numbers; `robot.py` refuses a bus that cannot carry them, `load.py` warns of one that is nearly full.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from canbase_config.drive_values import ValuePdo, value_pdos
from canbase_config.object_map import (
    CONTROLWORD,
    POSITION_ACTUAL,
    STATUSWORD,
    TARGET_VELOCITY,
    TORQUE_OBJECTS,
    VELOCITY_ACTUAL,
    place,
)
from canbase_config.watchdog import GUARDS_PER_TIMEOUT, HEARTBEATS_PER_TIMEOUT

if TYPE_CHECKING:
    from canbase_config.drive import Drive
    from canbase_config.robot import Robot

BUSY_LOAD: Final = 0.6
"""Above, frames with high COB-IDs wait for others, and boots take long; heartbeats have the highest of all."""
FULL_LOAD: Final = 0.9
"""Above, one frame that is repeated after an error delays the heartbeats by cycles: such a bus is refused."""
BITRATES: Final = (125_000, 250_000, 500_000, 800_000, 1_000_000)
"""Of CiA 301, those that are worth proposing [bit/s]."""
LEAST_CONTROL_HZ: Final = 20

STATE_HZ, COUNTERS_HZ = 20.0, 2.0
"""Of the watchdog: 1FEh and 2FEh, eight bytes each."""
OVERHEAD_BITS, STUFFED_BITS = 47, 34
"""Of a data frame with an 11-bit identifier: without its data, and what of it gets stuff bits (ISO 11898-1)."""


def frame_bits(data_bytes: int) -> int:
    """Length of a data frame on the wire with as many stuff bits as there can be, and the gap behind it [bit]."""
    return OVERHEAD_BITS + 8 * data_bytes + (STUFFED_BITS + 8 * data_bytes - 1) // 4


def traffic_bits(frames: int, data_bytes: int) -> int:
    """The same for so many frames with so many bytes of data in all [bit]; a 29-bit frame counts as an 11-bit one."""
    return frames * frame_bits(0) + data_bytes * (frame_bits(1) - frame_bits(0))


def cyclic_load(robot: Robot, bitrate: int | None = None) -> float:
    """Share of the bus's time, at most, that setpoints, SYNC, feedback, heartbeats and the watchdog's frames take."""
    return (_cycle_bits(robot) * robot.rates.control_hz + _slow_bits_per_s(robot)) / (bitrate or robot.bus.bitrate)


def values_bits_per_s(robot: Robot) -> float:
    """The part of named values."""
    return sum(frame_bits(pdo.data_bytes) * robot.rates.control_hz / pdo.every for pdo in _value_pdos(robot))


def full(robot: Robot) -> str:
    """Why the bus cannot carry its frames, with the way out; empty: it can, or has no wire."""
    return _sentence(robot, "too much to rely on") if _is_above(robot, FULL_LOAD) else _crowded(robot)


def _crowded(robot: Robot) -> str:
    """Named values come all at the same SYNC, now and then. They go before the watchdog's quick stop (500h + id): the
    cycle in which they come must carry everything, too."""
    pdos = _value_pdos(robot)
    all_at_once = sum(frame_bits(pdo.data_bytes) * (1.0 - 1.0 / pdo.every) for pdo in pdos) * robot.rates.control_hz
    peak = cyclic_load(robot) + all_at_once / robot.bus.bitrate
    if robot.bus.is_virtual or not pdos or peak <= FULL_LOAD:
        return ""
    return (
        f"the control cycle in which all `values` of the drives are sent ({len(pdos)} PDOs) takes up to {peak:.0%} of "
        f"its time at rates.control_hz {robot.rates.control_hz:g} and {robot.bus.bitrate} bit/s, the limit is "
        f"{FULL_LOAD:.0%}: take values out, lower control_hz, or raise the bit rate of the bus and all drives"
    )


def _value_pdos(robot: Robot) -> list[ValuePdo]:
    return [pdo for drive in robot.drives for pdo in value_pdos(drive.values, robot.rates.control_hz)]


def busy(robot: Robot) -> str:
    """That the bus is nearly full, with the way out; empty: it is not, or has no wire."""
    return _sentence(robot, "little room is left for boots and tools") if _is_above(robot, BUSY_LOAD) else ""


def _is_above(robot: Robot, share: float) -> bool:
    return not robot.bus.is_virtual and cyclic_load(robot) > share


def _sentence(robot: Robot, verdict: str) -> str:
    return (
        f"the cyclic frames of {len(robot.drives)} motors at rates.control_hz {robot.rates.control_hz:g} take up to "
        f"{cyclic_load(robot):.0%} of {robot.bus.bitrate} bit/s: {verdict}; "
        f"{' or '.join(_ways_out(robot)) or 'use fewer drives on one bus'}"
    )


def _ways_out(robot: Robot) -> list[str]:
    """What brings the load down to BUSY_LOAD."""
    ways = []
    bitrate = next((rate for rate in BITRATES if cyclic_load(robot, rate) <= BUSY_LOAD), None)
    if bitrate is not None:
        ways.append(f"set the bus and all drives to {bitrate} bit/s ({cyclic_load(robot, bitrate):.0%})")
    room_bits_per_s = BUSY_LOAD * robot.bus.bitrate - _slow_bits_per_s(robot)
    control_hz = math.floor(room_bits_per_s / _cycle_bits(robot))
    if control_hz >= LEAST_CONTROL_HZ:
        ways.append(f"lower control_hz to {control_hz}")
    return ways


def _cycle_bits(robot: Robot) -> int:
    sync_bytes = 0 if robot.bus.sync_counter is None else 1
    return frame_bits(sync_bytes) + sum(_axis_bits(drive) for drive in robot.drives)


def _axis_bits(drive: Drive) -> int:
    """Setpoint, status, and velocity with torque, of one motor: docs/bus.md. One TPDO for all of them takes less."""
    torque = TORQUE_OBJECTS.get(drive.kind.options.torque)
    velocity = (VELOCITY_ACTUAL,) if torque is None else (VELOCITY_ACTUAL, torque)
    pdos = (CONTROLWORD, TARGET_VELOCITY), (STATUSWORD, POSITION_ACTUAL), velocity
    return sum(frame_bits(sum(_mapped_bits(drive, index) for index in pdo) // 8) for pdo in pdos)


def _mapped_bits(drive: Drive, index: int) -> int:
    return place(drive.kind, index, drive.axis).bits


def _slow_bits_per_s(robot: Robot) -> float:
    """Heartbeats of every node, the driver's and the watchdog's, the watchdog's state frames, and named values.

    A guarded node answers requests, frames without data, in place of heartbeats.
    """
    guarded = {drive.node_id for drive in robot.drives if drive.kind.self_stop.node_guarding}
    beating = {drive.node_id for drive in robot.drives} - guarded
    beats = (len(beating) + 2) * HEARTBEATS_PER_TIMEOUT * frame_bits(1)
    guards = len(guarded) * GUARDS_PER_TIMEOUT * (frame_bits(0) + frame_bits(1))
    return (
        (beats + guards) / robot.timeouts.drive_heartbeat_s
        + (STATE_HZ + COUNTERS_HZ) * frame_bits(8)
        + values_bits_per_s(robot)
    )
