"""`canbase doctor`: looks at a running robot and says what is wrong with it. Orders nothing, changes nothing."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.console import Console

from canbase_cli.checks import Check, exit_code, first_failure, table
from canbase_cli.options import ConfigOption, NamespaceOption, load_config, ros_arguments, ros_needed
from canbase_cli.symptoms import SYMPTOMS

EPILOG = "  \n".join(["Symptoms:", *(f"{key}: {seen}" for key, seen in SYMPTOMS.items())])


def _known(key: str | None) -> str | None:
    if key is not None and key not in SYMPTOMS:
        raise typer.BadParameter(f"there is no symptom {key!r}, expected one of {', '.join(SYMPTOMS)}")
    return key


SymptomOption = Annotated[
    str | None,
    typer.Option(
        "--symptom", metavar="SYMPTOM", callback=_known, help="What you see; say why.", show_default="all parts"
    ),
]
SecondsOption = Annotated[
    float, typer.Option("--seconds", metavar="SECONDS", min=0.5, max=60.0, help="to listen for, once found")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the rows as one line of JSON.")]


def doctor(
    ctx: typer.Context,
    config: ConfigOption = None,
    symptom: SymptomOption = None,
    seconds: SecondsOption = 3.0,
    as_json: JsonOption = False,
    namespace: NamespaceOption = "",
) -> None:
    """Look at a running robot: what is there, what is wrong, what to do next.

    It only listens, and asks questions that change nothing: nothing moves by it, at any time. With --symptom it walks
    through what can be the reason, up to the first check that fails.

    Exit codes: 0 nothing failed, 1 something did, 2 wrong command line or robot.yaml.
    """
    loaded = load_config(config)
    with ros_needed():
        from canbase_cli.observe import observe
        from canbase_cli.robot_checks import robot_checks
        from canbase_cli.symptom_walk import walk
    seen = observe(loaded, ros_arguments(ctx, namespace), seconds)
    checks = robot_checks(seen) if symptom is None else walk(symptom, seen)
    if as_json:
        typer.echo(json.dumps([_row(check) for check in checks]))
    else:
        _show(f"{_title(symptom)}, {loaded.robot.name} at {seen.namespace}", checks)
    raise typer.Exit(exit_code(checks))


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
