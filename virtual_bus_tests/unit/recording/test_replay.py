"""Recorded stops of a robot in virtual time, replayed: the watchdog trips again; another robot.yaml changes that."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from typer.testing import CliRunner

from canbase_campaign.cruise import Cruise
from canbase_campaign.faults import FAULTS
from canbase_campaign.twins import JOYSTICK
from canbase_cli.main import app
from canbase_config.robot import Robot
from canbase_recording.input_lines import NoInputsError
from canbase_recording.replay_compare import Comparison, compare
from canbase_recording.replay_file import read_trip
from canbase_recording.replay_text import comparison_lines, verdict
from canbase_recording.replay_trip import Life, Replayed, Trip, replay_trip
from canbase_recording.stop_file import StopFile, read_stop
from canbase_watchdog.trip_cause import TripCause
from support.recorded_stops import record_in_a_copy

FAULT_S, AFTER_S = 1.0, 1.5


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stop at 0.3 m/s whose velocity process dies, and beside it the watchdog's own file."""
    path = tmp_path_factory.mktemp("one") / "stop.asc"
    cruise = Cruise(JOYSTICK, 0.3)
    record_in_a_copy(cruise.world, lambda: _go_wrong(cruise, "velocity_dies"), path)
    return path


@pytest.fixture(scope="module")
def inputs(recorded: Path) -> StopFile:
    return read_stop(recorded)


def _go_wrong(cruise: Cruise, name: str) -> None:
    clock = cruise.world.clock
    clock.run_until(clock.now_s + FAULT_S)
    FAULTS[name].begin(cruise.world, cruise.around, FAULTS[name].draw(Random(1)))
    clock.run_until(clock.now_s + AFTER_S)
    FAULTS[name].end(cruise.world, cruise.around, FAULTS[name].draw(Random(1)))
    clock.run_until(clock.now_s + 0.2)


def compared(recorded: Path, inputs: StopFile, other: Robot) -> Comparison:
    own = read_trip(recorded.with_name("watchdog_stop_0.jsonl"))
    return compare(inputs, other, lambda config: replay_trip(own, config))


def robot_with(inputs: StopFile, **timeouts: float) -> Robot:
    robot = inputs.robot
    return robot.model_copy(update={"timeouts": robot.timeouts.model_copy(update=timeouts)})


def test_a_shorter_timeout_trips_earlier_by_the_difference(recorded: Path, inputs: StopFile) -> None:
    lease_s = inputs.robot.timeouts.lease_s
    found = compared(recorded, inputs, robot_with(inputs, lease_s=lease_s - 0.07))
    difference = found.differences[0]
    assert difference.earlier_s == pytest.approx(0.07, abs=0.006)
    assert [change.key for change in found.of_the_watchdog] == ["timeouts.lease_s"]
    assert [change.key for change in difference.by] == ["timeouts.lease_s"]
    line = list(comparison_lines(inputs, found))[1]
    assert f"s earlier: timeouts.lease_s {lease_s} -> {lease_s - 0.07}" in line


def test_a_longer_timeout_does_not_trip_until_the_recorded_stop_and_more_is_not_known(
    recorded: Path,
    inputs: StopFile,
) -> None:
    lease_s = inputs.robot.timeouts.lease_s
    found = compared(recorded, inputs, robot_with(inputs, lease_s=lease_s + 0.1))
    assert found.differences[0].other.trip is None
    assert "the consequence of its stop" in list(comparison_lines(inputs, found))[1]


def test_a_key_that_the_watchdog_does_not_know_changes_nothing(recorded: Path, inputs: StopFile) -> None:
    found = compared(recorded, inputs, robot_with(inputs, boot_s=33.0))
    assert [change.key for change in found.changes] == ["timeouts.boot_s"]
    assert found.of_the_watchdog == ()
    assert all(difference.is_none for difference in found.differences)


def test_a_robot_with_other_drives_cannot_be_compared(recorded: Path, inputs: StopFile) -> None:
    robot = inputs.robot
    drives = tuple(drive.model_copy(update={"node_id": drive.node_id + 10}) for drive in robot.drives)
    with pytest.raises(NoInputsError, match="the drives differ: recorded node 1 axis 0"):
        compared(recorded, inputs, robot.model_copy(update={"drives": drives}))


def life(recorded: TripCause | None, replayed: TripCause | None, at_s: float = 105.0, **changes: object) -> Replayed:
    trip = None if recorded is None else Trip(105.0, recorded, 0)
    other = None if replayed is None else Trip(at_s, replayed, 0)
    return replace(Replayed(Life(100.0, 105.0, trip, False), other), **changes)  # type: ignore[arg-type]


LEASE, DRIVER = TripCause.LEASE_LOST, TripCause.DRIVER_SILENT
UNKNOWN = Life(100.0, 105.0, Trip(105.0, None, 0), False)
SHORT = Life(104.5, 105.0, Trip(105.0, LEASE, 0), False)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (life(LEASE, LEASE), "the same cause, in the same tick"),
        (life(LEASE, LEASE, 104.998), "the same cause, 2.0 ms earlier"),
        (life(None, None), "the same: no trip"),
        (life(None, LEASE), "DIFFERS: the watchdog that ran did not trip"),
        (life(LEASE, None), "DIFFERS: the replay does not trip"),
        (life(LEASE, DRIVER), "DIFFERS: another cause"),
        (life(LEASE, LEASE, 104.99), "DIFFERS: the same cause, 0.010 s earlier"),
        (life(LEASE, LEASE, life=UNKNOWN), "cannot be replayed: this canbase does not know the cause"),
        (life(LEASE, None, life=SHORT), "cannot be replayed: only 0.50 s are recorded before it"),
    ],
)
def test_what_is_said_of_a_replay(given: Replayed, said: str) -> None:
    assert verdict(given).startswith(said)


def replay(*arguments: object) -> tuple[int, str]:
    found = CliRunner().invoke(app, ["record", "replay", *map(str, arguments)])
    return found.exit_code, found.output


def test_the_command_tells_it_and_exits_with_0_where_the_replay_agrees(recorded: Path) -> None:
    code, output = replay(recorded)
    assert code == 0
    assert "the same cause" in output
    assert replay(recorded.with_suffix(".json"))[1] == output


def test_as_json_it_is_one_object(recorded: Path) -> None:
    code, output = replay(recorded, "--json")
    told = json.loads(output)
    assert code == 0
    (first, *_) = told["watchdog"]["lives"]
    assert (first["recorded"]["cause"], first["replayed"]["cause"], first["agrees"]) == (
        "LEASE_LOST",
        "LEASE_LOST",
        True,
    )
    assert math.isfinite(first["late_s"])


def test_another_robot_yaml_is_compared(recorded: Path, tmp_path: Path) -> None:
    other = json.loads(recorded.with_suffix(".json").read_text(encoding="utf-8"))["robot_yaml"]
    other["timeouts"]["lease_s"] -= 0.05
    file = tmp_path / "other.yaml"
    file.write_text(json.dumps(other), encoding="utf-8")
    code, output = replay(recorded, "--config", file)
    assert code == 0
    assert "earlier: timeouts.lease_s" in output


def test_without_the_files_of_the_parts_it_cannot_tell_what_they_decided(recorded: Path, tmp_path: Path) -> None:
    for suffix in (".asc", ".json"):
        (tmp_path / f"alone{suffix}").write_bytes(recorded.with_suffix(suffix).read_bytes())
    code, output = replay(tmp_path / "alone.asc")
    assert code == 1
    assert "watchdog: cannot tell, since no file" in output
    assert "mux and filter: cannot tell, since no file" in output
    told = json.loads(replay(tmp_path / "alone.asc", "--json")[1])
    assert ("watchdog" in told, "velocity" in told, len(told["not_replayed"])) == (False, False, 2)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "there is no such file; it is written beside the .asc"),
        ("{", "no JSON"),
        ("[]", "Input should be a dictionary"),
        ("[" * 100_000, "no JSON"),
        ('{"format": 1}', "began_s: Field required"),
        (b"\xff\xfe", "no JSON"),
    ],
)
def test_a_second_file_that_is_none_is_told_with_its_name(
    recorded: Path, tmp_path: Path, content: str | bytes | None, said: str
) -> None:
    frames = tmp_path / "stop.asc"
    frames.write_bytes(recorded.read_bytes())
    if content is not None:
        frames.with_suffix(".json").write_bytes(content if isinstance(content, bytes) else content.encode())
    code, output = replay(frames)
    assert code == 1
    assert said in " ".join(output.split())
    assert "stop.json" in output
