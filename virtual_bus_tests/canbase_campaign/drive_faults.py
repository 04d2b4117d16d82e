"""What drives, motors and wheels do wrong, their sensors apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

from canbase_campaign import bench_faults as bench
from canbase_campaign.fault import LONG, SHORT, Arguments, Kind, axis_fault, stays, wheel

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World


def _fails(world: World, around: Surroundings, given: Arguments) -> None:
    world.drives.node(given["wheel"]).fail(world.drives.place(given["wheel"])[1], 0x7305, holds=True)


def _heals(world: World, around: Surroundings, given: Arguments) -> None:
    world.drives.node(given["wheel"]).heal(world.drives.place(given["wheel"])[1])


def _power_cycle(world: World, around: Surroundings, given: Arguments) -> None:
    world.drives.node(given["wheel"]).power_cycle(world.clock.now_s, given["off_s"])


DRIVE_FAULTS: dict[str, Kind] = {
    "cable_cut_one_drive": Kind("one drive is cut off", SHORT, wheel, *bench.suffer("cut", bench.join)),
    "drive_silent": Kind("one drive hears and says nothing", SHORT, wheel, *bench.suffer("silent", bench.speak)),
    "drive_fault": Kind("one drive is in fault", SHORT, wheel, _fails, _heals),
    "drive_power_cycle": Kind(
        "one drive is off for a while", SHORT, lambda r: {**wheel(r), "off_s": r.uniform(0.05, 0.8)}, _power_cycle,
        stays,
    ),
    "drive_ignores_setpoints": Kind(
        "a drive ignores setpoints", LONG, wheel, *axis_fault("ignores_setpoints", lambda axis: True, False)
    ),
    "wheel_blocked": Kind("something holds a wheel", LONG, wheel, *bench.suffer("blocked", bench.let_loose)),
    "wheel_limited": Kind(
        "a drive follows a share of its setpoint",
        LONG,
        lambda r: {**wheel(r), "share": r.uniform(0.0, 0.7)},
        *bench.suffer("limited", bench.unlimit),
    ),
    "motor_weak": Kind(
        "a motor has a share of its force",
        LONG,
        lambda r: {**wheel(r), "share": r.choice((0.0, r.uniform(0.0, 0.5)))},
        *bench.suffer("weak", bench.strengthen),
    ),
    "drive_unbraked": Kind(
        "a drive reports its stops and brakes with a share of their slopes, or not at all",
        LONG,
        lambda r: {**wheel(r), "share": r.choice((0.0, 0.0, r.uniform(0.0, 0.3)))},
        *bench.suffer("unbraked", bench.brake),
    ),
    "setpoints_lost": Kind(
        "setpoints do not reach one drive, or one of several does",
        LONG,
        lambda r: {**wheel(r), "every": r.choice((0, 0, 2, 5))},
        *bench.suffer("rpdo_lost", bench.hear_setpoints),
    ),
    "feedback_lost": Kind(
        "one drive's feedback is lost", LONG, wheel, *bench.suffer("tpdo_lost", bench.give_feedback)
    ),
    "drive_sto": Kind("STO opens at one drive", SHORT, wheel, *bench.suffer("sto", bench.give_torque)),
    "drive_resets": Kind("one drive starts again", SHORT, wheel, *bench.suffer("reset_node", bench.stay)),
    "drive_bus_off": Kind(
        "one drive's CAN controller leaves the bus", SHORT, wheel, *bench.suffer("bus_off", bench.stay)
    ),
}  # fmt: skip
