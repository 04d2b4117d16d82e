"""The watchdog's own file of a trip: replayed call by call; one that is damaged or from elsewhere is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from random import Random
from typing import Any

import pytest
from typer.testing import CliRunner

from canbase_campaign.cruise import Cruise
from canbase_campaign.faults import FAULTS
from canbase_campaign.twins import JOYSTICK
from canbase_cli.main import app
from canbase_recording.input_lines import NoInputsError
from canbase_recording.replay_file import read_trip, trip_beside
from canbase_recording.replay_text import verdict
from canbase_recording.replay_trip import replay_trip
from canbase_recording.stop_file import read_stop
from canbase_recording.trip_inputs import TripInputs, trip_inputs
from canbase_watchdog.trip_cause import TripCause
from support.recorded_stops import record_in_a_copy

FAULT_S, AFTER_S = 1.0, 1.5
HANGS_S = 0.3
"""For longer, and the driver has stopped and disabled the drives meanwhile: then nothing is left to trip for."""
CASES = {
    "velocity_dies": TripCause.LEASE_LOST,
    "driver_hangs": TripCause.DRIVER_SILENT,
    "watchdog_hangs": TripCause.LOOP_LATE,
    "watchdog_bus_problem": TripCause.BUS_FAILED,
    "watchdog_dies": TripCause.POWER_AT_END,
    "drive_silent": TripCause.DRIVE_SILENT,
    "encoder_lost": TripCause.FEEDBACK_IMPLAUSIBLE,
    "encoder_reversed": TripCause.MOTION_OUTSIDE,
    "second_master_nmt": TripCause.FOREIGN_MASTER,
    "second_master_setpoints": TripCause.TARGET_OUTSIDE,
    "is requested to end": TripCause.ENDED,
}
"""Faults of the campaign, of a robot that drives at 0.3 m/s. Four of them no other process can know of."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of the driver, `FAULT.asc` and `.json`, and beside them `watchdog_FAULT_0.jsonl`."""
    folder = tmp_path_factory.mktemp("recordings")
    cruise = Cruise(JOYSTICK, 0.3)
    for name in CASES:
        (folder / name).mkdir()
        record_in_a_copy(cruise.world, lambda name=name: _go_wrong(cruise, name), folder / name / f"{name}.asc")  # type: ignore[misc]
    return folder


def _go_wrong(cruise: Cruise, name: str) -> None:
    clock, fault = cruise.world.clock, FAULTS.get(name)
    clock.run_until(clock.now_s + FAULT_S)
    if fault is None:
        cruise.world.watchdog.end()
    else:
        fault.begin(cruise.world, cruise.around, fault.draw(Random(1)))
    clock.run_until(clock.now_s + (HANGS_S if name == "watchdog_hangs" else AFTER_S))
    if fault is not None:
        fault.end(cruise.world, cruise.around, fault.draw(Random(1)))
    clock.run_until(clock.now_s + AFTER_S)


@pytest.mark.parametrize("name", CASES)
def test_the_same_cause_in_the_same_tick(folder: Path, name: str) -> None:
    (life, *_) = replay_trip(read_trip(folder / name / f"watchdog_{name}_0.jsonl"))
    assert life.trip is not None
    assert life.trip.cause is CASES[name]
    assert life.trip == life.life.trip
    assert verdict(life) == "the same cause, in the same tick"


def test_without_its_leases_it_trips_elsewhere(folder: Path) -> None:
    """The replay can tell."""
    inputs = read_trip(folder / "driver_hangs" / "watchdog_driver_hangs_0.jsonl")
    without = replace(inputs, calls=tuple(call for call in inputs.calls if call[0] != "lease"))
    (life,) = replay_trip(without)
    assert life.trip is not None
    assert life.trip.cause is TripCause.LEASE_LOST
    assert verdict(life) == "DIFFERS: another cause"


def test_another_configuration_trips_earlier_by_the_difference(folder: Path) -> None:
    inputs = read_trip(folder / "velocity_dies" / "watchdog_velocity_dies_0.jsonl")
    config = inputs.head.config
    (before,) = replay_trip(inputs)
    (after,) = replay_trip(inputs, replace(config, lease_timeout_s=config.lease_timeout_s - 0.1))
    assert before.trip is not None
    assert after.trip is not None
    assert before.trip.at_s - after.trip.at_s == pytest.approx(0.1, abs=0.006)


def run(*arguments: object) -> tuple[int, str]:
    found = CliRunner().invoke(app, ["record", "replay", *map(str, arguments)])
    return found.exit_code, " ".join(found.output.split())


def test_the_command_replays_it_alone(folder: Path) -> None:
    code, output = run(folder / "watchdog_hangs" / "watchdog_watchdog_hangs_0.jsonl")
    assert code == 0
    assert "of its own file watchdog_watchdog_hangs_0.jsonl" in output
    assert "replayed: 3.300 s trips: own loop late (own loop did not run for 0.3" in output


def test_the_command_compares_it_with_another_robot(folder: Path, tmp_path: Path) -> None:
    values = json.loads((folder / "velocity_dies" / "velocity_dies.json").read_text())["robot_yaml"]
    values["timeouts"]["lease_s"] -= 0.1
    other = tmp_path / "other.yaml"
    other.write_text(json.dumps(values))
    code, output = run(folder / "velocity_dies" / "watchdog_velocity_dies_0.jsonl", "--config", other)
    assert code == 0
    assert "of the watchdog: lease_timeout_s" in output
    assert "trips 0.100 s earlier" in output or "trips 0.099 s earlier" in output or "trips 0.101 s earlier" in output


def test_the_file_beside_a_stop_is_found_and_replayed(folder: Path) -> None:
    stop = folder / "watchdog_hangs" / "watchdog_hangs.asc"
    beside = trip_beside(stop, read_stop(stop))
    assert beside is not None
    assert beside[0] == "watchdog_watchdog_hangs_0.jsonl"
    code, output = run(stop)
    assert (code, "the same cause, in the same tick" in output) == (0, True)


def test_the_explanation_names_the_file_of_a_watchdog_that_hung(folder: Path) -> None:
    explained = CliRunner().invoke(app, ["explain", str(folder / "watchdog_hangs" / "watchdog_hangs.asc")])
    assert "recorded a trip of its own: own loop did not run for 0.3" in explained.output
    assert "watchdog_hangs/watchdog_watchdog_hangs_0.jsonl" in explained.output


def test_the_file_of_another_stop_is_not_taken(folder: Path) -> None:
    stop = folder / "watchdog_hangs" / "watchdog_hangs.asc"
    inputs = read_stop(stop)
    assert trip_beside(stop, replace(inputs, began_s=inputs.began_s + 500.0, at_s=inputs.at_s + 500.0)) is None
    assert trip_beside(stop, replace(inputs, wall_offset_s=inputs.wall_offset_s + 86_400.0)) is None
    assert trip_beside(stop, replace(inputs, robot_yaml={"name": "another"})) is None


HUNG_S = 16.0


@pytest.fixture
def hung(folder: Path, tmp_path: Path) -> Path:
    """The .asc of a driver that hung for 16 s: it begins with its stop, and the watchdog's trip was long before."""
    of = folder / "driver_hangs"
    trip = read_trip(of / "watchdog_driver_hangs_0.jsonl").head.trip
    for file in of.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    values = json.loads((of / "driver_hangs.json").read_text()) | {
        "began_s": trip.at_s + HUNG_S, "at_s": trip.at_s + HUNG_S + 0.01, "events": [],
        "stopped_by": "watchdog", "cause": "watchdog tripped", "detail": "watchdog: driver silent",
    }  # fmt: skip
    (tmp_path / "driver_hangs.json").write_text(json.dumps(values))
    return tmp_path / "driver_hangs.asc"


def test_the_watchdog_s_file_explains_the_stop_of_a_driver_that_hung_for_long(hung: Path) -> None:
    output = CliRunner().invoke(app, ["explain", str(hung)]).output
    assert "16.0 s before this recording begins, the watchdog tripped: driver's heartbeat is " in output
    begin = output.index("before this recording")
    assert output.index("first cause:  driver or master silent") > begin
    assert output.index("What the driver recorded then") > output.index("caught by:    watchdog, ") > begin
    assert f"canbase record replay {hung.parent}/watchdog_driver_hangs_0.jsonl" in output
    values = json.loads(CliRunner().invoke(app, ["explain", "--json", str(hung)]).output)["watchdog"]
    assert values["at_s"] == pytest.approx(-HUNG_S, abs=0.001)
    assert [stop["cause"] for stop in values["stops"]] == ["driver or master silent"]
    _, output = run(hung)
    assert "of its own file watchdog_driver_hangs_0.jsonl" in output
    assert "the same cause, in the same tick" in output


@pytest.mark.parametrize(
    "change",
    [
        {"stopped_by": "motor_driver"},
        {"detail": "watchdog: drive silent, node 1"},
        {"began_s": -5.0},
        {"wall_offset_s": 5.0},
        {"events": [{"at_s": -3.0, "what": "motor_driver/state", "state": "ENABLED"}]},
    ],
    ids=["another part", "another trip", "it ran before", "another start of the computer", "reset since"],
)
def test_a_trip_before_the_recording_is_another_stop_s_unless_all_agrees(hung: Path, change: dict[str, Any]) -> None:
    values = json.loads(hung.with_suffix(".json").read_text())
    for key, value in change.items():
        values[key] = values[key] + value if isinstance(value, float) else value
    for event in values["events"]:
        event["at_s"] += values["at_s"]
    hung.with_suffix(".json").write_text(json.dumps(values))
    assert trip_beside(hung, read_stop(hung)) is None
    assert "the watchdog tripped: driver's heartbeat" not in CliRunner().invoke(app, ["explain", str(hung)]).output


@pytest.mark.parametrize("name", ["watchdog_a_0.jsonl", "watchdog_z_0.jsonl"])
def test_a_later_trip_of_another_cause_ends_the_search(hung: Path, name: str) -> None:
    """The driver's stop was for the last trip before it, and that one is not this."""
    head, *lines = hung.with_name("watchdog_driver_hangs_0.jsonl").read_text().splitlines()
    values = json.loads(head)
    values["trip"] |= {"at_s": values["trip"]["at_s"] + 5.0, "cause": int(TripCause.LEASE_LOST)}
    hung.with_name(name).write_text("\n".join((json.dumps(values), *lines)) + "\n")
    assert trip_beside(hung, read_stop(hung)) is None


def test_a_trip_after_a_stop_belongs_to_the_stop_that_is_nearer(folder: Path, tmp_path: Path) -> None:
    for file in (folder / "watchdog_hangs").iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    path = tmp_path / "watchdog_hangs.asc"
    inputs, trip = read_stop(path), read_trip(tmp_path / "watchdog_watchdog_hangs_0.jsonl").head.trip
    stop = replace(inputs, began_s=trip.at_s - 12.0, at_s=trip.at_s - 4.0)
    assert trip_beside(path, stop) is not None
    wall = datetime.fromtimestamp(trip.at_s + 1.0 + stop.wall_offset_s, tz=timezone.utc)
    name = f"stop_{stop.robot_yaml['name']}_{wall:%Y%m%dT%H%M%S}.000Z_watchdog_tripped.asc"
    (tmp_path / name).write_text("")
    assert trip_beside(path, stop) is None


def _changed(number: int, text: str) -> Callable[[list[str]], list[str]]:
    return lambda lines: [*lines[: number - 1], text, *lines[number:]]


def _head(before: str, after: str) -> Callable[[list[str]], list[str]]:
    return lambda lines: [lines[0].replace(before, after), *lines[1:]]


BAD = "line 9: no input of a watchdog"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda lines: [], "line 1: no JSON"),
        (lambda lines: ["{}"], "line 1: it is no file of the inputs of a watchdog's trip"),
        (_head('"format": 2', '"format": 7'), "format '7', expected 2"),
        (_head('"track_m"', '"wide_m"'), "line 1: a value is not"),
        (_head('"trip"', '"stop"'), "line 1: the key 'trip' is missing"),
        (_changed(9, '["frame", 1.0, 385, "27'), "line 9: no JSON"),
        (_changed(9, "[" * 100_000), "line 9: no JSON"),
        (_changed(9, "3" * 300_000), "line 9: longer than 200 kB"),
        (_changed(9, '["frame", 1.0, 4096, "00"]'), f"{BAD} (2: Input should be less than 2048"),
        (_changed(9, '["frame", 1.0, 385, "000102030405060708"]'), f"{BAD} (3: Value should have at most 8 items"),
        (_changed(9, '["frame", NaN, 385, "00"]'), f"{BAD} (1: Input should be a finite number"),
        (_changed(9, '["os.system", 1.0]'), f"{BAD} ('os.system')"),
        (_changed(9, '["tick", 1.0]'), BAD),
        (_changed(9, '{"tick": 1.0}'), BAD),
        (lambda lines: lines + [lines[1]] * 80_001, "canbase writes no more than 80000"),
    ],
)
def test_what_is_no_such_file_is_refused_with_its_line(
    folder: Path, change: Callable[[list[str]], list[str]], said: str
) -> None:
    lines = (folder / "velocity_dies" / "watchdog_velocity_dies_0.jsonl").read_text().splitlines()
    with pytest.raises(NoInputsError) as error:
        trip_inputs(change(lines))
    assert said in str(error.value)
    assert len(str(error.value)) < 400


def test_a_foreign_file_ends_the_command_with_one_sentence(tmp_path: Path) -> None:
    file = tmp_path / "notes.jsonl"
    file.write_bytes(bytes(range(256)) * 10)
    code, output = run(file)
    assert code == 1
    assert "notes.jsonl: line 1: no JSON of canbase's inputs of a stop" in output
    assert "Traceback" not in output


def test_values_at_their_limits_do_not_raise(folder: Path) -> None:
    """Garbage that has the right form is the watchdog's business: it drops and counts it."""
    inputs = read_trip(folder / "velocity_dies" / "watchdog_velocity_dies_0.jsonl")
    random, calls = Random(1), list(inputs.calls)
    for at in range(0, len(calls), 7):
        calls[at] = ("frame", calls[at][1], random.randrange(0x800), random.randbytes(random.randrange(9)))
    assert replay_trip(replace(inputs, calls=tuple(calls)))
    assert isinstance(replay_trip(_backward(inputs)), tuple)


def _backward(inputs: TripInputs) -> TripInputs:
    """The clock went back: of another computer, or edited."""
    later = [(what, at_s - 5.0, *rest) for what, at_s, *rest in inputs.calls[2000:]]
    return replace(inputs, calls=(*inputs.calls[:2000], *later))


# the driver hangs or dies with its recording ── the watchdog's file has the frames
def test_the_file_of_a_watchdog_explains_a_stop_without_the_driver(folder: Path, tmp_path: Path) -> None:
    file = folder / "driver_hangs" / "watchdog_driver_hangs_0.jsonl"
    shown = CliRunner().invoke(app, ["explain", str(file)])
    assert "inputs of a watchdog" in shown.output
    assert "first cause:  driver or master silent" in shown.output
    cut_off = tmp_path / "cut.jsonl"
    text = file.read_text()
    cut_off.write_text(text[: text.index("\n", 100_000) + 20])
    again = CliRunner().invoke(app, ["explain", str(cut_off)])
    assert "the file ends early: its last line is cut off" in again.output
