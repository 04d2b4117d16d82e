"""What is wrong between motor and floor: slip, wheels of another size, wheels in the air, a broken coupling, a push."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import TYPE_CHECKING

from canbase_campaign.fault import LONG, Arguments, Change, Kind, stays, wheel

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World
    from canbase_sim.plant.base import Base

SIDES = ("left", "right")


def _side(do: Callable[[Base, Arguments], None], undo: Callable[[Base, str], None]) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        do(world.drives.bench.base, given)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        undo(world.drives.bench.base, given["side"])

    return begin, end


def _grip(base: Base, given: Arguments) -> None:
    base.grip(given["side"], given["grip"])


def _hold(base: Base, side: str) -> None:
    base.grip(side, 1.0)


def _lift(base: Base, given: Arguments) -> None:
    base.lift(given["side"], True)


def _put_down(base: Base, side: str) -> None:
    base.lift(side, False)


def _uncouple(world: World, around: Surroundings, given: Arguments) -> None:
    axis = world.drives.axis(given["wheel"])
    loose = any(rotor.motor is axis.motor for rotor in world.drives.bench.base.loose_rotors)
    if not axis.uncoupled and not loose:
        axis.uncoupled = True
        rotor = world.drives.bench.base.uncouple(axis.motor)
        axis.encoder.follow(lambda: rotor.travel_m)


def _loosen(world: World, around: Surroundings, given: Arguments) -> None:
    axis, base = world.drives.axis(given["wheel"]), world.drives.bench.base
    if axis.uncoupled or any(rotor.motor is axis.motor for rotor in base.loose_rotors):
        return
    rotor = base.loosen(axis.motor, given["play_m"])
    axis.encoder.follow(lambda: rotor.travel_m)
    base.resting = False


def _push(world: World, around: Surroundings, given: Arguments) -> None:
    base = world.drives.bench.base
    base.push_n += given["share"] * world.drives.friction_n
    base.resting = False


def _let_go(world: World, around: Surroundings, given: Arguments) -> None:
    world.drives.bench.base.push_n -= given["share"] * world.drives.friction_n


def _drawn_side(random: Random) -> Arguments:
    return {"side": random.choice(SIDES)}


MECHANICS_FAULTS: dict[str, Kind] = {
    "slip": Kind(
        "the wheels of a side slip", LONG, lambda r: {**_drawn_side(r), "grip": r.uniform(0.0, 0.95)},
        *_side(_grip, _hold),
    ),
    "wheel_size": Kind(
        "the wheels of a side are larger or smaller than stated", (2.0, 4.0),
        lambda r: {**_drawn_side(r), "grip": r.uniform(0.8, 1.15)}, *_side(_grip, _hold),
    ),
    "lifted": Kind("the wheels of a side leave the floor", LONG, _drawn_side, *_side(_lift, _put_down)),
    "coupling_broken": Kind("the coupling of a motor and its wheel breaks", LONG, wheel, _uncouple, stays),
    "backlash": Kind(
        "the gear of a motor has play", LONG, lambda r: {**wheel(r), "play_m": r.uniform(0.0005, 0.004)}, _loosen, stays
    ),
    "pushed": Kind(
        "somebody pushes the base, with less than its friction", LONG,
        lambda r: {"share": r.choice((-1.0, 1.0)) * r.uniform(0.3, 0.9)}, _push, _let_go,
    ),
}  # fmt: skip
