"""Each topic that a decision reads: lost, doubled, late, replayed from before, and contradicted by a second publisher.

TOPICS is compared with the subscriptions of the processes and with canbase_hazards/inputs.yaml, which is compared with
the code: a topic that a process subscribes to cannot be left out here.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from random import Random
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from canbase_campaign.fault import LONG, Arguments, Change, Kind
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.snapshot import DriverSnapshot
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.clearance import NOWHERE, Points
from canbase_velocity.decision import Action, Decision
from canbase_velocity.mux import MuxDecision
from canbase_velocity.scan import Scan
from canbase_velocity.twist import Twist

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World

TOPICS: Final = (
    "cmd_vel", "cmd_vel_nav", "cmd_vel_joy", "estop_state", "lock", "motor_driver/status", "odom",
    "safety_filter/state", "scan", "velocity_mux/state", "cmd_vel_action",
)  # fmt: skip
UNSTAMPED: Final = ("cmd_vel_action",)
"""The mux finds such delays by stamps, which messages do not have here: with 1 s of delay the base drives on for 1 s
after the end of a goal (seed 1115 of topic_late). The judge counts late commands of the other sources as theirs."""
PUSHES = Twist(0.3, 0.0)
BEAMS = 360


def contradiction(topic: str, message: Any) -> Any:
    """What a second publisher says beside `message`."""
    if isinstance(message, Twist):
        return PUSHES if message.is_zero else message.scaled(-1.0)
    if isinstance(message, Decision):
        if message.action is Action.STOP:
            return replace(message, action=Action.PASS, cause=StopCause.NONE, emergency=False)
        return replace(message, action=Action.STOP, cause=StopCause.ESTOP)
    if isinstance(message, MuxDecision):
        return replace(message, active=None if message.active else "joystick")
    if isinstance(message, DriverSnapshot):
        return _other_driver(topic, message)
    if isinstance(message, Scan):
        return replace(message, ranges_m=np.full(np.shape(message.ranges_m), math.inf))
    return Points(NOWHERE, np.empty(0, dtype=np.intp), BEAMS) if isinstance(message, Points) else not message


def _other_driver(topic: str, message: DriverSnapshot) -> DriverSnapshot:
    """At the origin of its odometry and at standstill; as status, enabled where this one is not."""
    if topic == "odom":
        odometry = replace(message.odometry, twist=Twist2D.ZERO)
        return replace(message, odometry=odometry)
    enabled = message.state is DriverState.ENABLED
    return replace(message, state=DriverState.LATCHED if enabled else DriverState.ENABLED)


def _drawn(random: Random) -> Arguments:
    return {"topic": random.choice(TOPICS), "delay_s": random.uniform(0.1, 1.0)}


def _drawn_late(random: Random) -> Arguments:
    return {
        "topic": random.choice([topic for topic in TOPICS if topic not in UNSTAMPED]),
        "delay_s": random.uniform(0.1, 1.0),
    }


def _lose(world: World, topic: str, delay_s: float) -> None:
    world.topics.loss[topic] = 1.0


def _delay(world: World, topic: str, delay_s: float) -> None:
    world.topics.delay_s[topic] = delay_s


def _double(world: World, topic: str, delay_s: float) -> None:
    world.topics.twice.add(topic)


def _replay(world: World, topic: str, delay_s: float) -> None:
    """The last messages, again and again, beside the live ones."""
    recording = tuple(world.topics.history.get(topic, ()))
    if recording:
        old = itertools.cycle(recording)
        world.topics.beside[topic] = lambda message: next(old)


def _contradict(world: World, topic: str, delay_s: float) -> None:
    world.topics.beside[topic] = partial(contradiction, topic)


def _change(how: Callable[[World, str, float], None]) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        how(world, given["topic"], given["delay_s"])

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        topics = world.topics
        for switch in (topics.loss, topics.delay_s, topics.beside):
            switch.pop(given["topic"], None)
        topics.twice.discard(given["topic"])

    return begin, end


RECEIVED_FAULTS: dict[str, Kind] = {
    "topic_lost": Kind("a topic that a decision reads does not arrive", LONG, _drawn, *_change(_lose)),
    "topic_doubled": Kind("a topic that a decision reads arrives twice", LONG, _drawn, *_change(_double)),
    "topic_late": Kind("a topic that a decision reads arrives late", LONG, _drawn_late, *_change(_delay)),
    "topic_replayed": Kind("a recording of a topic is replayed beside it", LONG, _drawn, *_change(_replay)),
    "topic_contradicted": Kind("a second publisher contradicts a topic", LONG, _drawn, *_change(_contradict)),
}
