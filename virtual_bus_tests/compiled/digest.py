"""`python -m compiled.digest --first 0 --seeds 3`: how many modules are compiled; then one line
for each scenario and robot, over all of its frames.

Each frame counts with its time, its sender and its bytes, and so do the result and the true pose at the end, to the
last bit. Run interpreted and compiled, both have to print the same: `python -m compiled.same` compares them.
"""

from __future__ import annotations

import argparse
import hashlib
from dataclasses import replace
from importlib import import_module

from canbase_campaign.ordinary import OrdinaryHour
from canbase_campaign.plan import draw_plan
from canbase_campaign.robots import robot_of
from canbase_campaign.scenario import Start
from canbase_campaign.world import World
from compiled.modules import hot_modules

DRIVE_S = 8.0
"""Ordinary driving of each seed's robot."""


class Digest:
    """Of one world, from now on."""

    def __init__(self, world: World) -> None:
        self._world, self._hash, self._frames = world, hashlib.sha256(), 0
        world.bus.watch = self._take

    def _take(self, sender: str, cob_id: int, data: bytes) -> None:
        self._frames += 1
        self._hash.update(f"{self._world.clock.now_s.hex()} {sender} {cob_id:X} {data.hex()}\n".encode())

    def line(self, name: str, result: object) -> str:
        """`name`, how many frames there were, and what they and `result` come to."""
        base = self._world.drives.bench.base
        pose = [value.hex() for value in (base.x_m, base.y_m, base.turned_rad, base.v_left_mps, base.v_right_mps)]
        self._hash.update(f"{result} {pose}".encode())
        return f"{name}: {self._frames} frames {self._hash.hexdigest()}"


def of_scenario(seed: int) -> str:
    """A scenario of the campaign, with the boot before it."""
    start = Start(robot_of(seed))
    digest = Digest(start.world)
    return digest.line(f"scenario {seed}", replace(start.run(draw_plan(seed)), processor_s=0.0))


def of_robot(seed: int) -> str:
    """Ordinary driving of one robot."""
    hour = OrdinaryHour(seed)
    digest = Digest(hour.world)
    return digest.line(f"robot {seed}", hour.run(DRIVE_S))


def main() -> None:
    """Seeds from the command line."""
    parser = argparse.ArgumentParser(prog="compiled.digest", description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=10)
    given = parser.parse_args()
    print(sum(not str(import_module(module).__file__).endswith(".py") for module in hot_modules()), flush=True)
    for seed in range(given.first, given.first + given.seeds):
        print(of_scenario(seed), flush=True)
        print(of_robot(seed), flush=True)


if __name__ == "__main__":
    main()
