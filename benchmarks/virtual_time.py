"""How much faster than real time a two-wheel robot runs in virtual time: drives and body alone, and with the cores.

The floor: the same body and motors stepped in a bare loop, without a bus, a drive or anybody who orders.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable

from canbase_sim.frame import Frame
from canbase_sim.plant.base import Base, MountedWheel, PlantParameters
from figures import Figure
from support.chain_world import FORWARD, World, bench_robot
from support.sim_rig import MPS, Rig

SECONDS = 60.0
QUICK_S = 15.0
BUDGET = 100.0


def quick() -> list[Figure]:
    """The same in less time."""
    return measure(QUICK_S)


def measure(seconds: float = SECONDS) -> list[Figure]:
    """The bench, and the bench with driver and watchdog."""
    floor = _ratio(_body(seconds), seconds)
    drives, chain = _ratio(_bench(seconds), seconds), _ratio(_chain(seconds), seconds)
    return [
        _figure("simulated drives and body, setpoints and SYNC at 100 Hz, driving", drives, floor),
        _figure("the same with driver and watchdog, driving at 0.3 m/s", chain, floor),
    ]


def _figure(what: str, ratio: float, floor: float) -> Figure:
    beside, measured = f"the body alone, in a bare loop: {floor:.0f} ×", f"{ratio:.0f} × real time"
    kept = ratio >= BUDGET
    return Figure(f"virtual time: {what}", measured, beside, ratio / floor, "≥ 100 ×", kept, more_is_better=True)


def _ratio(run: Callable[[], object], seconds: float) -> float:
    """How much faster than real time, by the time of this process: what others do on the computer does not count."""
    began_s = time.process_time()
    run()
    return seconds / (time.process_time() - began_s)


def _body(seconds: float) -> Callable[[], object]:
    robot, body = bench_robot(), PlantParameters()
    left, right = (MountedWheel(body.motor(2), 1) for _ in range(2))
    base = Base(body, robot.base.track_m, robot.base.standstill_mps, [left], [right], 0.0)
    for wheel in (left, right):
        wheel.motor.power_on()
        wheel.motor.run(FORWARD.linear_mps, 1.0, 1.0)

    def run() -> None:
        for step in range(1, round(seconds / body.step_s)):
            base.step(step * body.step_s)

    return run


def _bench(seconds: float) -> Callable[[], object]:
    rig = Rig()
    rig.drive(MPS // 2, MPS // 2, 1.0)
    cycle = [Frame(0x200 + node, struct.pack("<Hi", 0x0F, sign * MPS // 2)) for node, sign in ((1, 1), (2, -1))]
    cycle.append(Frame(0x080, b""))

    def run() -> None:
        for _ in range(round(seconds * 100.0)):
            rig.now_s += 0.01
            for frame in cycle:
                rig.bench.on_frame(frame, rig.now_s)
            rig.bench.tick(rig.now_s)

    return run


def _chain(seconds: float) -> Callable[[], object]:
    world = World()
    world.drive(FORWARD)
    return lambda: world.run(seconds)


if __name__ == "__main__":
    for figure in measure():
        print(figure)
