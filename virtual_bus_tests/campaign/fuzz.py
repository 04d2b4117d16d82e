"""Random and malformed frames against the driver's core and the simulated drives: no exception, no motion, flat memory.

`python -m campaign.fuzz [frames]` runs each kind with a million frames.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from random import Random

from campaign.world import World
from canbase_driver.frame import Frame

MILLION = 1_000_000
CYCLE_S = 0.01
FRAMES_A_CYCLE = 20
FUNCTIONS = (0x000, 0x080, 0x100, 0x180, 0x200, 0x280, 0x300, 0x380, 0x400, 0x480, 0x500, 0x580, 0x600, 0x700)
NODES = (0, 1, 2, 3, 126, 127)
SETPOINTS = (0x200, 0x300)
SDO_REQUEST = 0x600
WARM_UP = 5
"""The memory is compared from this part of the frames on, one in so many: until then tables and caches fill."""
GROWTH = 3000
"""Blocks of memory that may be more at the end: what is in use at one moment differs by so many."""


class FuzzError(AssertionError):
    """A property did not hold; the text says which frame."""


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
    core, now, sent = world.driver.core, world.clock.now, 0

    def step(number: int) -> None:
        nonlocal now, sent
        cob_id, data = random_frame(random)
        out = core.on_frame(Frame(cob_id, data), now)
        if number % FRAMES_A_CYCLE == 0:
            now += CYCLE_S
            out += core.tick(now)
            core.snapshot(now)
        for frame in out:
            if frame.cob_id & 0x780 in SETPOINTS and frame.cob_id & 0x7F < 0x7E and any(frame.data[2:]):
                raise FuzzError(f"after frame {number}, {cob_id:03X} {data.hex(' ')}, the driver ordered {frame}")
        sent += len(out)

    _run(step, frames)
    return sent


def fuzz_drives(frames: int, seed: int = 0) -> float:
    """Frames into enabled drives, without those that order something: they never turn. Returns the way [m]."""
    return _fuzz_bench(frames, seed, everything=False)


def fuzz_drives_with_orders(frames: int, seed: int = 0) -> float:
    """All frames: the drives may turn then, as somebody orders it, but nothing raises. Returns the way [m]."""
    return _fuzz_bench(frames, seed, everything=True)


def orders(cob_id: int, data: bytes) -> bool:
    """A complete setpoint, or an SDO download: what a drive has to obey, whoever sends it."""
    if cob_id & 0x780 in SETPOINTS:
        return len(data) >= 6
    return cob_id & 0x780 == SDO_REQUEST and len(data) == 8 and data[0] >> 5 in (1, 6)


def _fuzz_bench(frames: int, seed: int, everything: bool) -> float:
    world, random = _enabled(), Random(seed)
    bench, now = world.drives.bench, world.clock.now

    def step(number: int) -> None:
        nonlocal now
        cob_id, data = random_frame(random)
        if not everything and orders(cob_id, data):
            return
        for node in bench.nodes.values():
            node.on_frame(cob_id, data, now)
        if number % FRAMES_A_CYCLE == 0:
            now += CYCLE_S
            bench.tick(now)
            bench.state_changes()
        if not everything and (bench.base.v_left_mps or bench.base.v_right_mps):
            raise FuzzError(f"after frame {number}, {cob_id:03X} {data.hex(' ')}, the wheels turn")

    _run(step, frames)
    return bench.base.path_m


def _run(step: Callable[[int], None], frames: int) -> None:
    for number in range(frames // WARM_UP):
        step(number)
    before = sys.getallocatedblocks()
    for number in range(frames // WARM_UP, frames):
        step(number)
    grown = sys.getallocatedblocks() - before
    if grown > GROWTH:
        raise FuzzError(f"memory grew by {grown} blocks in {frames} frames")


def _enabled() -> World:
    world = World()
    world.topics.loss["scan"] = 1.0
    world.topics.publish("estop_state", False)
    world.enable()
    return world


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else MILLION
    print(f"driver: {count} frames, {fuzz_driver(count)} sent, no motion ordered")
    print(f"drives: {count} frames, {fuzz_drives(count):.3f} m")
    print(f"drives, with orders: {count} frames, {fuzz_drives_with_orders(count):.3f} m, nothing raised")
