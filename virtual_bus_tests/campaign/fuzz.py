"""Random and malformed frames and leases against driver core, watchdog and simulated drives.

No exception, no motion, flat memory. `python -m campaign.fuzz [frames]` runs each kind with a million frames.
"""

from __future__ import annotations

import logging
import multiprocessing
import resource
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random

from canbase_campaign.world import World
from canbase_driver.cia301.frame import Frame
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from canbase_watchdog.watchdog import State, Watchdog

MILLION = 1_000_000
CYCLE_S = 0.01
FRAMES_A_CYCLE = 20
FUNCTIONS = (0x000, 0x080, 0x100, 0x180, 0x200, 0x280, 0x300, 0x380, 0x400, 0x480, 0x500, 0x580, 0x600, 0x700)
NODES = (0, 1, 2, 3, 126, 127)
SETPOINTS = (0x200, 0x300)
SDO_REQUEST = 0x600
WARM_UP = 5
"""The memory is compared from this part of the frames on, once in this many: until then tables and caches fill."""
GROWTH = 3000
"""This many blocks of memory may be more at the end: the number in use differs from moment to moment."""
GROWTH_BYTES = 4 * 2**20
"""The same for the memory of the whole process."""
LEASES = 5
"""One lease to this many frames."""
PRE_OPERATIONAL, RESET_NODE = 0x80, 0x81
STOPS = (b"\x00\x00", b"\x02\x00")
"""6040h: disable voltage, quick stop."""


class FuzzError(AssertionError):
    """A property did not hold; the text names the frame."""


def random_frame(random: Random) -> tuple[int, bytes]:
    """Any identifier and length; mostly the identifiers that somebody listens to."""
    if random.random() < 0.25:
        cob_id = random.randrange(0x800)
    else:
        cob_id = (random.choice(FUNCTIONS) + random.choice(NODES)) & 0x7FF
    return cob_id, random.randbytes(random.choice((0, 1, 2, 2, 4, 4, 6, 6, 6, 7, 8, 8, 8)))


def fuzz_driver(frames: int, seed: int = 0) -> int:
    """Frames from anybody into an enabled driver that has no command: it never orders motion. Returns what it sent."""
    world, random = _enabled(), Random(seed)
    core, now_s, sent = world.driver.core, world.clock.now_s, 0

    def step(number: int) -> None:
        nonlocal now_s, sent
        cob_id, data = random_frame(random)
        out = core.on_frame(Frame(cob_id, data), now_s)
        if number % FRAMES_A_CYCLE == 0:
            now_s += CYCLE_S
            out += core.tick(now_s)
            core.snapshot(now_s)
        for frame in out:
            if frame.cob_id & 0x780 in SETPOINTS and frame.cob_id & 0x7F < 0x7E and any(frame.data[2:]):
                raise FuzzError(f"after frame {number}, {cob_id:03X} {data.hex(' ')}, the driver ordered {frame}")
        sent += len(out)

    _run(step, frames)
    return sent


def fuzz_watchdog(frames: int, seed: int = 0) -> int:
    """Frames and leases, good, damaged and random ones, into a watchdog: it trips, stays so, and sends nothing but
    stops. Returns how many of its frames were stops.
    """
    world, random = _enabled(), Random(seed)
    watchdog, now_s, stops = world.watchdog.core, world.clock.now_s, 0
    tripped = False

    def step(number: int) -> None:
        nonlocal now_s, stops, tripped
        cob_id, data = random_frame(random)
        watchdog.on_frame(cob_id, b"" if data[1:] == b"RST" else data, now_s)
        if number % LEASES == 0:
            watchdog.on_lease(random_lease(random, number + 1, now_s), None, now_s)
        if number % FRAMES_A_CYCLE == 0:
            now_s += CYCLE_S / 2.0
            stops += _count_stops(watchdog, now_s)
            if tripped and watchdog.status.state is not State.TRIPPED:
                raise FuzzError(f"after frame {number}, {cob_id:03X} {data.hex(' ')}, the watchdog forgot its trip")
            tripped = watchdog.status.state is State.TRIPPED

    _run(step, frames)
    if not tripped:
        raise FuzzError("the watchdog never tripped: it was not reached")
    return stops


def random_lease(random: Random, sequence: int, now_s: float) -> bytes:
    """A good lease, one with a byte changed, one cut short, or noise."""
    twist = Twist(random.uniform(-9.0, 9.0), random.choice((0.0, 1e300, -1e300)))
    stamp_ns = round((now_s + random.choice((0.0, 0.0, -1.0, 1.0))) * 1e9)
    datagram = lease_datagram(sequence, stamp_ns, twist, brakes_hard=False)
    kind = random.randrange(4)
    if kind == 0:
        at = random.randrange(len(datagram))
        return datagram[:at] + random.randbytes(1) + datagram[at + 1 :]
    if kind == 1:
        return datagram[: random.randrange(len(datagram))]
    return datagram if kind == 2 else random.randbytes(random.choice((0, 43, 44, 44, 45, 2000)))


def is_stop(cob_id: int, data: bytes) -> bool:
    """Quick stop or power off, NMT pre-operational, an SDO that reads or takes power away. FuzzError: any other."""
    function = cob_id & 0x780
    if cob_id == 0x000:
        allowed = data[0] in (PRE_OPERATIONAL, RESET_NODE)
    elif function == 0x500:
        allowed = data in STOPS
    elif function == SDO_REQUEST:
        allowed = data[0] == 0x40 or data[4:6] in STOPS
    else:
        allowed = cob_id in (0x1FE, 0x2FE, 0x77E)
    if not allowed or len(data) > 8:
        raise FuzzError(f"the watchdog sent {cob_id:03X} {data.hex(' ')}")
    return cob_id == 0x000 or function in (0x500, SDO_REQUEST)


def _count_stops(watchdog: Watchdog, now_s: float) -> int:
    return sum(is_stop(frame.cob_id, frame.data) for frame in watchdog.tick(now_s))


def fuzz_drives(frames: int, seed: int = 0) -> float:
    """Frames into enabled drives, without those that order something: they never turn. Returns the way [m]."""
    return _fuzz_bench(frames, seed, everything=False)


def fuzz_drives_with_orders(frames: int, seed: int = 0) -> float:
    """All frames: the drives may turn then, as somebody orders it, but nothing raises. Returns the way [m]."""
    return _fuzz_bench(frames, seed, everything=True)


def orders(cob_id: int, data: bytes) -> bool:
    """A complete setpoint, or an SDO download: what a drive has to obey, whatever its sender."""
    if cob_id & 0x780 in SETPOINTS:
        return len(data) >= 6
    return cob_id & 0x780 == SDO_REQUEST and len(data) == 8 and data[0] >> 5 in (1, 6)


def _fuzz_bench(frames: int, seed: int, everything: bool) -> float:
    world, random = _enabled(), Random(seed)
    bench, now_s = world.drives.bench, world.clock.now_s

    def step(number: int) -> None:
        nonlocal now_s
        cob_id, data = random_frame(random)
        if not everything and orders(cob_id, data):
            return
        for node in bench.nodes.values():
            node.on_frame(cob_id, data, now_s)
        if number % FRAMES_A_CYCLE == 0:
            now_s += CYCLE_S
            bench.tick(now_s)
            bench.state_changes()
        if not everything and (bench.base.v_left_mps or bench.base.v_right_mps):
            raise FuzzError(f"after frame {number}, {cob_id:03X} {data.hex(' ')}, the wheels turn")

    _run(step, frames)
    return bench.base.path_m


def _run(step: Callable[[int], None], frames: int) -> None:
    for number in range(frames // WARM_UP):
        step(number)
    before, before_bytes = sys.getallocatedblocks(), _resident_bytes()
    for number in range(frames // WARM_UP, frames):
        step(number)
    grown = sys.getallocatedblocks() - before
    if grown > GROWTH:
        raise FuzzError(f"memory grew by {grown} blocks in {frames} frames")
    if _resident_bytes() - before_bytes > GROWTH_BYTES:
        raise FuzzError(f"memory grew by {_resident_bytes() - before_bytes} bytes in {frames} frames")


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def _enabled() -> World:
    world = World()
    world.topics.loss["scan"] = 1.0
    world.topics.publish("estop_state", False)
    world.enable()
    return world


KINDS: dict[str, tuple[Callable[[int], float], str]] = {
    "driver": (fuzz_driver, "frames sent, no motion ordered"),
    "watchdog": (fuzz_watchdog, "stops sent, and nothing else; it stayed tripped"),
    "drives": (fuzz_drives, "m, no order among the frames"),
    "drives, with orders": (fuzz_drives_with_orders, "m, nothing raised"),
}


def _fuzz(frames: int, kind: str) -> float:
    logging.disable()
    return KINDS[kind][0](frames)


def main(frames: int) -> None:
    """Each kind in a process of its own, two at a time."""
    with multiprocessing.get_context("spawn").Pool(2, maxtasksperchild=1) as pool:
        for kind, result in zip(KINDS, pool.imap(partial(_fuzz, frames), KINDS), strict=True):
            print(f"{kind}: {frames} frames, {result:.2f} {KINDS[kind][1]}, memory flat")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else MILLION)
