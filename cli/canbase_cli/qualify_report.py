"""The end of `canbase prove qualify`, and its `--report`: writes the report of a folder of results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import typer

from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail

if TYPE_CHECKING:
    from canbase_config.load import Loaded
    from canbase_qualification.report import Report


def write(folder: Path, loaded: Loaded) -> Report:
    """Write it beside the results, and print the verdict and the names of the files."""
    from canbase_qualification.folder import FolderError
    from canbase_qualification.report_files import PAGE, write_report
    from canbase_qualification.results_file import ResultsError

    try:
        report, paths = write_report(folder, loaded)
    except (FolderError, ResultsError) as error:
        fail(str(error), WRONG_INPUT)
    except OSError as error:
        fail(f"the report in {folder} cannot be written: {error.strerror or error}", FAILED)
    typer.echo(report.verdict)
    if folder / PAGE not in paths:
        typer.echo("canbase: without the Python package plotly there is no page: pip install 'plotly>=6,<8'", err=True)
    for path in paths:
        typer.echo(f"Report: {path}")
    return report


def write_and_exit(folder: Path, loaded: Loaded) -> NoReturn:
    """Exit code 0: passed; 1: a violation, or not everything was run."""
    from canbase_qualification.verdict import Grade

    raise typer.Exit(0 if write(folder, loaded).grade is Grade.PASSED else FAILED)
