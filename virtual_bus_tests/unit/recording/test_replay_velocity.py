"""Mux and filter of a robot in virtual time, recorded and replayed: each decision is the same; another robot.yaml
changes some."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest
from typer.testing import CliRunner

from canbase_campaign.cruise import Cruise
from canbase_campaign.faults import FAULTS
from canbase_campaign.twins import JOYSTICK
from canbase_cli.main import app
from canbase_config.robot import Robot
from canbase_recording.core_state import restore
from canbase_recording.input_lines import NoInputsError
from canbase_recording.replay_file import read_velocity, velocity_beside
from canbase_recording.replay_velocity import causes, replay_velocity
from canbase_recording.stop_file import read_stop
from canbase_recording.velocity_inputs import VelocityInputs, velocity_inputs
from support.recorded_stops import record_in_a_copy

FAULT_S, AFTER_S = 1.0, 1.5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a robot that drives at 0.3 m/s for seconds, when its scanner dies or the button is pressed."""
    folder = tmp_path_factory.mktemp("recordings")
    cruise = Cruise(JOYSTICK, 0.3)
    for name in ("scan_ends", "estop"):
        (folder / name).mkdir()
        record_in_a_copy(cruise.world, lambda name=name: _go_wrong(cruise, name), folder / name / f"{name}.asc")  # type: ignore[misc]
    return folder


def _go_wrong(cruise: Cruise, name: str) -> None:
    world, clock = cruise.world, cruise.world.clock
    clock.run_until(clock.now_s + FAULT_S)
    if name == "scan_ends":
        FAULTS["scan_stale"].begin(world, cruise.around, FAULTS["scan_stale"].draw(Random(1)))
        clock.run_until(clock.now_s + AFTER_S)
    world.topics.publish(world.robot.safety.estop.topic, True)
    clock.run_until(clock.now_s + AFTER_S)


@pytest.fixture
def estop(folder: Path) -> VelocityInputs:
    return read_velocity(folder / "estop" / "velocity_estop_0.jsonl")


def robot_of(folder: Path) -> Robot:
    return Robot.model_validate(json.loads((folder / "estop" / "estop.json").read_text())["robot_yaml"])


# 0.3 m/s for more than 2 s ── the button is pressed ── every decision again
def test_each_decision_is_the_same(estop: VelocityInputs) -> None:
    found = replay_velocity(estop)
    assert (found.agrees, found.has_state) == (True, True)
    assert found.decisions > 100
    assert found.holds > 100
    assert [(recorded.cause, replayed.cause) for recorded, replayed in causes(found)] == [("estop", "estop")]
    assert any(recorded.linear_mps > 0.2 for recorded, _ in found.stops) or found.stops[0][0].action == "PASS"


def test_a_stop_for_scans_comes_again_in_the_same_period(folder: Path) -> None:
    found = replay_velocity(read_velocity(folder / "scan_ends" / "velocity_scan_ends_0.jsonl"))
    assert found.agrees
    assert [replayed.cause for _, replayed in causes(found)][:2] == ["scan_stale", "estop"]


def test_without_its_state_the_joystick_is_not_followed_before_it_shows_zero(estop: VelocityInputs) -> None:
    """The replay can tell: the joystick showed zero long before the recording begins."""
    found = replay_velocity(replace(estop, state=None))
    assert not found.agrees
    recorded, replayed = found.mux_differences[0]
    assert recorded.linear_mps == pytest.approx(0.3, abs=0.01)
    assert replayed.linear_mps == 0.0


def test_without_its_scans_the_filter_stops(estop: VelocityInputs) -> None:
    without = tuple(call for call in estop.calls if call[0] not in ("scan", "points"))
    found = replay_velocity(replace(estop, calls=without))
    assert "scan_stale" in {replayed.cause for _, replayed in found.filter_differences}


def test_a_lower_limit_would_have_limited(folder: Path, estop: VelocityInputs) -> None:
    found = replay_velocity(estop, slower(folder))
    recorded, replayed = found.filter_differences[0]
    assert (recorded.action, replayed.action, replayed.cause) == ("PASS", "LIMIT", "speed_ceiling")
    assert replayed.linear_mps == pytest.approx(0.2)


def test_a_speed_limit_of_run_time_is_replayed(estop: VelocityInputs) -> None:
    """The recorded filter had none: from this call on the replayed one limits."""
    half = len(estop.calls) // 2
    limit = ("speed_limit", estop.calls[half][1], 0.1, 2.0, "a test")
    found = replay_velocity(replace(estop, calls=(*estop.calls[:half], limit, *estop.calls[half:])))
    recorded, replayed = found.filter_differences[0]
    assert recorded.at_s >= limit[1]
    assert (recorded.action, replayed.cause) == ("PASS", "speed_ceiling")
    assert replayed.linear_mps == pytest.approx(0.1)
    assert replayed.detail.startswith("a test: ")


def slower(folder: Path) -> Robot:
    robot = robot_of(folder)
    return robot.model_copy(update={"limits": robot.limits.model_copy(update={"linear_mps": 0.2})})


def test_the_same_configuration_as_another_one_changes_nothing(folder: Path, estop: VelocityInputs) -> None:
    assert replay_velocity(estop, robot_of(folder)).agrees


def run(*arguments: object) -> tuple[int, str]:
    found = CliRunner().invoke(app, ["record", "replay", *map(str, arguments)])
    return found.exit_code, " ".join(found.output.split())


def test_the_command_replays_it_beside_the_stop_and_alone(folder: Path) -> None:
    stop = folder / "estop" / "estop.asc"
    assert velocity_beside(stop, read_stop(stop)) is not None
    for file in (stop, folder / "estop" / "velocity_estop_0.jsonl"):
        code, output = run(file)
        assert "decisions of their own file velocity_estop_0.jsonl" in output
        assert "STOP estop, 0.000 m/s 0.000 rad/s" in output
        assert "each decision is the same, at the same time" in output
        assert code == 0, output


def test_the_command_tells_what_another_robot_changes(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.yaml"
    other.write_text(json.dumps(slower(folder).model_dump(mode="json")))
    code, output = run(folder / "estop" / "velocity_estop_0.jsonl", "--config", other)
    assert code == 0
    assert "recorded PASS, 0.300 m/s" in output
    assert "replayed LIMIT speed_ceiling, 0.200 m/s" in output


BAD = "no input of mux or filter"


@pytest.mark.parametrize(
    ("number", "line", "said"),
    [
        (1, "", "line 1: no JSON"),
        (1, '{"part": "watchdog"}', "line 1: it is no file of the inputs of mux and filter"),
        (1, '{"part": "velocity", "format": 9}', "format '9', expected 1"),
        (1, '{"part": "velocity", "format": 1}', "line 1: the key 'robot' is missing"),
        (5, '["decide", 1.0', "line 5: no JSON"),
        (5, '["decide", 1.0]', f"line 5: {BAD}"),
        (5, '["system", 1.0]', f"line 5: {BAD} ('system')"),
        (5, '["obey", 1e999, 1.0]', f"line 5: {BAD} (1: Input should be a finite number"),
        (5, '["scan", 1.0, "scan", {"ranges_m": {}}, null]', f"line 5: {BAD}"),
        (5, '["state", 1.0, null]', f"line 5: {BAD} ('state')"),
    ],
)
def test_what_is_no_such_file_is_refused_with_its_line(folder: Path, number: int, line: str, said: str) -> None:
    lines = (folder / "estop" / "velocity_estop_0.jsonl").read_text().splitlines()
    lines[number - 1] = line
    with pytest.raises(NoInputsError) as error:
        velocity_inputs(lines)
    assert said in str(error.value)


def _pickle() -> str:
    return base64.b64encode(b"cos\nsystem\n(S'true'\ntR.").decode()


@pytest.mark.parametrize(
    "state",
    [
        {"of": "os:system", "number": 0, "state": {}},
        {"of": "canbase_velocity.main:run", "number": 0, "state": {}},
        {"of": "canbase_velocity.twist:Twist", "number": 0, "state": {"__class__": 1}},
        {"of": "canbase_velocity.mux:Mux", "number": 0, "state": {"decide": 1}},
        {"enum": "canbase_velocity.twist:Twist", "name": "x"},
        {"array": "AAAA", "kind": "|O", "shape": [1]},
        {"bytes": "*"},
        {"same": 7},
        {"pickle": _pickle()},
        {"tuple": [{"tuple": []}] * 3},
        [],
        7,
    ],
)
def test_a_state_that_is_none_is_refused_and_nothing_of_it_is_called(estop: VelocityInputs, state: Any) -> None:
    with pytest.raises(NoInputsError, match="no state of mux and filter"):
        replay_velocity(replace(estop, state=state))


def test_a_state_that_is_too_deep_is_refused() -> None:
    state: Any = 1
    for _ in range(100):
        state = [state]
    with pytest.raises(NoInputsError, match="too deep"):
        restore(state, None)


def test_damaged_states_never_raise_anything_else(folder: Path, estop: VelocityInputs) -> None:
    """A byte of the state changed, a hundred times: another decision, or refused."""
    text, random = json.dumps(estop.state), Random(3)
    for _ in range(100):
        at = random.randrange(len(text))
        changed = text[:at] + random.choice('0123456789abc"{}[]:,') + text[at + 1 :]
        _replay_or_refuse(estop, changed)


def _replay_or_refuse(estop: VelocityInputs, text: str) -> None:
    try:
        replay_velocity(replace(estop, state=json.loads(text)))
    except (NoInputsError, json.JSONDecodeError):
        return
