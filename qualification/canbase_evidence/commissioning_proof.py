"""What `canbase setup commission` has proven for a robot, step by step, and whether robot.yaml is still the same.
Pure."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_config.commissioned import STEPS, Commissioned, Step, mark
from canbase_config.robot import Robot
from canbase_evidence.standing import Finding, Part, Standing


@dataclass(frozen=True, slots=True)
class StepProof:
    """One step of the commissioning."""

    step: Step
    shows: str
    standing: Standing


def step_proofs(robot: Robot) -> tuple[StepProof, ...]:
    """All steps. A mark of other values than those of `robot` is out of date."""
    return tuple(StepProof(step, _shows(step), _standing(robot, step)) for step in STEPS)


def findings(robot: Robot) -> tuple[Finding, ...]:
    """One sentence for each state that steps are in."""
    if robot.bus.is_virtual:
        told = f"bus.interface {robot.bus.interface} has no wire: nothing was proven on real drives."
        return (Finding(Part.COMMISSIONING, Standing.MISSING, told, "the robot.yaml of the real robot"),)
    proofs = step_proofs(robot)
    return tuple(_finding(standing, [p for p in proofs if p.standing is standing]) for standing in _ORDER if
                 any(proof.standing is standing for proof in proofs))  # fmt: skip


_ORDER = (Standing.STALE, Standing.MISSING, Standing.PRESENT)
_SENTENCES = {
    Standing.STALE: "robot.yaml has changed since these steps:",
    Standing.MISSING: "These steps were not done:",
    Standing.PRESENT: "These steps were done with the values of this robot.yaml:",
}


def _finding(standing: Standing, proofs: list[StepProof]) -> Finding:
    told = ", ".join(f"{proof.step} ({proof.shows})" for proof in proofs)
    steps = ",".join(proof.step for proof in proofs)
    cure = "" if standing.counts else f"canbase setup commission --config robot.yaml --steps {steps}"
    return Finding(Part.COMMISSIONING, standing, f"{_SENTENCES[standing]} {told}.", cure)


def _standing(robot: Robot, step: Step) -> Standing:
    known = getattr(robot.commissioned, step)
    if known is None or robot.bus.is_virtual:
        return Standing.MISSING
    return Standing.PRESENT if known == mark(robot, step) else Standing.STALE


def _shows(step: Step) -> str:
    return str(Commissioned.model_fields[step].description)
