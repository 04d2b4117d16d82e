"""For each symptom what to look at, what explains most first: the first check that fails is the one to mend."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from canbase_doctor import action_checks as action
from canbase_doctor import motion_checks as motion
from canbase_doctor.check import Check, Verdict
from canbase_doctor.evidence import Evidence

CHECKS: Final[dict[str, tuple[Callable[[Evidence], Check], ...]]] = {
    "not-listed": (action.server_process, action.server_name, action.domain),
    "rejected": (action.goal_range, action.goal_finite, action.busy_or_unsafe),
    "no-feedback": (action.goal_executes, action.feedback_rate, action.client_listens),
    "slow-cancel": (action.nothing_blocks, action.cancel_is_heard, action.control_cycle, action.stop_procedure),
    "no-result": (action.server_answers, action.results_are_kept, action.goals_are_driven),
    "moves-after-cancel": (motion.zeros_are_ordered, motion.mux_owner, motion.driver_watchdog),
    "only-in-simulation": (motion.odometry, motion.transform, motion.sensors, motion.command_interface),
    "goals-collide": (action.one_server, action.goal_policy, action.one_publisher),
}
"""By the keys of symptoms.py."""


def walk(symptom: str, seen: Evidence) -> list[Check]:
    """The rows up to the first that fails: those behind it mean nothing until it is mended."""
    rows: list[Check] = []
    for check in CHECKS[symptom]:
        rows.append(check(seen))
        if rows[-1].verdict is Verdict.FAIL:
            break
    return rows
