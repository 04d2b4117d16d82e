"""`canbase setup commission` on the bus: steps, report, robot.yaml. `commissioning` decides what is measured."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from canbase_commissioning.calibration import CalibrationError
from canbase_commissioning.edits import (
    Edit,
    commissioned_edits,
    expects_edits,
    floor_edits,
    identity_edits,
    wheel_edits,
    with_edits,
)
from canbase_commissioning.floor import FloorFound, measure_floor
from canbase_commissioning.guide import Ask, CommissionError, Script, Tell
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.onbus.moving import refuse_beside_masters, run_script
from canbase_commissioning.onbus.operator import Operator, Person, Stopped, stopping_signals
from canbase_commissioning.onbus.remote_operator import RemoteOperator
from canbase_commissioning.onbus.robot_file import write_edits
from canbase_commissioning.powered_drives import PoweredDrives, RigError
from canbase_commissioning.report import Results, markdown, verdict
from canbase_commissioning.self_stop_test import Outcome, get_ready, prove
from canbase_commissioning.wheel_direction import AGAIN, WheelFound, find_direction, measure_scale
from canbase_config.errors import ConfigError
from canbase_config.robot import Robot
from canbase_config.units import mps_per_bit
from canbase_runtime.terminal import FAILED, CommandError, fail, load_config
from canbase_runtime.version import installed_version

WHEELS_UP = (
    "WHEELS UP: all wheels off the floor, nothing near them, the emergency stop (STO) at hand and tried. "
    "Enter stops everything at any time. Confirm"
)
WHEELS_DOWN = "Put the robot on the floor, with 3 m free all around and the emergency stop within reach. Confirm"


@dataclass(frozen=True, slots=True)
class Plan:
    """What is to be done. `steps`: directions, scale, proof, floor."""

    steps: frozenset[str]
    speed_mps: float
    revolutions: float
    distance_m: float
    turns: float
    report: Path | None
    """None: beside robot.yaml, with the robot's name and the date."""


def run(given: Path | None, plan: Plan, answers: Path | None, *, yes: bool, dry_run: bool, as_json: bool) -> None:
    """All steps; exits with 1 when the self-stop is not proven, or not all was done."""
    loaded = load_config(given)
    config, robot = loaded.path, loaded.robot
    person: Person = RemoteOperator() if as_json else Operator(answers, yes=yes)
    results = Results(dry_run=dry_run)
    with open_line(robot.bus) as line, stopping_signals():
        refuse_beside_masters(line)
        try:
            _go(line, robot, plan, person, results)
            results.edits += identity_edits(robot, results.boots)
            if {"directions", "scale"} <= results.done:
                results.edits += expects_edits(robot, results.boots)
        except (CommissionError, RigError, CalibrationError, ValidationError) as error:
            results.ended_by = str(error)
        except Stopped as stopped:
            results.ended_by = str(stopped)
    results.edits += commissioned_edits(robot, results.edits, sorted(results.done))
    person.tell(Tell(_write_report(robot, plan.report, config, results)))
    _change(config, results.edits, person, dry_run=dry_run)
    person.tell(Tell(verdict(results), is_loud=not results.proven))
    if results.ended_by:
        fail(results.ended_by, FAILED)
    if "proof" in plan.steps and not results.proven:
        raise CommandError("", FAILED)


def _go(line: BusSession, robot: Robot, plan: Plan, person: Person, results: Results) -> None:
    if plan.steps & {"directions", "scale"}:
        robot = _measure_wheels(line, robot, plan, person, results)
        results.done |= {step for step in ("directions", "scale") if step in plan.steps}
    if "proof" in plan.steps:
        results.outcomes = run_script(line, robot, lambda rig: _proof(rig, plan, results), person)
        for outcome in results.outcomes:
            person.tell(Tell(str(outcome), is_loud=not outcome.stopped))
        results.done |= {"proof"} if results.proven else set()
    if "floor" not in plan.steps:
        return
    if "proof" in plan.steps and not results.proven:
        person.tell(Tell("the measured drive on the floor is left out: the self-stop is not proven", is_loud=True))
        return
    results.floor = run_script(line, robot, lambda rig: _floor(rig, plan, results), person)
    results.edits += floor_edits(robot, results.floor)
    results.done.add("floor")


def _measure_wheels(line: BusSession, robot: Robot, plan: Plan, person: Person, results: Results) -> Robot:
    """The robot with what was found. A correction is measured again before anything else relies on it.

    Raises CommissionError when the second measurement contradicts the first: then nothing is changed.
    """
    results.wheels = run_script(line, robot, lambda rig: _wheels(rig, plan, results), person)
    edits = wheel_edits(robot, results.wheels)
    if not edits:
        return robot
    corrected = with_edits(robot, edits)
    wrong = {robot.drives[int(edit.loc[1])].joint for edit in edits}
    for edit in edits:
        person.tell(Tell(f"robot.yaml is wrong: {edit}. It is measured again with the corrected value", is_loud=True))
    found = run_script(
        line, corrected, lambda rig: _wheels(rig, plan, results, wrong, _gentler(robot, rig.robot)), person
    )
    other = wheel_edits(corrected, found)
    if other:
        told = "; ".join(str(edit) for edit in other)
        raise CommissionError(
            f"the second measurement contradicts the first ({told}): measure again from the beginning"
        )
    results.edits += edits
    return corrected


def _gentler(before: Robot, after: Robot) -> dict[str, float]:
    """By joint, the share of the speed at which the motor turns no faster with the corrected scale than before it."""
    radius_m = before.base.wheel_radius_m
    pairs = zip(before.drives, after.drives, strict=True)
    return {new.joint: min(1.0, abs(mps_per_bit(new, radius_m) / mps_per_bit(old, radius_m))) for old, new in pairs}


def _wheels(
    rig: PoweredDrives,
    plan: Plan,
    results: Results,
    again: Collection[str] = (),
    shares: Mapping[str, float] | None = None,
) -> Script[list[WheelFound]]:
    """All wheels, or those of `again`, at these shares of the speed."""
    suffix = AGAIN if again else ""
    yield Ask(f"wheels_up{suffix}", WHEELS_UP, confirms=True)
    yield from get_ready(rig)
    _note_boots(rig, results)
    found = []
    for drive in rig.robot.drives:
        if again and drive.joint not in again:
            continue
        wheel = WheelFound(drive.joint, drive.direction)
        if "directions" in plan.steps:
            wheel = yield from find_direction(rig, drive, suffix)
        if "scale" in plan.steps:
            speed_mps = plan.speed_mps * (shares or {}).get(drive.joint, 1.0)
            scale, turned = yield from measure_scale(rig, drive, plan.revolutions, speed_mps, suffix)
            wheel = WheelFound(drive.joint, wheel.direction, scale, turned)
        found.append(wheel)
    return found


def _proof(rig: PoweredDrives, plan: Plan, results: Results) -> Script[tuple[Outcome, ...]]:
    yield Ask(
        "proof",
        f"Self-stop test, wheels still up: all wheels will turn at {plan.speed_mps:g} m/s. Ready?",
        confirms=True,
    )
    yield from get_ready(rig)
    _note_boots(rig, results)
    return (yield from prove(rig, plan.speed_mps))


def _floor(rig: PoweredDrives, plan: Plan, results: Results) -> Script[FloorFound]:
    yield Ask("wheels_down", WHEELS_DOWN, confirms=True)
    yield from get_ready(rig)
    _note_boots(rig, results)
    return (yield from measure_floor(rig, plan.distance_m, plan.turns, plan.speed_mps))


def _note_boots(rig: PoweredDrives, results: Results) -> None:
    results.boots = {node_id: node.report for node_id, node in rig.nodes.items() if node.report is not None}


def _write_report(robot: Robot, wanted: Path | None, config: Path, results: Results) -> str:
    """To a file of its own: a report of another day, or of another robot, is never overwritten."""
    when = time.strftime("%Y-%m-%d %H:%M %z")
    path = wanted or config.with_name(f"commissioning-{robot.name}-{time.strftime('%Y%m%d-%H%M%S')}.md")
    text = markdown(robot, results, when, installed_version())
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        print(text)
        fail(f"the report above cannot be written: {error}", FAILED)
    return f"report: {path}"


def _change(config: Path, edits: list[Edit], person: Person, *, dry_run: bool) -> None:
    """The new file takes the old one's place only when it is good; the old one stays beside it."""
    for edit in edits:
        person.tell(Tell(f"{'would change' if dry_run else 'changed'} {edit}"))
    if not edits or dry_run:
        return
    try:
        write_edits(config, edits)
    except (OSError, ConfigError, KeyError) as error:
        fail(f"{config} is left as it was; write the values above into it by hand: {error}", FAILED)
