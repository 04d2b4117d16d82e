"""What will happen in one scenario, drawn from its seed: orders of each source, faults, resets. Only data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from random import Random

from canbase_campaign.fault import PlannedFault
from canbase_campaign.faults import ADDED, ADDED_LATER, FAULTS
from canbase_campaign.planned import GoalRequest, Plan, Segment
from canbase_campaign.robots import bitrates, robot_of
from canbase_campaign.scanner import LIES
from canbase_campaign.shape import shaped
from canbase_config.action import Action
from canbase_config.robot import Robot
from canbase_velocity.twist import Twist

FAULTS_S = (0.1, 0.9)
"""Faults begin in this part of a scenario."""
SCENARIO_S = (1.7, 2.4)
MOST_FAULTS = 4
SAMPLE_MPS, SAMPLE_RADPS = 0.8, 2.0
"""Limits of the sample robot."""
SECOND_LIFE = 0.08
"""Share of the scenarios that go on: stop, reset by a person, driving again, a second fault."""
LIES_S = 2.0
"""So much longer is a scenario whose scanner lies: until the base has come to where the wall is."""
FIRST_LIFE_S = 1.5
"""The faults of a first life last at most this long [s]."""
ADDED_SHARE, ADDED_LATER_SHARE = 0.03, 0.015
"""Share of the scenarios that have one of canbase_campaign.faults.ADDED, or of ADDED_LATER."""
HANDS = ("joystick", "navigation")
"""Sources that order motion, by their names in robot.yaml; a robot may lack the second one."""
KINDS = ("constant", "constant", "constant", "weave", "burst", "nan", "zero")
"""How a source behaves for a while; a word that stands more often is drawn more often."""


def _added(seed: int, later: bool) -> Iterator[str]:
    """Those of ADDED, and of ADDED_LATER, that this scenario has too; each is drawn by itself."""
    for names, share in ((ADDED, ADDED_SHARE), (ADDED_LATER if later else (), ADDED_LATER_SHARE)):
        yield from (name for name in names if Random(f"{seed} {name}").random() < share)


def draw_plan(seed: int, only: Sequence[str] = (), from_rest: bool = False) -> Plan:
    """The same seed gives the same plan, for the robot of this seed. `only`: the faults to draw from; empty: all.

    `from_rest`: without the drive before the faults, and without ADDED_LATER: as in all reports up to 2026-11-26.
    """
    robot = robot_of(seed).robot
    plan = plan_for(robot, seed, bitrates(robot), only, later=not from_rest)
    return plan if from_rest else shaped(plan, robot, [name for name in HANDS if name in robot.mux.sources])


def plan_for(robot: Robot, seed: int, rates: Sequence[int], only: Sequence[str] = (), later: bool = False) -> Plan:
    """A plan for this robot. `rates`: bit rates to draw from [bit/s]. `later`: ADDED_LATER is drawn too.

    Speeds are drawn for the sample robot, and scaled to the limits of this one.
    """
    pool = sorted(only or FAULTS.keys() - ADDED - set(ADDED_LATER))
    random = Random(seed)
    duration_s = random.uniform(*SCENARIO_S)
    by_goals = random.random() < 0.35
    hands = [name for name in HANDS if name in robot.mux.sources]
    segments = () if by_goals and random.random() < 0.5 else _segments(random, duration_s, hands, late=by_goals)
    names = random.sample(pool, min(random.randint(1, MOST_FAULTS), len(pool)))
    plan = Plan(
        seed,
        duration_s,
        random.choice(rates),
        tuple(_scaled_segment(segment, robot) for segment in segments),
        _goals(random, robot.action) if by_goals else (),
        tuple(random.uniform(0.8, duration_s) for _ in range(random.choice((0, 0, 1, 1, 2)))),
        tuple(_fault(name, random, robot) for name in names),
    )
    more = () if only else tuple(_fault(name, Random(f"{seed} {name}"), robot) for name in _added(seed, later))
    plan = replace(plan, faults=(*plan.faults, *more))
    if any(fault.name in LIES for fault in plan.faults):
        plan = _longer(plan, LIES_S)
    suspended_s = sum(fault.duration_s for fault in plan.faults if fault.name == "suspend")
    if suspended_s:
        plan = _longer(plan, suspended_s + LIES_S)
    return _with_second_life(plan, pool, random, robot) if random.random() < SECOND_LIFE else plan


def _longer(plan: Plan, by_s: float) -> Plan:
    """Somebody drives on, whatever happens."""
    first, rest = plan.segments[:1], plan.segments[1:]
    longer = tuple(replace(segment, duration_s=segment.duration_s + by_s) for segment in first)
    return replace(plan, duration_s=plan.duration_s + by_s, segments=(*longer, *rest))


def _with_second_life(plan: Plan, pool: Sequence[str], random: Random, robot: Robot) -> Plan:
    """Once the faults are over a person releases the joystick, resets until it works, and drives again."""
    faults = tuple(replace(fault, duration_s=min(fault.duration_s, FIRST_LIFE_S)) for fault in plan.faults)
    over_s = max(plan.duration_s, *(fault.start_s + fault.duration_s for fault in faults)) + 0.2
    drives_s = over_s + random.uniform(2.2, 2.8)
    hand = Segment("joystick", over_s, drives_s - over_s, "zero", 0.0, 0.0, 20.0)
    again = replace(hand, start_s=drives_s, duration_s=1.8, kind="constant", linear_mps=random.uniform(0.2, 0.8))
    second = _fault(random.choice(pool), random, robot)
    return replace(
        plan,
        duration_s=drives_s + 2.2,
        segments=(*plan.segments, hand, _scaled_segment(again, robot)),
        resets_s=(*plan.resets_s, *(over_s + wait_s for wait_s in (0.4, 1.0, 1.7))),
        faults=(*faults, replace(second, start_s=drives_s + random.uniform(0.5, 1.2))),
    )


def _scales(robot: Robot) -> tuple[float, float]:
    """Limits of this robot in those of the sample: linear, angular."""
    return robot.limits.linear_mps / SAMPLE_MPS, robot.limits.angular_radps / SAMPLE_RADPS


def _scaled_segment(segment: Segment, robot: Robot) -> Segment:
    linear, angular = _scales(robot)
    return replace(segment, linear_mps=linear * segment.linear_mps, angular_radps=angular * segment.angular_radps)


def _scaled(value: object, name: str, robot: Robot) -> object:
    linear, angular = _scales(robot)
    if isinstance(value, Twist):
        return Twist(linear * value.linear_mps, angular * value.angular_radps)
    return linear * value if name == "speed" and isinstance(value, float) else value


def _segments(random: Random, duration_s: float, hands: Sequence[str], late: bool) -> tuple[Segment, ...]:
    """Mostly somebody drives when the faults come; `late`: a goal drives first, and may be taken over."""
    segments: list[Segment] = []
    for _ in range(random.randint(1, 3)):
        first = not segments and not late
        start_s = random.uniform(0.0, 0.3) if first else random.uniform(0.5, duration_s)
        kind = "constant" if first else random.choice(KINDS)
        linear_mps = random.choice((-1.0, 1.0)) * random.uniform(0.1, 1.0)
        angular_radps = random.choice((0.0, 0.0, random.uniform(-2.5, 2.5)))
        rate_hz = 200.0 if kind == "burst" else random.choice((10.0, 20.0, 50.0))
        source = random.choice(hands)
        lasts_s = random.uniform(0.4, duration_s) if first else random.uniform(0.1, 1.5)
        segments.append(Segment(source, start_s, lasts_s, kind, linear_mps, angular_radps, rate_hz))
    return tuple(segments)


def _goals(random: Random, action: Action) -> tuple[GoalRequest, ...]:
    goals = []
    for number in range(random.randint(1, 2)):
        start_s = random.uniform(0.0, 0.2) + number * random.uniform(0.3, 1.5)
        distance_m = math.copysign(random.uniform(0.02, 0.8), random.choice((-1.0, 1.0)))
        cancel_after_s = random.uniform(0.1, 1.5) if random.random() < 0.25 else None
        speed_mps = min(random.uniform(0.1, 0.5), action.max_speed_mps)
        goals.append(GoalRequest(start_s, distance_m, speed_mps, cancel_after_s))
    return tuple(goals)


def _fault(name: str, random: Random, robot: Robot) -> PlannedFault:
    kind = FAULTS[name]
    start_s = random.uniform(*FAULTS_S)
    lasts_s, drawn = random.uniform(*kind.lasts_s), kind.draw(random)
    return PlannedFault(name, start_s, lasts_s, {key: _scaled(value, key, robot) for key, value in drawn.items()})
