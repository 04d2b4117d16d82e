"""What sensors do wrong: encoders and scanners that lie."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

from canbase_campaign import bench_faults as bench
from canbase_campaign.fault import LONG, Arguments, Kind, axis_fault, wheel
from canbase_campaign.scanner import LIES, Lie

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World


def _scanner_lies(name: str, lie: Lie) -> Kind:
    """Mostly a wall appears while it lies."""

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        if around.scanner is None:
            around.look_closely()
        assert around.scanner is not None
        around.scanner.begin(name)
        if given["margin_m"] is not None:
            around.put_wall(given["margin_m"])

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        assert around.scanner is not None
        around.scanner.end(name)
        around.take_wall()

    def draw(random: Random) -> Arguments:
        return {"margin_m": random.choice((None, random.uniform(0.0, 0.3), random.uniform(0.0, 0.3)))}

    return Kind(lie.sentence, (1.5, 3.5), draw, begin, end)


SENSOR_FAULTS: dict[str, Kind] = {
    "frozen_encoder": Kind(
        "a position stands still",
        LONG,
        wheel,
        *axis_fault("frozen_position", lambda axis: axis.position(), None),
    ),
    "stuck_velocity": Kind(
        "an actual velocity stands still",
        LONG,
        wheel,
        *axis_fault("stuck_velocity", lambda axis: axis.velocity(), None),
    ),
    "encoder_lost": Kind(
        "all that hangs on one encoder shows nothing",
        LONG,
        wheel,
        *bench.suffer("encoder_lost", bench.heal_encoder),
    ),
    "encoder_frozen": Kind(
        "an encoder counts nothing and shows its last speed",
        LONG,
        wheel,
        *bench.suffer("encoder_frozen", bench.heal_encoder),
    ),
    "encoder_ghost": Kind(
        "an encoder counts nothing and shows a small residue",
        LONG,
        lambda r: {**wheel(r), "residue_mps": r.choice((-1.0, 1.0)) * r.choice((0.0001, 0.0005, 0.003, 0.01, 0.04))},
        *bench.suffer("encoder_ghost", bench.heal_encoder),
    ),
    "encoder_reversed": Kind(
        "an encoder counts backward", LONG, wheel, *bench.suffer("encoder_reversed", bench.heal_encoder),
    ),
    "encoder_scaled": Kind(
        "an encoder counts a share of the motion",
        LONG,
        lambda r: {**wheel(r), "factor": r.choice((0.3, 0.5, 2.0))},
        *bench.suffer("encoder_scaled", bench.heal_encoder),
    ),
    "encoder_jumping": Kind(
        "an encoder jumps to and fro", LONG, wheel, *bench.suffer("encoder_jumping", bench.heal_encoder),
    ),
    "encoder_intermittent": Kind(
        "an encoder comes and goes",
        LONG,
        lambda r: {**wheel(r), "off_s": r.uniform(0.03, 0.2)},
        *bench.suffer("encoder_intermittent", bench.heal_encoder),
    ),
    **{name: _scanner_lies(name, lie) for name, lie in LIES.items()},
}  # fmt: skip
