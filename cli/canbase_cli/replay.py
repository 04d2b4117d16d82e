"""`canbase record replay`: a recorded stop once more, through the real watchdog, and with another robot.yaml."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from canbase_runtime.terminal import FAILED, fail, load_config

if TYPE_CHECKING:
    from canbase_config.robot import Robot
    from canbase_recording.replay_text import Begun
    from canbase_recording.stop_file import StopFile
    from canbase_recording.trip_inputs import TripInputs
    from canbase_recording.velocity_inputs import VelocityInputs

EPILOG: Final = (
    "Examples:  \ncanbase record replay stop_robot_20261124T201500.000Z_watchdog_tripped.asc  \n"
    "canbase record replay stop.asc --config shorter_lease.yaml"
)


def replay(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="The .asc of a black box (its .json lies beside it), a watchdog_….jsonl or a velocity_….jsonl.",
        ),
    ],
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", metavar="FILE", help="Another robot.yaml: what would have been different."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Feed a recorded stop to the real watchdog: would it have tripped, when, and why, beside what was recorded.

    Also mux and safety filter (each decision). With --config, what another configuration would have changed. Nothing is
    sent and no robot is needed. What a recording does not contain is not replayed, and reported.

    Exit codes: 0 the replay does what was recorded, 1 it differs, nothing can be replayed or the files cannot be read,
    2 wrong command line or robot.yaml.
    """
    from canbase_recording.input_lines import NoInputsError

    other = None if config is None else load_config(config, quiet=True).robot
    try:
        values, lines, agrees = _replayed(recording, other)
    except NoInputsError as error:
        fail(str(error), FAILED)
    typer.echo(json.dumps(values, indent=1) if as_json else "\n".join(lines))
    if not agrees:
        raise typer.Exit(FAILED)


Replay = tuple[dict[str, Any], list[str], bool]
"""What one replay found: values for --json, lines for people, and whether it does what was recorded."""


def _replayed(path: Path, other: Robot | None) -> Replay:
    if path.suffix != ".jsonl":
        return _stop(path, other)
    from canbase_recording.replay_file import part_of

    return _velocity(path, other) if part_of(path) == "velocity" else _trip(path, other)


def _velocity(path: Path, other: Robot | None) -> Replay:
    """The inputs of mux and filter alone."""
    from canbase_recording.replay_file import read_velocity

    inputs = read_velocity(path)
    return _mux_and_filter(inputs, path.name, inputs, other)


def _mux_and_filter(inputs: VelocityInputs, name: str, zero: Begun, other: Robot | None) -> Replay:
    from canbase_recording import replay_velocity_text as words
    from canbase_recording.replay_velocity import replay_velocity

    found = replay_velocity(inputs)
    values: dict[str, Any] = {"velocity": words.velocity_values(zero, name, found)}
    lines = list(words.velocity_lines(zero, name, found))
    if other is not None:
        changed = replay_velocity(inputs, other)
        values["velocity"]["other_robot_yaml"] = words.velocity_values(zero, name, changed)
        lines += words.changed_lines(zero, changed)
    return values, lines, found.agrees


def _trip(path: Path, other: Robot | None) -> Replay:
    """The inputs of a watchdog's trip alone."""
    from canbase_recording import replay_text as words
    from canbase_recording.replay_compare import compare_alone
    from canbase_recording.replay_file import read_trip
    from canbase_recording.replay_trip import replay_trip

    inputs = read_trip(path)
    values, lines, agrees = _watchdog(inputs, path.name, inputs)
    if other is not None:
        comparison = compare_alone(inputs.head.config, other, lambda config: replay_trip(inputs, config))
        values["other_robot_yaml"] = words.comparison_values(inputs, comparison)
        lines += words.comparison_lines(inputs, comparison)
    return values, lines, agrees


def _stop(path: Path, other: Robot | None) -> Replay:
    """The files of watchdog, mux and filter beside those of the driver."""
    from canbase_recording import replay_text as words
    from canbase_recording.replay_file import trip_beside, velocity_beside
    from canbase_recording.stop_file import read_stop

    stop = read_stop(path)
    trip, velocity = trip_beside(path, stop), velocity_beside(path, stop)
    parts = (
        _not_replayed(words.NO_WATCHDOG) if trip is None else _watchdog(trip[1], trip[0], stop),
        _not_replayed(words.NO_VELOCITY) if velocity is None else _beside(velocity[1], velocity[0], stop, other),
    )
    values: dict[str, Any] = {
        "stop": {"by": stop.stopped_by, "cause": stop.cause, "at_s": stop.at_s - stop.began_s},
        "versions": dict(stop.versions),
        "not_replayed": [why for part, _, _ in parts for why in part.pop("not_replayed", ())],
    }
    lines = [f"stop by {stop.stopped_by}: {stop.cause} ({stop.detail}), at {values['stop']['at_s']:.3f} s"]
    for part, part_lines, _ in parts:
        values |= part
        lines += part_lines
    if other is not None and trip is not None:
        values["other_robot_yaml"], more = _with_other(stop, other, trip[1])
        lines += more
    return values, lines, len(values["not_replayed"]) < len(parts) and all(agrees for _, _, agrees in parts)


def _not_replayed(why: str) -> Replay:
    return {"not_replayed": [why]}, [why], True


def _watchdog(own: TripInputs, name: str, zero: Begun) -> Replay:
    """`name`: of its file."""
    from canbase_recording import replay_text as words
    from canbase_recording.replay_trip import replay_own

    found = replay_own(own, name)
    agrees = not any(life.differs for life in found.lives)
    return {"watchdog": words.watchdog_values(zero, found)}, list(words.watchdog_lines(zero, found)), agrees


def _beside(own: VelocityInputs, name: str, inputs: StopFile, other: Robot | None) -> Replay:
    """A file of another version is no reason not to replay the rest."""
    from canbase_recording.input_lines import NoInputsError

    try:
        return _mux_and_filter(own, name, inputs, other)
    except NoInputsError as error:
        return _not_replayed(f"mux and filter: cannot tell, {name}: {error}")


def _with_other(stop: StopFile, other: Robot, own: TripInputs) -> tuple[dict[str, Any], list[str]]:
    """The watchdog, by its own file."""
    from canbase_recording import replay_text as words
    from canbase_recording.replay_compare import compare
    from canbase_recording.replay_trip import replay_trip

    comparison = compare(stop, other, lambda config: replay_trip(own, config))
    return words.comparison_values(stop, comparison), list(words.comparison_lines(stop, comparison))
