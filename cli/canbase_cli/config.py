"""`canbase config`: the effective configuration of a robot.yaml, and its mistakes."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from canbase_cli.options import ConfigOption, RobotFile, one_of
from canbase_runtime.terminal import FAILED, colour, fail, load_config, warn

if TYPE_CHECKING:
    from canbase_config.robot import Bus

app = typer.Typer(
    help="robot.yaml: check it, list its keys, draft a drive profile from an EDS (from-eds).", no_args_is_help=True
)


@app.callback()
def _group() -> None:
    """Check a robot.yaml, list its keys, draft a drive profile."""


@app.command()
def check(
    file: RobotFile = None,
    config: ConfigOption = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print problems only, and no warnings.")] = False,
) -> None:
    """Check a robot.yaml, and print its whole configuration with the defaults marked.

    The output is a robot.yaml itself. Warnings go to stderr, also a warning that this computer has no such bus.

    Exit codes: 0 the file can be used, 2 it cannot; every problem is on stderr.
    """
    from canbase_config.effective import DEFAULT_MARK, effective

    loaded = load_config(one_of(file, config), quiet=quiet)
    if quiet:
        return
    for sentence in _bus_warnings(loaded.robot.bus):
        warn(sentence)
    for line in effective(loaded).splitlines():
        typer.secho(line, dim=line.endswith(f"# {DEFAULT_MARK}"), color=colour())
    counts = f"{len(loaded.given)} values from the file, {len(loaded.defaults)} defaults"
    typer.secho(f"{loaded.path} is good: {counts}", err=True, fg=typer.colors.GREEN, color=colour())


def _bus_warnings(bus: Bus) -> list[str]:
    from can import VALID_INTERFACES

    from canbase_cli.bus_here import bus_warnings, unknown_options

    return [*bus_warnings(bus, VALID_INTERFACES), *unknown_options(bus, _options_of(bus.interface) or bus.extra.keys())]


def _options_of(interface: str) -> set[str]:
    """The parameters of python-can's class for it, with those of its base classes; empty: it is not installed here."""
    from can.interfaces import BACKENDS

    try:
        module, name = BACKENDS[interface]
        kinds = getattr(importlib.import_module(module), name).__mro__
    except (KeyError, ImportError, OSError):  # a vendor's library that is missing, or does not load
        return set()
    found = {each for kind in kinds for each in inspect.signature(kind.__init__).parameters}
    return found - {"self", "args", "kwargs", "channel"}


@app.command()
def keys() -> None:
    """Print every key of robot.yaml and of drive profiles, with range, default and meaning: docs/configuration.md."""
    from canbase_config.reference import configuration_page

    typer.echo(configuration_page(), nl=False)


@app.command("from-eds")
def from_eds(file: Annotated[Path, typer.Argument(metavar="FILE", help="The EDS or DCF file of a drive.")]) -> None:
    """Draft a drive profile from an EDS file. The profile goes to stdout, notes about it to stderr.

    Exit codes: 0 a draft for `profile` in robot.yaml, 1 no CiA 402 drive, or it lacks what canbase needs, 2 FILE cannot
    be read.
    """
    from canbase_config.eds_file import EdsError, read_eds
    from canbase_config.errors import MOST_TOLD, printable
    from canbase_config.from_eds import draft, why_no_drive

    try:
        eds = read_eds(file)
    except EdsError as error:
        typer.secho(f"canbase: {error}", err=True, fg=typer.colors.RED, color=colour())
        raise typer.Exit(2) from error
    if why := why_no_drive(eds):
        fail(f"{file}: {why}. A drive needs the EDS file of its manufacturer for this very type", FAILED)
    found = draft(eds)
    typer.echo(found.text, nl=False)
    lines = [f"{file}: {len(eds.objects)} objects, read as {eds.encoding}"]
    lines += [f"  odd: {printable(note)}" for note in eds.notes[:MOST_TOLD]]
    lines += [f"  and {len(eds.notes) - MOST_TOLD} more"] if len(eds.notes) > MOST_TOLD else []
    lines += [f"  doubt: {doubt}" for doubt in found.doubts]
    lines += [f"  not in an EDS: {unknown}" for unknown in found.unknown]
    typer.secho("\n".join(lines), err=True, color=colour())
    typer.secho(found.self_stop, err=True, bold=True, color=colour())
    if found.missing:
        typer.secho(
            f"canbase cannot use this drive: it lacks {', '.join(found.missing)}", err=True, fg=typer.colors.RED
        )
        raise typer.Exit(1)
