"""What goes wrong between ROS nodes and around the base: topics, the network, strangers, stop button, walls."""

from __future__ import annotations

import math
from random import Random
from typing import TYPE_CHECKING

from canbase_campaign.fault import LONG, SHORT, Arguments, Change, Kind, intruder, nothing, share, speed
from canbase_campaign.operator_faults import goes_on
from canbase_velocity.twist import Twist

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World

LOOK = 10
"""Each half second the process reads the publishers of each topic."""
SOURCES = ("cmd_vel_joy", "cmd_vel_nav")


def _topic_lost(topic: str) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        world.topics.loss[topic] = given.get("share", 1.0)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.topics.loss.pop(topic, None)

    return begin, end


def _pressed(world: World, around: Surroundings, given: Arguments) -> None:
    around.press(True)


def _released(world: World, around: Surroundings, given: Arguments) -> None:
    around.press(False)


def _wall(world: World, around: Surroundings, given: Arguments) -> None:
    around.put_wall(given["margin_m"])


def _no_wall(world: World, around: Surroundings, given: Arguments) -> None:
    around.take_wall()


def _network(field: str) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        for topic in SOURCES:
            getattr(world.topics, field)[topic] = given["value"]

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        for topic in SOURCES:
            getattr(world.topics, field).pop(topic, None)

    return begin, end


def _twice(world: World, around: Surroundings, given: Arguments) -> None:
    world.topics.twice |= set(SOURCES)


def _once(world: World, around: Surroundings, given: Arguments) -> None:
    world.topics.twice.clear()


def two_on_a_lock(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """The graph has both of them; each publishes ten times a second."""
    if number % LOOK == 0:
        world.topics.publish("publishers", ("lock", ("button", "panel")))
    world.locked_at = min(world.locked_at, world.clock.now_s)
    world.topics.publish("lock", number % 2 == 0)


def one_on_a_lock(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """The one that is left publishes that it does not hold."""
    world.topics.publish("publishers", ("lock", ("panel",)))
    world.topics.publish("lock", False)
    world.locked_at = math.inf


def _restarts(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """Each second a scanner's driver dies and starts again. The graph keeps dead ones for longer than this."""
    starts, since = divmod(number, 2 * LOOK)
    around.scans = since >= given["starts_in"]
    if number % LOOK == 0:
        world.topics.publish("publishers", ("scan", tuple(f"scanner {start}" for start in range(starts + 2))))


def _restarted(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """The graph has forgotten all but the last one."""
    around.scans = True
    world.topics.publish("publishers", ("scan", ("scanner last",)))


def _strange_twist(random: Random) -> Arguments:
    """Mostly a motion, sometimes nonsense."""
    nonsense = Twist(math.nan, math.inf)
    motion = Twist(speed(random), random.choice((0.0, random.uniform(-2.0, 2.0))))
    return {"twist": nonsense if random.random() < 0.1 else motion}


TOPIC_FAULTS: dict[str, Kind] = {
    "two_on_a_lock": Kind(
        "two nodes publish on one lock: one of them says locked, and the other one not", (1.0, 2.5), nothing,
        *goes_on(two_on_a_lock, one_on_a_lock),
    ),
    "scanner_restarts": Kind(
        "a scanner's driver crashes and starts again, each second", (1.0, 3.5),
        lambda r: {"starts_in": r.randint(1, 6)}, *goes_on(_restarts, _restarted),
    ),
    "straight_to_cmd_vel": Kind(
        "somebody publishes to cmd_vel",
        LONG,
        _strange_twist,
        *intruder("twist", "twist", None),
    ),
    "odometry_lost": Kind("odom does not arrive", SHORT, nothing, *_topic_lost("odom")),
    "status_lost": Kind("motor_driver/status does not arrive", SHORT, nothing, *_topic_lost("motor_driver/status")),
    "cmd_vel_lossy": Kind(
        "messages of cmd_vel get lost", (0.3, 2.5), share, *_topic_lost("cmd_vel")
    ),
    "cmd_vel_ends": Kind(
        "cmd_vel does not arrive any more", (6.0, 10.0), nothing, *_topic_lost("cmd_vel")
    ),
    "mux_lossy": Kind(
        "orders of the mux do not reach the filter in its own process", (0.5, 4.0), share, *_topic_lost("cmd_vel_mux")
    ),
    "scan_stale": Kind("no scan arrives", LONG, nothing, *_topic_lost("scan")),
    "estop_stale": Kind("the stop button is not heard", LONG, nothing, *_topic_lost("estop_state")),
    "obstacle": Kind(
        "an obstacle appears", (1.0, 3.0), lambda r: {"margin_m": r.uniform(0.0, 0.3)}, _wall, _no_wall
    ),
    "estop_pressed": Kind("the emergency stop is pressed and released", (0.1, 2.5), nothing, _pressed, _released),
    "radio_gap": Kind("the joystick's radio is lost for a moment", SHORT, nothing, *_topic_lost("cmd_vel_joy")),
    "orders_delayed": Kind(
        "the network delays what sources order", LONG, lambda r: {"value": r.uniform(0.2, 2.0)}, *_network("delay_s")
    ),
    "orders_shuffled": Kind(
        "the network reorders what sources order", LONG, lambda r: {"value": r.uniform(0.02, 0.25)},
        *_network("shuffles_s"),
    ),
    "orders_twice": Kind("the network duplicates what sources order", LONG, nothing, _twice, _once),
}  # fmt: skip
