"""Every goal ends once, in its time; one that succeeded is where it should be, by the ground truth."""

from __future__ import annotations

import math

from canbase_campaign.action_process import Goal
from canbase_campaign.allowance import is_late
from canbase_campaign.excuses import Ledger
from canbase_campaign.judged_by import CYCLES, lag_s, max_wheel_mps
from canbase_campaign.odometry_judge import FLOOR_M, SHARE, Place, true_place
from canbase_campaign.shown import Shown
from canbase_campaign.world import World
from canbase_hazards.stated_times import STATE_LOST_S, STATE_PERIOD_S, stated_s
from canbase_velocity.twist import Twist

STEP_S = 0.01
OWN_TOPIC = "cmd_vel_action"
TOLERANCES = 3.0
"""This many times action.tolerance_m: wheels roll a little until they stand."""


class GoalJudge:
    """To be called every step, and at each end."""

    def __init__(self, world: World, shown: Shown, ledger: Ledger) -> None:
        self._world, self._shown, self._ledger = world, shown, ledger
        self._lag_s = CYCLES / world.robot.rates.control_hz + lag_s(world.drawn.body)
        self._from: dict[int, Place] = {}
        """Where the base truly was when a goal began; a goal during which an encoder lies is not compared."""
        sources = world.robot.mux.sources.values()
        own = max((source.priority for source in sources if source.topic == OWN_TOPIC), default=0)
        self._higher = {source.topic for source in sources if source.priority > own}
        self._taken: dict[int, float] = {}
        """When a source of higher priority, or a lock, took the base from a goal that ran."""

    def arrived(self, topic: str, twist: Twist) -> None:
        """A command has arrived at the mux: a source of higher priority has the base, at zero too."""
        if topic in self._higher and twist.is_finite and self._world.velocity.running:
            self._take()

    def _take(self) -> None:
        for goal in self._world.action.goals[-1:]:
            if not goal.ends and not goal.died:
                self._taken.setdefault(goal.number, self._world.clock.now_s)

    def ordered(self, twist: Twist) -> str:
        """What is wrong with this command of the action server; empty: nothing."""
        if twist.is_zero:
            return ""
        goal = self._world.action.goals[-1] if self._world.action.goals else None
        if goal is None or goal.ends or goal.died:
            return f"{twist} is ordered, and no goal runs"
        since_s = self._world.clock.now_s - self._taken.get(goal.number, math.inf)
        over_s = since_s - self._ends_s(goal)
        late_s = self._world.topics.delay_s.get("velocity_mux/state", 0.0)
        if is_late("over", self._ledger, over_s, [("late states", late_s)]):
            return f"{twist} is ordered for goal {goal.number}, {since_s:.2f} s after it lost the base"
        return ""

    def _ends_s(self, goal: Goal) -> float:
        """A state arrives with the next publication, or is missed; then the goal brakes to standstill."""
        limits = self._world.robot.limits
        brakes_s = goal.speed_mps / limits.deceleration_mps2 + limits.deceleration_mps2 / limits.jerk_mps3
        return STATE_PERIOD_S + STATE_LOST_S + self._lag_s + brakes_s + goal.held_up_s

    def step(self, locked: bool) -> None:
        """Now. `locked`: a lock of the mux holds that it can know of."""
        if locked:
            self._take()
        for goal in self._world.action.goals[len(self._from) :]:
            self._from[goal.number] = true_place(self._world)
        if not self._shown.tells_truth:
            self._from = dict.fromkeys(self._from, NOWHERE)
            if self._runs():
                self._ledger.excuse("goal", "encoder lies")

    def _runs(self) -> bool:
        return any(not goal.ends and not goal.died for goal in self._world.action.goals)

    def ended(self, goal: Goal) -> str:
        """What is wrong with this end; empty: nothing."""
        if len(goal.ends) > 1:
            return f"goal {goal.number} ended {len(goal.ends)} times"
        took_s = goal.ended_at - goal.began
        if took_s > self._longest_s(goal) + goal.held_up_s + 1.0:
            return f"goal {goal.number} took {took_s:.1f} s"
        return self._beside(goal) if goal.ends[-1].code.name == "OK" else ""

    @property
    def longest_s(self) -> float:
        """No goal so far may take longer, from its begin [s]."""
        goals = self._world.action.goals
        return max((self._longest_s(goal) + goal.held_up_s + 1.0 for goal in goals), default=0.0)

    def left(self) -> str:
        """The scenario is over: no goal may be left."""
        left = [goal.number for goal in self._world.action.goals if not goal.ends and not goal.died]
        return f"goal {left[0]} never ended" if left else ""

    def _longest_s(self, goal: Goal) -> float:
        robot = self._world.robot
        ramps_s = goal.speed_mps * (1.0 / robot.limits.acceleration_mps2 + 1.0 / robot.limits.deceleration_mps2) + 0.5
        ideal_s = abs(goal.distance_m) / goal.speed_mps + ramps_s
        return (
            robot.action.overall_factor * ideal_s
            + robot.action.overall_extra_s
            + stated_s("wheels_turn_after_zero", robot)
        )

    def _beside(self, goal: Goal) -> str:
        """By its own report, and by the ground truth."""
        robot = self._world.robot
        off_m, slack_m = abs(goal.ends[-1].traveled_m - goal.distance_m), TOLERANCES * robot.action.tolerance_m
        start = self._from.get(goal.number, NOWHERE)
        if start is not NOWHERE:
            true_m = true_place(self._world).seen_from(start)[0]
            slips_m = FLOOR_M + SHARE * abs(goal.distance_m) + STEP_S * max_wheel_mps(robot)
            off_m = max(off_m, abs(true_m - goal.distance_m) - slips_m)
        return f"goal {goal.number} succeeded {off_m:.3f} m beside its distance" if off_m > slack_m else ""


NOWHERE = Place(math.nan, math.nan, math.nan)
