"""`canbase doctor`: checks a robot and reports what is wrong with it. Orders nothing, changes nothing."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from canbase_cli.options import ConfigOption, NamespaceOption, ros_arguments, ros_needed
from canbase_doctor.check import Check, commissioning, exit_code, first_failure, good_file, table
from canbase_doctor.symptoms import SYMPTOMS
from canbase_runtime.terminal import load_config

if TYPE_CHECKING:
    from canbase_config.load import Loaded

EPILOG = "  \n".join(["Symptoms:", *(f"{key}: {seen}" for key, seen in SYMPTOMS.items())])


def _known(key: str | None) -> str | None:
    if key is not None and key not in SYMPTOMS:
        raise typer.BadParameter(f"there is no symptom {key!r}, expected one of {', '.join(SYMPTOMS)}")
    return key


SymptomOption = Annotated[
    str | None,
    typer.Option(
        "--symptom", metavar="SYMPTOM", callback=_known, help="The symptom to explain.", show_default="all parts"
    ),
]
SecondsOption = Annotated[
    float, typer.Option("--seconds", metavar="SECONDS", min=0.5, max=60.0, help="How long to listen.")
]
BusOption = Annotated[bool, typer.Option("--bus/--no-bus", help="Also check the bus and read the drives.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the rows as one line of JSON.")]


def doctor(
    ctx: typer.Context,
    config: ConfigOption = None,
    symptom: SymptomOption = None,
    seconds: SecondsOption = 3.0,
    as_json: JsonOption = False,
    namespace: NamespaceOption = "",
    bus: BusOption = True,
    stream: Annotated[bool, typer.Option("--stream", hidden=True)] = False,
) -> None:
    """Check a robot: its bus, its drives, and canbase itself if it runs. Report what is wrong and what to do next.

    It listens and reads; it changes nothing and moves nothing. It reads the drives by SDO and compares them with
    robot.yaml; while a driver runs, it reads only when that driver does not use SDO. With --symptom it runs the checks
    for one symptom, up to the first that fails.

    Exit codes: 0 nothing failed, 1 a check failed, 2 wrong command line or robot.yaml, 3 nothing failed, but some
    checks could not be judged because this computer is overloaded.
    """
    loaded, arguments = load_config(config), ros_arguments(ctx, namespace)
    checks = []
    for check in _walk(symptom, loaded, arguments, seconds) if symptom else _all(loaded, arguments, seconds, bus):
        checks.append(check)
        if stream:  # for the page in the browser
            print(json.dumps(_row(check)), flush=True)
    if as_json:
        typer.echo(json.dumps([_row(check) for check in checks]))
    elif not stream:
        _show(f"{_title(symptom)}, {loaded.robot.name}{f' at {namespace}' if namespace else ''}", checks)
    raise typer.Exit(exit_code(checks))


def _walk(symptom: str, loaded: Loaded, arguments: list[str], seconds: float) -> list[Check]:
    with ros_needed():
        from canbase_doctor.observe import observe
        from canbase_doctor.symptom_checks import walk
    return walk(symptom, observe(loaded, arguments, seconds))


def _all(loaded: Loaded, arguments: list[str], seconds: float, with_bus: bool) -> Iterator[Check]:
    """Without any part of canbase on the bus, its parts are not looked for: the drives are there alone."""
    from canbase_cli.running import changes, running, running_checks

    yield good_file(loaded)
    yield from commissioning(loaded)
    yield from running_checks(loaded.robot, running(loaded.robot), changes(loaded))
    if with_bus:
        from canbase_doctor.bus_checks import bus_checks
        from canbase_doctor.bus_probe import look

        seen = look(loaded.robot)
        yield from bus_checks(seen)
        if not (seen.canbase_runs or seen.problem):
            return
    yield from _parts(loaded, arguments, seconds)[1:]


def _parts(loaded: Loaded, arguments: list[str], seconds: float) -> list[Check]:
    with ros_needed():
        from canbase_doctor.default_checks import default_checks
        from canbase_doctor.observe import observe
    return default_checks(observe(loaded, arguments, seconds))


def _row(check: Check) -> dict[str, Any]:
    return asdict(check) | {"verdict": check.verdict.value.lower()}


def _title(symptom: str | None) -> str:
    return "All parts" if symptom is None else SYMPTOMS[symptom].capitalize()


def _show(title: str, checks: list[Check]) -> None:
    console = Console()
    console.print(table(title, checks))
    failed = first_failure(checks)
    if failed is not None:
        console.print(f"The first check that fails: {failed.name}", style="bold red", markup=False)
