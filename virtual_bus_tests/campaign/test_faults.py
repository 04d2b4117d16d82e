"""No fault is a switch that nothing is connected to: each changes what is on the bus or on a topic."""

from __future__ import annotations

import zlib
from random import Random

import pytest

from canbase_campaign.faults import FAULTS
from canbase_campaign.forked import in_a_copy
from canbase_campaign.plan import draw_plan
from canbase_campaign.received_faults import RECEIVED_FAULTS
from canbase_campaign.robots import SCENARIOS, draw_robot
from canbase_campaign.scenario import Start
from canbase_campaign.world import World
from canbase_sim.cia402.states import State
from canbase_sim.plant.encoder import EncoderFault
from canbase_velocity.twist import ZERO, Twist

pytestmark = pytest.mark.campaign
DRIVES_S, HOLDS_S, LASTS_S = 0.8, 0.6, 1.6
"""Before the fault; until the operator orders zero; in all."""
BY = ("joystick", "goal")
SEEN_THE_SAME = {"disk_hangs", "scanner_mirrored", "scanner_clock_slewed", "sender_clock_slewed", "slip", "wheel_size"}
"""Each scan has its direction of counting: the filter sees the same room. A clock that is slewed is within the timeout
for longer than this. No encoder sees how far a wheel moves the base. No loop waits for a disk."""
NOT_AT_SPEED = {"driver_never_lets_go", "enables_slowly"}
"""Seen when a wheel is released, or a drive is enabled."""
SEEN_WITH = {"drive_unbraked": "driver_dies", "drive_stuck_on": "driver_dies", "overvoltage": "driver_dies"}
"""Seen only when something stops the base by the drives' own ramps."""


@pytest.fixture(scope="module")
def start() -> Start:
    return Start()


@pytest.fixture(scope="module")
def undisturbed(start: Start) -> dict[str, int]:
    return {by: digest(start, by) for by in BY}


@pytest.mark.parametrize("fault", [fault for fault in FAULTS if fault not in NOT_AT_SPEED])
def test_every_fault_changes_what_happens_but_for_what_is_seen_the_same(
    start: Start, undisturbed: dict[str, int], fault: str
) -> None:
    other = SEEN_WITH.get(fault, "")
    usual = {by: digest(start, by, other) for by in BY} if other else undisturbed
    changes = any(digest(start, by, *filter(None, (fault, other))) != usual[by] for by in BY)
    assert changes is (fault not in SEEN_THE_SAME)


@pytest.mark.parametrize("holds", [False, True])
def test_a_driver_that_never_lets_go_leaves_the_power_on_after_a_touch(holds: bool) -> None:
    """t   0 encoder dead; 0.1 a touch of 0.08 s; 0.4 the power has been off for a moment, or not"""
    start = Start()
    world = start.world
    world.drives.axis(0).lose_encoder(EncoderFault())
    world.driver.never_lets_go = holds
    world.drives.changes()
    for step in range(8):
        twist = Twist(0.05, 0.0) if step < 4 else ZERO
        world.clock.at(world.clock.now_s + 0.1 + 0.02 * step, world.topics.publish, "cmd_vel_joy", twist)
    world.clock.run_until(world.clock.now_s + 0.4)
    without_power = [change for change in world.drives.changes() if change.after is State.SWITCHED_ON]
    assert bool(without_power) is not holds


ALONE = {
    "frame_duplication": {"foreign_master"}, "lease_garbage": set(), "orders_shuffled": set(), "orders_twice": set(),
    "resets_too_early": set(), "status_lost": set(), "two_hands": set(), **{fault: set() for fault in RECEIVED_FAULTS},
}  # fmt: skip
"""Faults with a row of their own in hazards.yaml, and what the watchdog may trip on."""
ROBOT, PLANS = 0, 4


@pytest.fixture(scope="module")
def drawn() -> Start:
    return Start(draw_robot(ROBOT))


@pytest.mark.parametrize("fault", sorted(ALONE))
def test_alone_it_breaks_no_property_and_trips_only_where_it_looks_like_another_master(
    drawn: Start, fault: str
) -> None:
    results = [drawn.fork(draw_plan(SCENARIOS * ROBOT + number, (fault,))) for number in range(PLANS)]
    assert [violation for result in results for violation in result.violations] == []
    assert {trip for result in results for trip in result.trips} == ALONE[fault]
    assert sum(result.moved_m for result in results) > 0.5


def test_without_a_fault_nothing_changes(start: Start, undisturbed: dict[str, int]) -> None:
    assert {by: digest(start, by) for by in BY} == undisturbed


def digest(start: Start, by: str, *faults: str) -> int:
    """Checksum of every frame and every message of a drive with these faults, in a copy of this process."""
    found = in_a_copy(lambda: _drive(start, by, *faults))
    assert found is not None, "the drive ended with an exception"
    return found


def _drive(start: Start, by: str, *faults: str) -> int:
    world, sums = start.world, [0]

    def hear(*what: object) -> None:
        sums[0] = zlib.crc32(repr(what).encode(), sums[0])

    start.around.reset = lambda: hear("reset")
    world.bus.watch = lambda sender, cob_id, data: hear(sender, cob_id, data)
    world.topics.watch = lambda topic, message: hear(topic) if topic != "scan" else None
    if by == "goal":
        world.action.send_goal(2.0, 0.4)
    else:
        _push(world, world.clock.now_s + DRIVES_S + HOLDS_S)
    world.clock.run_until(world.clock.now_s + DRIVES_S)
    for fault in faults:
        FAULTS[fault].begin(world, start.around, FAULTS[fault].draw(Random(1)))
    world.clock.run_until(world.clock.now_s + LASTS_S)
    return sums[0]


def _push(world: World, until: float) -> None:
    world.topics.publish("cmd_vel_joy", Twist(0.4 if world.clock.now_s < until else 0.0, 0.0))
    world.clock.after(0.05, _push, world, until)
