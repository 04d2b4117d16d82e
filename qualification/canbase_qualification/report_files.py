"""Makes the report of a folder of results, and writes it there: report.html, report.md, report.json.

The robot is that of the command line: its SHA-256 says whether the results are about it.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

from canbase_base.own_folder import replaced
from canbase_config.effective import effective
from canbase_config.fingerprint import configuration_sha256
from canbase_config.load import Loaded
from canbase_hazards import catalogue
from canbase_qualification import results_file
from canbase_qualification.folder import About, check_robot, read_about
from canbase_qualification.hazard_figures import Collected
from canbase_qualification.outcome import DRIVING, SCENARIO, STOP, Outcome
from canbase_qualification.qualified import Setup
from canbase_qualification.report import Report, report
from canbase_qualification.report_json import as_json
from canbase_qualification.report_markdown import markdown
from canbase_qualification.report_sections import sections
from canbase_qualification.simulated_robot import simulated

PAGE, MARKDOWN, JSON = "report.html", "report.md", "report.json"
LIBRARIES: Final = ("canopen", "pydantic", "python-can")
"""Whose versions are in the report, beside those that the results were computed with."""


def write_report(folder: Path, loaded: Loaded) -> tuple[Report, list[Path]]:
    """The report, and the files that were written. Without Plotly there is no page.

    FolderError: the folder has no results, or they are of another configuration. ResultsError: a line is no outcome.
    OSError.
    """
    made = read_report(folder, loaded)
    title, told = f"canbase prove qualify: {made.setup.robot.name}", sections(made)
    texts = {
        JSON: json.dumps(as_json(made), indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        MARKDOWN: markdown(title, told),
    }
    try:
        from canbase_qualification.report_page import page

        texts[PAGE] = page(title, made, told)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "plotly":
            raise
    return made, [_written(folder / name, text) for name, text in texts.items()]


def read_report(folder: Path, loaded: Loaded) -> Report:
    """What the results in `folder` come to, for the robot that they are about."""
    about = read_about(folder)
    check_robot(folder, about, str(loaded.path), configuration_sha256(loaded.robot))
    path = folder / results_file.NAME
    collected, problems = Collected(catalogue.load()), list(_problems(path))
    for outcome in _outcomes(path):
        collected.add(outcome)
    return report(_setup(about, loaded, tuple(problems)), collected)


def _outcomes(path: Path) -> Iterator[Outcome]:
    """No file yet: nothing ran."""
    if path.exists():
        yield from results_file.read(path)


def _problems(path: Path) -> Iterator[str]:
    """What the results lack although their lines can be read."""
    if not path.exists():
        yield f"there is no {path.name}"
        return
    with path.open("rb") as file:
        file.seek(0, 2)
        if file.tell():
            file.seek(-1, 2)
            if file.read(1) != b"\n":
                yield f"{path.name} ends in the middle of a line, which is left out; --resume runs it again"


def _setup(about: About, loaded: Loaded, problems: tuple[str, ...]) -> Setup:
    amount, software = about.amount, about.software
    computed = {"canbase": f"{software.canbase}, sources {software.sources}", "Python": software.python}
    return Setup(
        robot_file=about.file,
        robot=loaded.robot,
        configuration_sha256=configuration_sha256(loaded.robot),
        configuration=effective(loaded),
        versions={**computed, "numpy": software.numpy, **_here()},
        load=about.load,
        asked={
            STOP: amount.stops * len(simulated(loaded.robot).failures),
            SCENARIO: amount.scenarios,
            DRIVING: amount.drives,
        },
        assumed=about.assumed,
        not_judged=about.not_judged,
        problems=problems,
    )


def _here() -> dict[str, str]:
    """Of this computer, which makes the report."""
    found = {name: _version(name) for name in LIBRARIES}
    return {**found, "report made with": f"Python {platform.python_version()}, {platform.machine()}"}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def _written(path: Path, text: str) -> Path:
    """A crash leaves the file as it was."""
    with replaced(path) as file:
        file.write(text.encode())
    return path
