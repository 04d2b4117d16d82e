"""The driver's setpoints, replayed from cmd_vel: the same where the driver is sound and has the same limits."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_campaign.cruise import Cruise
from canbase_campaign.twins import JOYSTICK
from canbase_config.robot import Robot
from canbase_recording.recorded_inputs import Happening, RecordedInputs
from canbase_recording.replay_file import read_inputs, robot_of
from canbase_recording.replay_setpoints import recorded_setpoints, replay_setpoints
from canbase_recording.replay_text import setpoint_lines
from canbase_velocity.twist import Twist
from support.recorded_stops import record_in_a_copy

STATE = "motor_driver/state"


def turns_and_stops(cruise: Cruise) -> None:
    """0.3 m/s, a curve, backward, a stop, and 0.3 m/s again until the mux and the filter end."""
    clock = cruise.world.clock
    for ordered in (Twist(0.3, 0.0), Twist(0.2, 0.5), Twist(-0.2, 0.0), Twist(0.0, 0.0), Twist(0.3, 0.0)):
        cruise.ordered = ordered
        clock.run_until(clock.now_s + 1.0)
    cruise.world.velocity.die()
    clock.run_until(clock.now_s + 0.3)


def repeats(cruise: Cruise) -> None:
    """The joystick orders zero, and the driver sends the setpoints of its last cycle again and again."""
    cruise.world.driver.repeats = True
    cruise.ordered = Twist(0.0, 0.0)
    cruise.world.clock.run_until(cruise.world.clock.now_s + 1.5)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, RecordedInputs]:
    folder = tmp_path_factory.mktemp("recordings")
    cruise = Cruise(JOYSTICK, 0.3)
    for story in (turns_and_stops, repeats):
        record_in_a_copy(cruise.world, lambda story=story: story(cruise), folder / f"{story.__name__}.asc")  # type: ignore[misc]
    return {path.stem: read_inputs(path) for path in folder.glob("*.asc")}


def limited(inputs: RecordedInputs, **limits: float) -> Robot:
    robot = robot_of(inputs)
    return robot.model_copy(update={"limits": robot.limits.model_copy(update=limits)})


def test_a_sound_driver_sent_what_cmd_vel_orders(recordings: dict[str, RecordedInputs]) -> None:
    inputs = recordings["turns_and_stops"]
    found = replay_setpoints(inputs, robot_of(inputs))
    assert found.compared > 600
    assert found.greatest_mps < 0.012  # one cycle of the ramp: a command that arrives with a cycle counts one later
    assert found.differences == ()


def test_the_recording_has_the_curve_the_way_back_and_the_stop(recordings: dict[str, RecordedInputs]) -> None:
    cycles = recorded_setpoints(recordings["turns_and_stops"])
    assert any(cycle.right_mps - cycle.left_mps > 0.2 for cycle in cycles)
    assert min(cycle.left_mps for cycle in cycles) == pytest.approx(-0.2, abs=0.005)
    assert any(cycle.left_mps == cycle.right_mps == 0.0 for cycle in cycles)


def test_a_driver_that_does_not_obey_differs_from_then_on(recordings: dict[str, RecordedInputs]) -> None:
    inputs = recordings["repeats"]
    found = replay_setpoints(inputs, robot_of(inputs))
    (difference,) = found.differences
    assert difference.recorded_mps == pytest.approx(0.3, abs=0.001)
    assert difference.replayed_mps < 0.25
    assert "DIFFERS from" in "\n".join(setpoint_lines(inputs, found))


def test_with_a_lower_limit_the_robot_would_have_been_ordered_less(recordings: dict[str, RecordedInputs]) -> None:
    inputs = recordings["turns_and_stops"]
    found = replay_setpoints(inputs, limited(inputs, linear_mps=0.2))
    assert found.differences[0].from_s < inputs.began_s + 0.2
    assert found.greatest_mps >= 0.099
    assert all(abs(each.replayed_mps) <= 0.25 for each in found.differences)


def test_a_shorter_command_timeout_would_have_begun_the_ramp_earlier(recordings: dict[str, RecordedInputs]) -> None:
    inputs = recordings["turns_and_stops"]
    robot = robot_of(inputs)
    shorter = robot.model_copy(update={"timeouts": robot.timeouts.model_copy(update={"command_s": 0.05})})
    differences = replay_setpoints(inputs, shorter).differences
    assert differences
    assert differences[0].from_s > inputs.ends_s - 0.4
    assert all(each.replayed_mps < each.recorded_mps for each in differences)


def test_after_each_enabled_a_command_is_followed_only_after_a_zero(recordings: dict[str, RecordedInputs]) -> None:
    """As if it had been latched and enabled again within 50 ms, the joystick still pushed."""
    inputs = recordings["turns_and_stops"]
    at_s = inputs.began_s + 2.4
    again = [Happening(at_s, STATE, {"state": "LATCHED"}), Happening(at_s + 0.05, STATE, {"state": "ENABLED"})]
    happenings = tuple(sorted([*inputs.happenings, *again], key=lambda each: each.at_s))
    found = replay_setpoints(replace(inputs, happenings=happenings), robot_of(inputs))
    assert found.differences[0].from_s == pytest.approx(at_s + 0.15, abs=0.1)
    assert found.differences[0].replayed_mps == pytest.approx(0.0, abs=0.001)


def test_a_recording_in_which_nothing_was_followed_says_so(recordings: dict[str, RecordedInputs]) -> None:
    inputs = replace(recordings["repeats"], frames=())
    found = replay_setpoints(inputs, robot_of(inputs))
    assert found.compared == 0
    assert list(setpoint_lines(inputs, found)) == ["driver: it followed no commands in this recording"]
