"""`canbase replay`: a recorded stop once more, through the real watchdog, and with another robot.yaml."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from canbase_runtime.terminal import FAILED, fail, load_config

if TYPE_CHECKING:
    from canbase_config.robot import Robot
    from canbase_recording.recorded_inputs import RecordedInputs
    from canbase_recording.trip_inputs import TripInputs

EPILOG: Final = (
    "Examples:  \ncanbase replay stop_robot_20261124T201500.000Z_watchdog_tripped.asc  \n"
    "canbase replay stop.asc --config shorter_lease.yaml"
)


def replay(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="The .asc of a black box (its .json lies beside it), or a watchdog_….jsonl."
        ),
    ],
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", metavar="FILE", help="Another robot.yaml: what would have been different."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Feed a recorded stop to the real watchdog: would it have tripped, when, and why, beside what was recorded.

    Also the mux (which source has the base) and the driver's limiter (setpoints). With --config, what another
    configuration would have changed. Nothing is sent and no robot is needed. What a recording does not contain is not
    replayed, and reported.

    Exit codes: 0 the replay does what was recorded, 1 it differs or the files cannot be read, 2 wrong command line or
    robot.yaml.
    """
    from canbase_recording.recorded_inputs import NoInputsError

    other = None if config is None else load_config(config, quiet=True).robot
    try:
        values, lines, agrees = _trip(recording, other) if recording.suffix == ".jsonl" else _stop(recording, other)
    except NoInputsError as error:
        fail(str(error), FAILED)
    typer.echo(json.dumps(values, indent=1) if as_json else "\n".join(lines))
    if not agrees:
        raise typer.Exit(FAILED)


Told = tuple[dict[str, Any], list[str], bool]
"""For JSON, for people, and whether the replay does what was recorded."""


def _trip(path: Path, other: Robot | None) -> Told:
    """The inputs of a watchdog's trip alone."""
    from canbase_recording import replay_text as words
    from canbase_recording.replay_compare import compare_alone
    from canbase_recording.replay_file import read_trip
    from canbase_recording.replay_trip import replay_own, replay_trip

    inputs = read_trip(path)
    found = replay_own(inputs, path.name)
    values: dict[str, Any] = {"watchdog": words.watchdog_values(inputs, found)}
    lines = list(words.watchdog_lines(inputs, found))
    if other is not None:
        comparison = compare_alone(inputs.head.config, other, lambda config: replay_trip(inputs, config))
        values["other_robot_yaml"] = words.comparison_values(inputs, comparison)
        lines += words.comparison_lines(inputs, comparison)
    return values, lines, not any(life.differs for life in found.lives)


def _stop(path: Path, other: Robot | None) -> Told:
    """Both files of the driver, and the watchdog's own one where it lies beside them."""
    from canbase_recording import replay_text as words
    from canbase_recording.replay import replay_watchdog
    from canbase_recording.replay_file import read_inputs, robot_of, trip_beside
    from canbase_recording.replay_trip import replay_own

    inputs = read_inputs(path)
    beside = trip_beside(path, inputs)
    found = replay_watchdog(inputs) if beside is None else replay_own(beside[1], beside[0])
    chain_values, chain_lines, chain_agrees = _chain(inputs, robot_of(inputs))
    stop = f"stop by {inputs.stopped_by}: {inputs.cause} ({inputs.detail}), at {inputs.at_s - inputs.began_s:.3f} s"
    values: dict[str, Any] = {
        "stop": {"by": inputs.stopped_by, "cause": inputs.cause, "at_s": inputs.at_s - inputs.began_s},
        "versions": dict(inputs.versions),
        "watchdog": words.watchdog_values(inputs, found),
        **chain_values,
        "not_replayed": words.NOT_REPLAYED,
    }
    lines = [stop, *words.watchdog_lines(inputs, found), *chain_lines, words.NOT_REPLAYED]
    if other is not None:
        values["other_robot_yaml"], more = _with_other(inputs, other, beside and beside[1])
        lines += more
    return values, lines, chain_agrees and not any(life.differs for life in found.lives)


def _chain(inputs: RecordedInputs, robot: Robot) -> tuple[dict[str, Any], list[str], bool]:
    """Mux and driver; whether they do what was recorded."""
    from canbase_recording import replay_text as words
    from canbase_recording.replay_setpoints import replay_setpoints
    from canbase_recording.replay_sources import replay_sources

    setpoints, sources = replay_setpoints(inputs, robot), replay_sources(inputs, robot)
    values = {"mux": words.source_values(inputs, sources), "driver": words.setpoint_values(inputs, setpoints)}
    lines = [*words.source_lines(inputs, sources), *words.setpoint_lines(inputs, setpoints)]
    return values, lines, not (sources.differences or setpoints.differences)


def _with_other(inputs: RecordedInputs, other: Robot, own: TripInputs | None) -> tuple[dict[str, Any], list[str]]:
    from canbase_recording import replay_text as words
    from canbase_recording.replay_compare import compare
    from canbase_recording.replay_trip import replay_trip

    comparison = compare(inputs, other, None if own is None else lambda config: replay_trip(own, config))
    chain_values, chain_lines, _ = _chain(inputs, other)
    lines = [*words.comparison_lines(inputs, comparison), *(f"  {line}" for line in chain_lines)]
    return words.comparison_values(inputs, comparison) | chain_values, lines
