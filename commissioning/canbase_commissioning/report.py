"""The report of a commissioning as Markdown: what was measured, what was proven, what changed. For the robot's file."""

from __future__ import annotations

from dataclasses import dataclass, field

from canbase_commissioning.edits import Edit
from canbase_commissioning.floor import FloorFound
from canbase_commissioning.self_stop_test import HEARTBEAT, SILENCE, Outcome
from canbase_commissioning.wheel_direction import WheelFound
from canbase_config.commissioned import Step
from canbase_config.robot import Robot
from canbase_driver.boot.sequence import BootReport


@dataclass(slots=True)
class Results:
    """What has been done so far; None and empty: not done."""

    boots: dict[int, BootReport] = field(default_factory=dict)
    wheels: list[WheelFound] = field(default_factory=list)
    outcomes: tuple[Outcome, ...] = ()
    floor: FloorFound | None = None
    edits: list[Edit] = field(default_factory=list)
    done: set[Step] = field(default_factory=set)
    """Steps that have ended, with the values of robot.yaml after `edits`."""
    ended_by: str = ""
    """Why it did not come to its end; empty: it did."""
    dry_run: bool = False

    @property
    def proven(self) -> bool:
        """Whether every drive stopped by itself in every trial."""
        return bool(self.outcomes) and all(outcome.stopped for outcome in self.outcomes)


def verdict(results: Results) -> str:
    """The proof in one sentence."""
    if not results.outcomes:
        return "The self-stop was NOT PROVEN: the trials were not made."
    failed = sorted({outcome.joint for outcome in results.outcomes if not outcome.stopped})
    if failed:
        return (
            f"NOT PROVEN: {', '.join(failed)} did not stop by itself. When this computer dies, it keeps its last "
            "speed: only STO by a safety relay stops it then. The driver gives no power to these drives while "
            "safety.require_self_stop in robot.yaml is true."
        )
    slowest = max(outcome.time_s for outcome in results.outcomes)
    late = sorted({outcome.joint for outcome in results.outcomes if outcome.is_late})
    told = f" Later than its heartbeat and ramp explain: {', '.join(late)}." if late else ""
    return f"PROVEN: every drive stopped by itself, the slowest was at standstill after {slowest:.2f} s.{told}"


def markdown(robot: Robot, results: Results, when: str, version: str) -> str:
    """The whole report. `when`: date and time for people."""
    title = f"# Commissioning of {robot.name}{' (dry run: robot.yaml was not changed)' if results.dry_run else ''}"
    lines = [title, "", f"{when}, canbase {version}.", "", f"**{verdict(results)}**", ""]
    if results.ended_by:
        lines += [f"It did not come to its end: {results.ended_by}", ""]
    lines += _drives(robot, results) + _wheels(results) + _trials(results) + _floor(results) + _edits(results)
    lines += ["canbase is not a certified safety function: people are protected by STO through a safety relay.", ""]
    return "\n".join(lines)


def _drives(robot: Robot, results: Results) -> list[str]:
    if not results.boots:
        return []
    lines = ["## Drives", "", "| node | wheels | profile | vendor:product:revision:serial | stops by itself by |"]
    lines.append("|---|---|---|---|---|")
    for node_id, boot in sorted(results.boots.items()):
        drives = [drive for drive in robot.drives if drive.node_id == node_id]
        identity = boot.identity
        numbers = (identity.vendor_id, identity.product_code, identity.revision, identity.serial)
        told = ":".join("–" if n is None else f"{n:X}" for n in numbers)
        wheels = ", ".join(drive.joint for drive in drives)
        stop = boot.self_stop.text or "nothing known"
        lines.append(f"| {node_id} | {wheels} | {drives[0].profile} | {told} | {stop} |")
    notes = [f"- node {node_id}: {note}" for node_id, boot in sorted(results.boots.items()) for note in boot.notes]
    return [*lines, "", *notes, *([""] if notes else [])]


def _wheels(results: Results) -> list[str]:
    if not results.wheels:
        return []
    head = "| wheel | direction | encoder [rev] | 606Ch [rev] | seen [rev] | found |"
    lines = ["## Wheels", "", head, "|---|---|---|---|---|---|"]
    for wheel in results.wheels:
        counts = ["–", "–", "–"]
        if wheel.turned is not None:
            counts = [f"{n:.2f}" for n in (wheel.turned.by_position, wheel.turned.by_velocity, wheel.turned.seen)]
        why = (wheel.scale.why or "as in robot.yaml") if wheel.scale else "not measured"
        lines.append(f"| {wheel.joint} | {wheel.direction:+d} | {' | '.join(counts)} | {why} |")
    return [*lines, ""]


def _trials(results: Results) -> list[str]:
    if not results.outcomes:
        return []
    lines = [
        "## Self-stop test",
        "",
        "| trial | wheel | from [m/s] | standstill after [s] | limit [s] | distance [mm] | drive reported |",
    ]
    lines.append("|---|---|---|---|---|---|---|")
    for trial in (SILENCE, HEARTBEAT):
        for o in (outcome for outcome in results.outcomes if outcome.trial == trial):
            stood = f"{o.time_s:.2f}" if o.stopped else "**did not stop**"
            way = f"{abs(o.way_m) * 1000:.0f}"
            said = o.sign.removeprefix("reported ")
            lines.append(
                f"| {trial} | {o.joint} | {o.speed_mps:g} | {stood} | {o.limit_s:.2f} | {way} | {said or '–'} |"
            )
    return [*lines, ""]


def _floor(results: Results) -> list[str]:
    found = results.floor
    if found is None:
        return []
    return [
        "## Measured drive",
        "",
        f"- straight: odometry {found.odometry_m:.3f} m, measured {found.measured_m:.3f} m",
        f"- turn: odometry {found.odometry_deg:.1f}°, measured {found.measured_deg:.1f}°",
        f"- wheel radius {found.wheel_radius_m:.5g} m, track {found.track_m:.5g} m",
        "",
    ]


def _edits(results: Results) -> list[str]:
    changes = [f"- `{edit}`" for edit in results.edits] or ["- nothing: it was right"]
    return ["## Changes to robot.yaml", "", *changes, ""]
