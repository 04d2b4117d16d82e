"""`canbase prove evidence`: what is known about the stops of a robot, in one folder that shows later changes."""

from __future__ import annotations

import os
import time
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from canbase_cli.options import ConfigOption, RobotFile, one_of
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, load_config

if TYPE_CHECKING:
    from canbase_evidence.evidence import Evidence
    from canbase_evidence.gather import Sources

INCOMPLETE: Final = 3
"""Exit code: the folder is written, and something is missing, has failed or does not belong to this robot."""
EPILOG: Final = (
    "Examples:  \ncanbase prove evidence robot.yaml --qualification qualification/ --tests tests.xml "
    "--recordings ~/stops  \n"
    "canbase prove evidence --check evidence-robot-20261124-201500"
)


def evidence(
    file: RobotFile = None,
    config: ConfigOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="New folder to write.",
            show_default="evidence-ROBOT-DATE-TIME here",
        ),
    ] = None,
    qualification: Annotated[
        Path | None, typer.Option("--qualification", metavar="FOLDER", help="Results of canbase prove qualify.")
    ] = None,
    tests: Annotated[
        list[Path] | None,
        typer.Option("--tests", metavar="FILE", help="JUnit XML of canbase's tests (pytest --junitxml); repeatable."),
    ] = None,
    recordings: Annotated[
        list[Path] | None,
        typer.Option("--recordings", metavar="PATH", help="Folder of black boxes, or one .asc file; repeatable."),
    ] = None,
    commissioning: Annotated[
        list[Path] | None,
        typer.Option(
            "--commissioning",
            metavar="FILE",
            help="Report of canbase setup commission; repeatable.",
            show_default="those beside robot.yaml",
        ),
    ] = None,
    scan: Annotated[
        Path | None,
        typer.Option(
            "--scan", metavar="FILE", help="Output of canbase bus scan --json: the drives that are wired now."
        ),
    ] = None,
    check: Annotated[
        Path | None, typer.Option("--check", metavar="FOLDER", help="Find files that were changed, added or removed.")
    ] = None,
) -> None:
    """Gather the evidence for the stops of a robot in one folder, with a page that opens offline and SHA-256 hashes.

    Hazards with their tests, qualification in simulation, commissioning, drives, recorded stops, software. What is
    missing, failed, or belongs to another configuration, robot or version is named first, and never counted. It is no
    certificate. It reads files only: no bus, no robot. The same input gives the same bytes; SOURCE_DATE_EPOCH sets the
    time that the page states.

    Exit codes: 0 written, and nothing is missing (--check: unchanged), 1 not written (--check: changed), 2 wrong
    command line or robot.yaml, 3 written, and something is missing, has failed or does not count.
    """
    if check is not None:
        if file or config:
            fail("--check takes no robot.yaml: it compares a folder with its own list", WRONG_INPUT)
        _check(check)
        return
    from canbase_evidence.gather import Sources

    sources = Sources(qualification, tests or (), recordings or (), commissioning or (), scan)
    _gather(one_of(file, config), sources, out)


def _gather(config: Path | None, sources: Sources, out: Path | None) -> None:
    from dataclasses import replace

    from canbase_evidence.gather import gather, reports_beside
    from canbase_evidence.new_folder import GatherError
    from canbase_evidence.software import software

    loaded = load_config(config, quiet=True)
    made_s = _made_s()
    stamp = datetime.fromtimestamp(made_s, timezone.utc)
    out = out or Path(f"evidence-{loaded.robot.name}-{stamp:%Y%m%d-%H%M%S}")
    if out.is_symlink() or (out.exists() and not (out.is_dir() and not any(out.iterdir()))):
        fail(f"{out} exists; evidence is never overwritten: name another --output", WRONG_INPUT)
    if not sources.commissioning:
        sources = replace(sources, commissioning=reports_beside(loaded))
    try:
        found = gather(loaded, sources, software(), f"{stamp:%Y-%m-%dT%H:%M:%SZ}", out)
    except GatherError as error:
        fail(str(error), WRONG_INPUT)
    except OSError as error:
        fail(f"{out} cannot be written: {error.strerror or error}", FAILED)
    _tell(found, out)


def _tell(found: Evidence, out: Path) -> None:
    from canbase_evidence.hash_list import list_sha256

    for each in found.open:
        typer.echo(f"{each.standing.value}: {each.part.value}: {each.sentence}")
        if each.cure:
            typer.echo(f"    to add it: {each.cure}")
    typer.echo(f"written: {out / 'index.html'}. It is no certificate.")
    typer.echo(f"SHA-256 of the list of hashes, to be kept elsewhere: {list_sha256(out)}")
    if not found.is_complete:
        raise typer.Exit(INCOMPLETE)


def _check(folder: Path) -> None:
    from canbase_evidence.hash_list import NAME, HashListError, check, list_sha256

    try:
        differences, digest = check(folder), list_sha256(folder)
    except HashListError as error:
        fail(f"{folder / NAME}: {error}", FAILED)
    except OSError as error:
        fail(f"{error.filename or folder}: {error.strerror or error}", FAILED)
    for each in differences:
        typer.echo(f"{each.what}: {each.name!r}")
    if differences:
        count = f"{len(differences)} difference{'s' * (len(differences) > 1)}"
        fail(f"{folder} is not as it was written: {count}", FAILED)
    typer.echo(f"unchanged since its list of hashes was written. SHA-256 of the list: {digest}")


def _made_s() -> float:
    """Now, or the time of reproducible-builds.org's SOURCE_DATE_EPOCH [s since 1970]."""
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    if not given:
        return time.time()
    if not given.isascii() or not given.isdigit() or int(given) > 253402300799:
        fail(f"SOURCE_DATE_EPOCH={given[:40]!r}: expected seconds since 1970, as a whole number", WRONG_INPUT)
    return float(given)
