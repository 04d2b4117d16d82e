"""Odd drives from a seed: each has one to three oddities, often none beside an odd one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from random import Random

from canbase_sim.odd.manner import Manner
from canbase_sim.odd.oddities import ALIKE, ODDITIES
from canbase_sim.odd.oddity import Drawn

MOST = 3
"""Oddities of one drive."""
UNUSABLE_SHARE, FEW = 0.3, 5
"""Drives that nobody can use show nothing else: most are left out, where there is anything else to draw from."""


@dataclass(frozen=True, slots=True)
class OddDrive:
    """What one drive has. `seed`: of what it draws while it runs."""

    seed: int
    drawn: tuple[Drawn, ...] = ()

    @property
    def manner(self) -> Manner:
        """All its oddities."""
        manner = Manner()
        for each in self.drawn:
            manner = each.change(manner)
        return manner

    def without(self, gone: Iterable[Drawn]) -> OddDrive:
        """After the manufacturer's tool has set something right."""
        gone = tuple(gone)
        return replace(self, drawn=tuple(each for each in self.drawn if each not in gone))

    def __str__(self) -> str:
        return "; ".join(f"{each.name}: {each.text}" for each in self.drawn) or "nothing odd"


def draw(seed: int, node_ids: Iterable[int], only: Iterable[str] = ()) -> dict[int, OddDrive]:
    """The same seed gives the same drives, by node id. `only`: the oddities to draw from; empty: all."""
    random, names = Random(f"odd drives {seed}"), sorted(only or ODDITIES)
    return {node_id: OddDrive(seed, _draw_one(random, names)) for node_id in node_ids}


def _draw_one(random: Random, names: list[str]) -> tuple[Drawn, ...]:
    drawn: list[Drawn] = []
    for name in random.sample(names, min(random.randint(1, MOST), len(names))):
        each = replace(ODDITIES[name].draw(random), name=name)
        others = {other.name for other in drawn}
        if any(name in alike and others & alike for alike in ALIKE):
            continue
        if not each.unusable or len(names) <= FEW or random.random() < UNUSABLE_SHARE:
            drawn.append(each)
    return tuple(drawn)
