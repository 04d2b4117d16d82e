"""What a drive does wrong behind a CANopen stack that lives: it hangs, lies, forgets, leaves, or has no supply."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import TYPE_CHECKING

from canbase_campaign.fault import LONG, SHORT, Arguments, Change, Kind, nothing, stays, wheel
from canbase_campaign.operator_faults import goes_on
from canbase_sim.cia402.axis import Axis
from canbase_sim.cia402.states import POWERED

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World

UNDERVOLTAGE, OVERVOLTAGE = 0x3220, 0x3210
"""603Fh."""
REGENERATES_W = -1.0
"""Motors that give back more power than this raise the voltage of a supply that takes none [W]."""
DERATES_TO, DERATES_EVERY_S = 0.2, 0.05
REGULARLY_S = 0.01


def _axis(world: World, given: Arguments) -> Axis:
    return world.drives.axis(given["wheel"])


def _switch(do: Callable[[Axis, Arguments], None], undo: Callable[[Axis], None]) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        do(_axis(world, given), given)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        undo(_axis(world, given))

    return begin, end


def _freeze(axis: Axis, given: Arguments) -> None:
    axis.refresh()
    axis.faults.frozen = True


def _unfreeze(axis: Axis) -> None:
    axis.faults.frozen = False


def _stick_on(axis: Axis, given: Arguments) -> None:
    axis.faults.stuck_on = True


def _let_off(axis: Axis) -> None:
    axis.faults.stuck_on = False
    if axis.state not in POWERED:
        axis.motor.power_off()


def _stick_status(axis: Axis, given: Arguments) -> None:
    axis.faults.stuck_status = axis.dictionary.values[0x6041 + 0x800 * axis.number << 8]


def _tell_status(axis: Axis) -> None:
    axis.faults.stuck_status = None


def _stick_torque(axis: Axis, given: Arguments) -> None:
    axis.faults.stuck_torque = given["per_mille"]


def _tell_torque(axis: Axis) -> None:
    axis.faults.stuck_torque = None


def _hinder(axis: Axis, given: Arguments) -> None:
    axis.faults.cannot_enable = True


def _allow(axis: Axis) -> None:
    axis.faults.cannot_enable = False


def _drag(axis: Axis, given: Arguments) -> None:
    axis.hold(given["share"] * axis.motor.peak_force_n)


def _free(axis: Axis) -> None:
    axis.hold(0.0)


def _forget(world: World, around: Surroundings, given: Arguments) -> None:
    world.drives.node(given["wheel"]).lose_settings()


def _leave(world: World, around: Surroundings, given: Arguments) -> None:
    world.drives.node(given["wheel"]).leave_operational()


def _fail_all(world: World, code: int) -> None:
    for node in world.drives.bench.nodes.values():
        for number, axis in enumerate(node.axes):
            if axis.motor.powered:
                axis.motor.power_off()
                node.fail(number, code, holds=True)


def _brown_out(world: World, around: Surroundings, given: Arguments) -> None:
    """Too little voltage for the power stages, enough for their controllers."""
    _fail_all(world, UNDERVOLTAGE)


def _supply(world: World, around: Surroundings, given: Arguments) -> None:
    for node in world.drives.bench.nodes.values():
        for number in range(len(node.axes)):
            node.heal(number)


def _regenerate(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """A battery that takes no power: as soon as a motor brakes, all power stages switch themselves off."""
    motors = [axis.motor for node in world.drives.bench.nodes.values() for axis in node.axes]
    if sum(motor.force_n * motor.speed_mps for motor in motors) < REGENERATES_W:
        _fail_all(world, OVERVOLTAGE)


def _restore(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    _supply(world, around, given)


def _derate(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """Its motor gets hot, and its drive gives less and less."""
    _axis(world, given).weaken(max(DERATES_TO, 1.0 - number * given["step"]))


def _cool(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    _axis(world, given).weaken(1.0)


def _torque(random: Random) -> Arguments:
    return {**wheel(random), "per_mille": random.choice((0, 0, random.randint(-1000, 1000)))}


FAULTY_DRIVES: dict[str, Kind] = {
    "drive_frozen": Kind(
        "a drive's application hangs, its CANopen stack lives", LONG, wheel, *_switch(_freeze, _unfreeze)
    ),
    "drive_stuck_on": Kind(
        "a power stage does not switch off, its statusword obeys", LONG, wheel, *_switch(_stick_on, _let_off)
    ),
    "status_stuck": Kind("a statusword does not change", LONG, wheel, *_switch(_stick_status, _tell_status)),
    "torque_lies": Kind("a drive's torque does not change", LONG, _torque, *_switch(_stick_torque, _tell_torque)),
    "settings_lost": Kind("a drive loses its settings while it runs", SHORT, wheel, _forget, stays),
    "leaves_operational": Kind("a drive enters PRE-OPERATIONAL by itself", SHORT, wheel, _leave, stays),
    "enables_slowly": Kind("a power stage is not ready to switch on", LONG, wheel, *_switch(_hinder, _allow)),
    "brownout": Kind("all power stages have too little voltage", SHORT, nothing, _brown_out, _supply),
    "overvoltage": Kind(
        "a battery takes no power back", LONG, nothing, *goes_on(_regenerate, _restore, REGULARLY_S)
    ),
    "derating": Kind(
        "a hot drive gives less and less torque", (1.0, 2.5), lambda r: {**wheel(r), "step": r.uniform(0.02, 0.2)},
        *goes_on(_derate, _cool, DERATES_EVERY_S),
    ),
    "brake_drags": Kind(
        "a brake drags", LONG, lambda r: {**wheel(r), "share": r.uniform(0.1, 0.95)}, *_switch(_drag, _free)
    ),
}  # fmt: skip
