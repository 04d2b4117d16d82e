"""`canbase setup commission`: guided first motion, and the proof that the drives stop by themselves."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from canbase_cli.completion import one_more_of
from canbase_cli.options import ConfigOption
from canbase_runtime.terminal import WRONG_INPUT, fail

EPILOG: Final = (
    "Examples:  \n"
    "canbase setup commission --config robot.yaml  \n"
    "canbase setup commission --config robot.yaml --steps proof      (again, after a change of firmware)  \n"
    "canbase setup commission --config robot.yaml --answers answers.yaml --yes --dry-run"
)
STEPS: Final = ("directions", "scale", "proof", "floor")


def _steps(text: str) -> str:
    unknown = [step for step in text.split(",") if step not in STEPS]
    if unknown:
        raise typer.BadParameter(f"there is no step {unknown[0]!r}, expected some of {','.join(STEPS)}")
    return text


def commission(
    config: ConfigOption = None,
    steps: Annotated[
        str,
        typer.Option(
            "--steps",
            metavar="STEPS",
            callback=_steps,
            help="Steps to run, separated by commas.",
            autocompletion=lambda incomplete: one_more_of(STEPS, incomplete),
        ),
    ] = ",".join(STEPS),
    speed_mps: Annotated[
        float, typer.Option("--speed", metavar="M/S", min=0.02, max=0.3, help="of the rims, after the first turn")
    ] = 0.1,
    revolutions: Annotated[
        float, typer.Option("--revolutions", metavar="N", min=0.2, max=50.0, help="of each wheel for its scale")
    ] = 3.0,
    distance_m: Annotated[
        float, typer.Option("--distance", metavar="M", min=0.1, max=20.0, help="of the measured drive")
    ] = 2.0,
    turns: Annotated[float, typer.Option("--turns", metavar="N", min=0.1, max=20.0, help="of the measured turn")] = 2.0,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report",
            metavar="FILE",
            help="File for the report.",
            show_default="commissioning-<robot>-<date>.md beside FILE",
        ),
    ] = None,
    answers: Annotated[
        Path | None, typer.Option("--answers", metavar="FILE", help="YAML with answers by key, for tests.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Answer all confirmations with yes. For tests.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the changes, do not write robot.yaml.")] = False,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Ask and be answered in lines of JSON, for another program: docs/ros_api.md."),
    ] = False,
) -> None:
    """Guided first motion: WHEELS UP. Direction, scale, self-stop test, wheel radius and track.

    It turns the wheels slowly, one after the other, and asks what you see. Then the self-stop test: at low speed this
    computer stops sending, and it measures whether and when each drive stops by itself. If all do, the robot drives on
    the floor to measure wheel radius and track. The results go into robot.yaml, whose comments stay, with the identity
    of each drive (1018h): from then on the driver refuses a different drive. It also writes a report.

    No other part of canbase may run on this bus. Enter, Ctrl-C, a signal, a closed terminal, an error: each stops the
    wheels and switches the power off. After SIGKILL only drives that passed the self-stop test stop by themselves.

    Exit codes: 0 finished and self-stop proven, 1 not proven or not finished, 2 wrong command line or files.
    """
    from canbase_commissioning.onbus.commission_command import Plan, run

    if report is not None and report.exists():
        fail(f"{report} exists; a report is never overwritten: give --report another name", WRONG_INPUT)
    plan = Plan(
        frozenset(steps.split(",")),
        speed_mps,
        revolutions,
        distance_m,
        turns,
        report,
    )
    run(config, plan, answers, yes=yes, dry_run=dry_run, as_json=as_json)
