"""The logged steps of a goal, `CANBASE_STEP` of docs/troubleshooting.md; `canbase doctor` reads them."""

from __future__ import annotations

from enum import Enum


class GoalStep(Enum):
    """What has happened to a goal. The values are the words in the log."""

    REJECTED = "rejected"
    ACCEPTED = "accepted"
    STARTED = "started"
    FEEDBACK = "feedback"
    CANCEL_REQUESTED = "cancel requested"
    STOPPING = "stopping"
    STANDSTILL = "standstill"
    ENDED = "ended"
    UNKNOWN = "unknown"
    """A word that this version does not write."""


def goal_step(word: object) -> GoalStep:
    """The step with this word; UNKNOWN for any other."""
    return _WORDS.get(word, GoalStep.UNKNOWN)


_WORDS: dict[object, GoalStep] = {step.value: step for step in GoalStep}
