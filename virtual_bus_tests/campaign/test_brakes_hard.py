"""The emergency stop of the whole chain at 0.8 m/s: whatever becomes of safety_filter/state, it is as short as before.

t = 0     pressed, or a wall appears 0.30 m before the base
0.41 s    standstill after 0.17 m; by the ordinary ramp it would be 0.88 s and 0.36 m
"""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from canbase_campaign.cruise import Cruise
from canbase_campaign.forked import in_a_copy
from canbase_campaign.robots import DrawnRobot, campaign_robot
from canbase_campaign.twins import JOYSTICK
from canbase_campaign.world import World
from canbase_sim.plant.base import PlantParameters
from canbase_velocity.decision import PASSED, Action, Decision
from canbase_velocity.twist import ZERO
from canbase_watchdog.trip_cause import FINE

pytestmark = pytest.mark.campaign
FAST_MPS, LOOK_S, LASTS_S = 0.8, 0.002, 2.5
TOPIC = "safety_filter/state"
CALM = Decision(Action.PASS, PASSED.cause, "", "", ZERO, emergency=False)


@pytest.fixture(scope="module")
def cruise() -> Cruise:
    robot = campaign_robot()
    robot = robot.model_copy(update={"limits": robot.limits.model_copy(update={"linear_mps": FAST_MPS})})
    return Cruise(JOYSTICK, FAST_MPS, DrawnRobot(0, robot, PlantParameters()))


def arrives(world: World) -> None:
    """The topic is well."""


def lost(world: World) -> None:
    world.topics.loss[TOPIC] = 1.0


def doubled(world: World) -> None:
    world.topics.twice.add(TOPIC)


def replayed(world: World) -> None:
    """A second publisher, every 20 ms: nothing brakes."""
    world.topics.publish(TOPIC, CALM)
    world.clock.after(0.02, replayed, world)


def pressed(cruise: Cruise) -> None:
    cruise.around.press(True)


def wall(cruise: Cruise) -> None:
    """0.30 m before the edge of the base, and seen at once."""
    around = cruise.around
    around.put_wall(0.0)
    around.wall_m = 0.30
    cruise.world.topics.publish("scan", around._seen())


def filter_restarts(world: World) -> None:
    """Killed 0.1 s later, back 0.1 s after that: what it knew of the motion is lost."""
    world.clock.after(0.1, world.velocity.die)
    world.clock.after(0.2, world.velocity.restart)


Stop = tuple[float, float, float, bool]


def stop(cruise: Cruise, begin: Callable[[Cruise], None], topic: Callable[[World], None]) -> Stop:
    """Time to standstill [s], distance [m], speed after 0.25 s [m/s], and whether the watchdog has tripped."""
    found = in_a_copy(lambda: _stop(cruise, begin, topic))
    assert isinstance(found, tuple), found
    return found


def _stop(cruise: Cruise, begin: Callable[[Cruise], None], topic: Callable[[World], None]) -> Stop:
    world = cruise.world
    base, clock, since = world.drives.bench.base, world.clock, world.clock.now_s
    topic(world)
    clock.run_until(since + 0.3)
    since, way_m, stands_at, speed_mps = clock.now_s, base.travel_m, math.inf, math.nan
    assert base.v_mps == pytest.approx(FAST_MPS, abs=0.01)
    begin(cruise)
    while clock.now_s < since + LASTS_S:
        clock.run_until(clock.now_s + LOOK_S)
        moving = abs(base.v_mps) > 0.005
        stands_at = math.inf if moving else min(stands_at, clock.now_s)
        speed_mps = base.v_mps if clock.now_s <= since + 0.25 else speed_mps
    return stands_at - since, base.travel_m - way_m, speed_mps, world.watchdog.core.verdict is not FINE


@pytest.mark.parametrize("topic", [arrives, lost, doubled, replayed])
def test_an_emergency_stop_is_as_short_whatever_becomes_of_the_state_of_the_filter(
    cruise: Cruise, topic: Callable[[World], None]
) -> None:
    time_s, way_m, _, tripped = stop(cruise, pressed, topic)
    assert 0.39 < time_s < 0.46
    assert way_m < 0.185
    assert not tripped


@pytest.mark.parametrize("topic", [arrives, lost, doubled, replayed])
def test_the_base_stands_before_a_wall_that_appears(cruise: Cruise, topic: Callable[[World], None]) -> None:
    time_s, way_m, _, tripped = stop(cruise, wall, topic)
    assert time_s < 0.48
    assert way_m < 0.20
    assert not tripped


def test_a_filter_that_restarts_in_between_makes_it_no_longer(cruise: Cruise) -> None:
    time_s, way_m, _, tripped = stop(cruise, wall, lambda world: world.clock.after(0.3, filter_restarts, world))
    assert time_s < 0.48
    assert way_m < 0.20
    assert not tripped
