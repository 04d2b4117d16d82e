"""Ordinary driving trips nothing: some robots for some seconds here, hours by `make soak`."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace

import pytest

from campaign import soak
from campaign.soak import Driven, drive_all, told
from canbase_campaign.ordinary import OrdinaryHour
from canbase_campaign.robots import DrawnRobot, at_edges, draw_robot
from canbase_config.reserves import RESERVES
from canbase_config.robot import Robot
from canbase_config.stopping import max_wheel_mps
from canbase_config.tolerances import BOUNDS
from canbase_config.units import m_per_count

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]


def test_robots_that_drive_as_they_should_are_not_stopped() -> None:
    driven = list(drive_all(range(1, 7), 15.0, 2))
    assert [told(each.trip) for each in driven if each.trip is not None] == []
    assert sum(each.moving_s for each in driven) > 20.0
    assert sum(each.path_m for each in driven) > 2.0


@pytest.mark.parametrize(("seed", "seconds"), [(34, 8.0), (5, 35.0)])
def test_robots_that_were_stopped_once_are_not_any_more(seed: int, seconds: float) -> None:
    """34: soft drives with strong motors, 0.07 s against a threshold: free again, a wheel overshoots by half.

    5: a wheel is held while its order goes through zero; free again it has to creep the other way.
    """
    (driven,) = drive_all(range(seed, seed + 1), seconds, 1)
    assert driven.trip is None, told(driven.trip)


def with_coarse_encoders(number: int) -> DrawnRobot:
    """Slow, at 200 cycles a second, and as coarse as the widest tolerance of its travel that is accepted: an increment
    is more than one and a half times what its fastest wheel does in a cycle."""
    drawn = draw_robot(number)
    values = drawn.robot.model_dump()
    values["rates"]["control_hz"] = 200.0
    for key in ("linear_mps", "angular_radps"):
        values["limits"][key] *= 0.3
    (widest,) = (row for row in BOUNDS if row.key == "watchdog.motion_missing_m")
    values["watchdog"]["motion_missing_m"] = widest.bound(Robot.model_validate(values))
    rows = [row for row in RESERVES if row.key == widest.key]
    return replace(drawn, robot=at_edges(Robot.model_validate(values), rows))


@pytest.mark.parametrize("number", [2, 3, 5])
def test_a_slow_robot_with_coarse_encoders_is_not_stopped(number: int) -> None:
    drawn = with_coarse_encoders(number)
    robot = drawn.robot
    increment_m = abs(m_per_count(robot.drives[0], robot.base.wheel_radius_m))
    assert increment_m > 1.5 * max_wheel_mps(robot) / robot.rates.control_hz
    trip = OrdinaryHour(number, drawn=drawn).run(8.0)
    assert trip is None, told(trip)


@pytest.mark.parametrize("number", [1, 4, 7])
def test_a_robot_with_all_keys_at_the_edges_of_what_is_accepted_is_not_stopped(number: int) -> None:
    drawn = draw_robot(number)
    trip = OrdinaryHour(number, drawn=replace(drawn, robot=at_edges(drawn.robot))).run(8.0)
    assert trip is None, told(trip)


def test_a_loaded_robot_has_double_payload_and_is_never_on_a_level_floor() -> None:
    for seed in (1, 2, 4):
        hour = OrdinaryHour(seed, loaded=True)
        assert hour.drawn.body.payload_factor == 2.0
        assert str(hour.drawn.robot) == str(OrdinaryHour(seed).drawn.robot)
        for _ in range(20):
            hour._change_slope()
            assert abs(hour.world.drives.bench.base.push_n) > 0.0


def test_the_same_seed_drives_the_same_way() -> None:
    assert [drive_all(range(3, 4), 8.0, 1).__next__() for _ in range(2)] == list(drive_all(range(3, 4), 8.0, 1)) * 2


def test_a_drive_that_does_not_obey_is_told_with_its_robot_and_what_had_happened() -> None:
    hour = OrdinaryHour(3)
    assert len(hour.drawn.robot.drives) == 2, "alone on its side: no other motor turns its wheel"
    assert hour.run(6.0) is None
    hour.world.drives.axis(0).faults.ignores_setpoints = True
    trip = hour.go_on(30.0)
    assert trip is not None
    lines = told(trip).splitlines()
    assert lines[0].startswith("seed 3, after ")
    assert "watchdog: " in lines[0]
    assert "robot 3: " in lines[1]
    assert len(lines) > 3


def test_the_command_says_what_it_drove() -> None:
    command = [sys.executable, "-m", "campaign.soak", "--hours", "0.001", "--seed", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 robots, 0.00 h in virtual time" in done.stdout
    assert "0 false trips" in done.stdout


def test_ctrl_c_tells_what_was_driven_until_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def until_ctrl_c(*_given: object) -> Iterator[Driven]:
        yield Driven(7, time_s=3600.0, moving_s=1800.0, path_m=2000.0, trip=None, processor_s=60.0)
        raise KeyboardInterrupt

    monkeypatch.setattr(soak, "drive_all", until_ctrl_c)
    monkeypatch.setattr(sys, "argv", ["soak", "--hours", "20"])
    assert soak.main() == 130
    told = " ".join(capsys.readouterr().out.split())
    assert "1 robots, 1.00 h in virtual time, 0.50 h of them in motion, 2.00 km" in told
    assert "0 false trips; broken off, 600 robots were asked for" in told
