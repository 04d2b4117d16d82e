"""Eight ways in which an action on a robot goes wrong, as people see them. What to look at then: symptom_checks.py."""

from __future__ import annotations

from typing import Final

SYMPTOMS: Final = {
    "not-listed": "the action is not in the list",
    "rejected": "a goal is rejected at once",
    "no-feedback": "no feedback comes",
    "slow-cancel": "a cancel takes long",
    "no-result": "the result never comes",
    "moves-after-cancel": "the robot moves after a cancel",
    "only-in-simulation": "it works in simulation only",
    "goals-collide": "two goals collide",
}
"""What `canbase doctor --symptom` takes, and what it means."""
