"""`canbase prove qualify`: failures of the user's own robot.yaml in virtual time, many of them, before it drives."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NoReturn

import typer

from canbase_cli.options import ConfigOption, RobotFile, one_of
from canbase_cli.qualify_report import write, write_and_exit
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, load_config, with_cursor

if TYPE_CHECKING:
    from canbase_config.load import Loaded
    from canbase_qualification.folder import About
    from canbase_qualification.job import Amount, Job, Load
    from canbase_qualification.outcome import Outcome
    from canbase_qualification.results_file import ResultsFile

BROKEN_OFF: Final = 128 + signal.SIGINT
"""Exit code after Ctrl-C, as of a shell."""
EPILOG: Final = (
    "Examples:  \ncanbase prove qualify robot.yaml  \n"
    "canbase prove qualify robot.yaml --scenarios 10000 --payload 1..3 --slope 0.05  \n"
    "canbase prove qualify robot.yaml --resume  \ncanbase prove qualify robot.yaml --scenario 637  \n"
    "canbase prove qualify robot.yaml --report"
)
LEAST, MOST = 0.1, 20.0
"""Of a payload."""


def payload_range(text: str) -> tuple[float, float]:
    """`0.5..2` or `1.5`. Raises typer.BadParameter."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(?:\.\.(\d+(?:\.\d+)?))?", text)
    low, high = (float(match[1]), float(match[2] or match[1])) if match else (0.0, 0.0)
    if not LEAST <= low <= high <= MOST:
        raise typer.BadParameter(f"{text!r} is no range of payloads: FROM..TO, each from {LEAST:g} to {MOST:g}")
    return low, high


def _number(default: int, what: str) -> Any:
    return typer.Option(min=0, metavar="N", help=what, show_default=str(default))


def qualify(
    file: RobotFile = None,
    config: ConfigOption = None,
    scenarios: Annotated[int | None, _number(1000, "Runs with several overlapping failures.")] = None,
    stops: Annotated[int | None, _number(20, "How often each single failure stops the base.")] = None,
    drives: Annotated[int | None, _number(20, "Drives of a minute without any failure.")] = None,
    seed: Annotated[int | None, _number(0, "Seed of the first run.")] = None,
    payload: Annotated[
        str | None,
        typer.Option(metavar="FROM..TO", help="Mass with load, by that of the empty robot.", show_default="0.5..2"),
    ] = None,
    slope: Annotated[
        float | None, typer.Option(min=0.0, max=0.3, help="Steepest floor: 0.06 is 6 %.", show_default="0.03")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, metavar="N", help="Processes.", show_default="all processors")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="For the results.", show_default="qualification_NAME"),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the results in the folder.")] = False,
    report: Annotated[
        bool, typer.Option("--report", help="Run nothing: make the report of the results in the folder again.")
    ] = False,
    scenario: Annotated[
        int | None, typer.Option(min=0, metavar="SEED", help="Print this scenario step by step, and run nothing else.")
    ] = None,
    stop: Annotated[
        int | None, typer.Option(min=0, metavar="SEED", help="Print this stop step by step, and run nothing else.")
    ] = None,
    frames: Annotated[
        bool, typer.Option("--frames", help="With --scenario or --stop: every frame on the bus too.")
    ] = False,
) -> None:
    """Try thousands of failures on your robot in virtual time: stop times, stopping distances, and what does not hold.

    Drives, limits, timeouts, rates and sources are those of robot.yaml. The real driver, watchdog, mux, filter and
    action server run on simulated drives. The body (mass, friction, force of the motors) is drawn. What is assumed and
    what cannot be judged is printed. It needs no robot and sends nothing. This is simulation, no certificate.

    At its end there is a report in the folder: report.html opens offline, report.md and report.json have the same.

    Exit codes: 0 every property held (with --report: and everything was run), 1 a violation, or it did not work out, 2
    wrong command line or robot.yaml, 130 after Ctrl-C: what is done stays, and --resume goes on.
    """
    payloads = None if payload is None else payload_range(payload)
    loaded = load_config(one_of(file, config), quiet=True)
    if scenario is not None or stop is not None:
        _print_run(loaded, _load(payloads, slope), scenario, stop, frames=frames)
    given = {"scenarios": scenarios, "stops": stops, "drives": drives, "first": seed}
    amount = {name: value for name, value in given.items() if value is not None}
    folder = out or Path(f"qualification_{loaded.robot.name}")
    if report:
        write_and_exit(folder, loaded)
    with _sigterm_as_ctrl_c():
        _Qualify(loaded, folder, amount, payloads, slope).run(workers or os.cpu_count() or 1, resume=resume)


@contextmanager
def _sigterm_as_ctrl_c() -> Iterator[None]:
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _load(payloads: tuple[float, float] | None, slope: float | None, before: Load | None = None) -> Load:
    """What was given, else as before, else the default."""
    from canbase_qualification.job import Load

    load = before or Load()
    load = load if payloads is None else replace(load, payloads=payloads)
    return load if slope is None else replace(load, slope=slope)


def _job(loaded: Loaded, load: Load) -> tuple[Job, tuple[str, ...], tuple[str, ...]]:
    """What is run, what is assumed, what is not judged."""
    from canbase_qualification.qualification import job_of
    from canbase_qualification.simulated_robot import UnfitError

    try:
        job, found = job_of(loaded.robot, load)
    except UnfitError as error:
        _unfit(loaded, error)
    return job, found.assumed, found.not_judged


def _unfit(loaded: Loaded, error: Exception) -> NoReturn:
    fail(f"{loaded.path} cannot be qualified: {error}", WRONG_INPUT)


def _print_run(loaded: Loaded, load: Load, scenario: int | None, stop: int | None, *, frames: bool) -> NoReturn:
    from canbase_qualification.run_log import log_scenario, log_stop

    job, _, _ = _job(loaded, load)
    if scenario is not None:
        held = log_scenario(job, scenario, typer.echo, frames=frames)
    else:
        held = log_stop(job, stop or 0, typer.echo, frames=frames)
    raise typer.Exit(0 if held else FAILED)


class _Qualify:
    """One call of the command that runs something."""

    def __init__(
        self,
        loaded: Loaded,
        folder: Path,
        amount: dict[str, int],
        payloads: tuple[float, float] | None,
        slope: float | None,
    ) -> None:
        from canbase_qualification.tally import Tally

        self._loaded, self._folder, self._amount = loaded, folder, amount
        self._payloads, self._slope = payloads, slope
        self._tally, self._load = Tally(), _load(payloads, slope)

    def run(self, workers: int, *, resume: bool) -> NoReturn:
        """To the end of the command."""
        from canbase_qualification.crew import CrewError
        from canbase_qualification.folder import FolderError
        from canbase_qualification.results_file import ResultsError, ResultsFile
        from canbase_qualification.worker import WorkerDiedError, WorkError

        again = f"canbase prove qualify {self._loaded.path} --output {self._folder} --resume goes on"
        try:
            job, about = self._prepared(resume=resume)
            with ResultsFile(self._folder) as results:
                self._carry_out(job, about, results, workers)
        except (FolderError, ResultsError) as error:
            fail(str(error), WRONG_INPUT)
        except (CrewError, WorkError, WorkerDiedError, OSError) as error:
            fail(f"{error}. What was done is kept: {again}", FAILED)
        except KeyboardInterrupt:
            self._end()
            typer.echo(f"canbase: broken off, nothing of it is lost: {again}", err=True)
            raise typer.Exit(BROKEN_OFF) from None
        self._end()
        write(self._folder, self._loaded)
        raise typer.Exit(FAILED if self._tally.violations else 0)

    def _prepared(self, *, resume: bool) -> tuple[Job, About]:
        """The folder is ready: it says what is run."""
        from canbase_config.fingerprint import configuration_sha256
        from canbase_qualification import folder
        from canbase_qualification.job import Amount
        from canbase_qualification.software import software

        before = folder.read_about(self._folder) if resume else None
        if before is None:
            folder.check_new(self._folder)
        self._load = load = _load(self._payloads, self._slope, before.load if before else None)
        job, assumed, not_judged = _job(self._loaded, load)
        amount: Amount = replace(before.amount if before else Amount(), **self._amount)
        speed_mps, slower = self._trial(job, amount.first)
        about = folder.About(
            self._loaded.robot.name, str(self._loaded.path), configuration_sha256(self._loaded.robot), software(), load,
            amount, round(speed_mps, 3), (*assumed, *slower), not_judged,
        )  # fmt: skip
        if before is not None:
            folder.check_same(self._folder, before, about)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            folder.write(self._folder, about, self._loaded.path.read_bytes())
        except OSError as error:
            fail(f"--output {self._folder} cannot be written: {error.strerror}", WRONG_INPUT)
        return job, about

    def _trial(self, job: Job, body: int) -> tuple[float, tuple[str, ...]]:
        """Its speed at full deflection, and why it is not that of the limits."""
        from canbase_qualification.crew import trial
        from canbase_qualification.qualification import check_trial
        from canbase_qualification.simulated_robot import UnfitError
        from canbase_qualification.worker import WorkError

        try:
            speed_mps, why = trial(job, body)
            return speed_mps, check_trial(job, speed_mps, why)
        except UnfitError as error:
            _unfit(self._loaded, error)
        except WorkError as error:
            _unfit(self._loaded, RuntimeError(f"in simulation its drives get no power: {str(error).splitlines()[-1]}"))

    def _carry_out(self, job: Job, about: About, results: ResultsFile, workers: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        from canbase_qualification.crew import LocalCrew
        from canbase_qualification.qualification import carry_out, missing

        self._tally.add(results.before)
        todo = missing(job, about.amount, results.done)
        _say_before(about)
        columns = (BarColumn(), MofNCompleteColumn(), TextColumn("runs"), TimeRemainingColumn())
        with (
            LocalCrew(workers) as crew,
            Progress(
                *columns, TextColumn("{task.fields[found]}"), console=Console(file=with_cursor(sys.stderr))
            ) as bar,
        ):
            done = len(results.done)
            task = bar.add_task("", total=done + sum(len(batch.seeds) for batch in todo), completed=done, found="")

            def on_outcomes(outcomes: Iterable[Outcome]) -> None:
                self._tally.add(outcomes)
                bar.update(task, advance=len(tuple(outcomes)), found=self._tally.found)

            carry_out(job, todo, crew, results, on_outcomes)

    def _end(self) -> None:
        from canbase_qualification.tally import lines

        for line in lines(self._tally, str(self._loaded.path), self._load):
            typer.echo(line)
        typer.echo(f"Results: {self._folder}")


def _say_before(about: About) -> None:
    low, high = about.load.payloads
    typer.echo(f"{about.file}: payload {low:g} to {high:g} times the empty robot, floor up to {about.load.slope:.1%}")
    for title, sentences in (("Assumed:", about.assumed), ("Not judged:", about.not_judged)):
        typer.echo(title)
        for sentence in sentences:
            typer.echo(f"  {sentence}")
