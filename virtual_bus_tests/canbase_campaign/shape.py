"""What the base does before the faults of a scenario begin: it rests, cruises, brakes, boots, or drives for a minute.

Drawn beside the rest of the plan. Speeds and turns go up to the limits of the robot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from random import Random
from typing import Final

from canbase_campaign.planned import GoalRequest, Plan, Segment
from canbase_config.robot import Robot
from canbase_config.stopping import longest_ramp_s

IN_CI: Final = 400
"""Continuous integration runs the seeds below; in these long scenarios are rare, for they cost as much as 25 others."""
LONG_SHARE, LONG_SHARE_IN_CI = 0.1, 0.02
CRUISES, BRAKES, BOOTS = 0.45, 0.6, 0.7
"""Below these shares of all scenarios, from the one before on."""
CRUISE_S, LONG_S = (1.0, 5.0), (28.0, 115.0)
"""How long the base drives before the first fault can begin [s]."""
BOOT_S = 3.0
"""From power on until the operator drives; faults begin in the first two thirds of it [s]."""
LEG_S = (1.0, 8.0)
"""Of a long drive [s]."""
AT_RESET = 0.3
"""Share of the scenarios with a reset in which a fault begins while that is carried out."""
AROUND_S = (-0.2, 0.4)
"""From the reset [s]."""


def shaped(plan: Plan, robot: Robot, hands: Sequence[str]) -> Plan:
    """The plan with what comes before its faults. `hands`: sources of this robot that order motion."""
    random = Random(f"{plan.seed} shape")
    share, long_share = random.random(), LONG_SHARE if plan.seed >= IN_CI else LONG_SHARE_IN_CI
    plan = _at_reset(plan, random)
    if share < long_share:
        return _long(plan, robot, hands, random)
    if share < CRUISES:
        return _cruising(plan, robot, hands, random)
    if share < BRAKES:
        return _braking(plan, robot, hands, random)
    return _booting(plan, hands, random) if share < BOOTS else plan


def later(plan: Plan, by_s: float) -> Plan:
    """All of it, so much later."""
    return replace(
        plan,
        duration_s=plan.duration_s + by_s,
        segments=tuple(replace(each, start_s=each.start_s + by_s) for each in plan.segments),
        goals=tuple(replace(each, start_s=each.start_s + by_s) for each in plan.goals),
        resets_s=tuple(at_s + by_s for at_s in plan.resets_s),
        faults=tuple(replace(each, start_s=each.start_s + by_s) for each in plan.faults),
    )


def _leg(robot: Robot, hands: Sequence[str], random: Random, start_s: float, lasts_s: float) -> Segment:
    """Straight on, in a curve, or in place, at any speed up to the limits."""
    limits = robot.limits
    linear_mps = random.choice((-1.0, 1.0)) * random.uniform(0.05, 1.0) * limits.linear_mps
    angular_radps = random.uniform(-1.0, 1.0) * limits.angular_radps
    linear_mps, angular_radps = random.choice(
        ((linear_mps, 0.0), (linear_mps, 0.0), (linear_mps, angular_radps), (0.0, angular_radps))
    )
    rate_hz = random.choice((10.0, 20.0, 50.0))
    return Segment(random.choice(hands), start_s, lasts_s, "constant", linear_mps, angular_radps, rate_hz)


def _cruising(plan: Plan, robot: Robot, hands: Sequence[str], random: Random) -> Plan:
    """By a hand, which goes on through the faults; or by a goal, which is far enough for that."""
    lead_s = random.uniform(*CRUISE_S)
    if plan.goals:
        speed_mps = random.uniform(0.1, 1.0) * robot.action.max_speed_mps
        distance_m = min(robot.action.max_distance_m, speed_mps * (lead_s + plan.duration_s))
        goal = GoalRequest(0.0, math.copysign(distance_m, plan.goals[0].distance_m), speed_mps, None)
        plan = later(plan, lead_s)
        return replace(plan, goals=(goal, *plan.goals[1:]))
    leg = _leg(robot, hands, random, 0.0, lead_s + plan.duration_s)
    plan = later(plan, lead_s)
    return replace(plan, segments=(leg, *plan.segments))


def _braking(plan: Plan, robot: Robot, hands: Sequence[str], random: Random) -> Plan:
    """The hand releases, or publishes no more; the faults begin on the ramp down, or just before it."""
    released_s, ramp_s = random.uniform(*CRUISE_S), longest_ramp_s(robot)
    leg = _leg(robot, hands, random, 0.0, released_s)
    rests = (replace(leg, start_s=released_s, duration_s=ramp_s, kind="zero"),) if random.random() < 0.7 else ()
    plan = later(plan, released_s)
    faults = tuple(replace(each, start_s=released_s + random.uniform(-0.1, ramp_s)) for each in plan.faults)
    return replace(plan, segments=(leg, *rests, *plan.segments), faults=faults)


def _booting(plan: Plan, hands: Sequence[str], random: Random) -> Plan:
    """From power on. The hands rest; once the driver should be enabled the operator resets, and drives."""
    rests = tuple(Segment(hand, 0.0, BOOT_S, "zero", 0.0, 0.0, 20.0) for hand in hands)
    faults = tuple(replace(each, start_s=random.uniform(0.0, BOOT_S * 2.0 / 3.0)) for each in plan.faults)
    plan = later(plan, BOOT_S)
    resets_s = (*plan.resets_s, BOOT_S - 0.3) if random.random() < 0.5 else plan.resets_s
    return replace(plan, segments=(*rests, *plan.segments), faults=faults, resets_s=resets_s, boots=True)


def _long(plan: Plan, robot: Robot, hands: Sequence[str], random: Random) -> Plan:
    """Leg after leg, with ramps between them; the faults begin in the last one."""
    end_s, at_s = random.uniform(*LONG_S), 0.0
    legs: list[Segment] = []
    while at_s < end_s:
        lasts_s = min(random.uniform(*LEG_S), end_s - at_s)
        leg = _leg(robot, hands, random, at_s, lasts_s)
        legs.append(replace(leg, kind=random.choice(("constant", "constant", "constant", "weave", "zero"))))
        at_s += lasts_s
    last = _leg(robot, hands, random, end_s, plan.duration_s)
    plan = later(plan, end_s)
    return replace(plan, segments=(*legs, last, *plan.segments))


def _at_reset(plan: Plan, random: Random) -> Plan:
    """What latches comes first; the last fault comes while the reset is carried out."""
    if len(plan.faults) < 2 or not plan.resets_s or random.random() >= AT_RESET:
        return plan
    last = replace(plan.faults[-1], start_s=max(0.0, random.choice(plan.resets_s) + random.uniform(*AROUND_S)))
    return replace(plan, faults=(*plan.faults[:-1], last))
