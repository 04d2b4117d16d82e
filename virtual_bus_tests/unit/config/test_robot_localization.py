"""What `canbase print ekf` prints for robot_localization: names, values, and what robot.yaml needs for it.

`ROBOT_LOCALIZATION=/path/to/robot_localization pytest -k robot_localization` holds the names against that source; no
text of it is in this repository.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.robot_localization import STATE, ekf, note

BENCH = load_robot(sample("bench")).robot
SOURCE = Path(os.environ.get("ROBOT_LOCALIZATION", "/nonexistent"))
KNOWN = {
    *("frequency", "sensor_timeout", "two_d_mode", "publish_tf", "odom_frame", "base_link_frame", "world_frame"),
    *("odom0", "odom0_config", "odom0_queue_size", "imu0", "imu0_config", "imu0_queue_size"),
    "process_noise_covariance",
}
"""Parameters that `src/ros_filter.cpp` of robot_localization 3.6.0 declares; `odom0` and `imu0` name topics."""
ORDER = ("X", "Y", "Z", "Roll", "Pitch", "Yaw", "Vx", "Vy", "Vz", "Vroll", "Vpitch", "Vyaw", "Ax", "Ay", "Az")
"""`enum StateMembers` of its `filter_common.hpp`."""


def printed(robot: Robot = BENCH, imu: str = "imu") -> dict[str, Any]:
    (node, section), *others = YAML(typ="safe").load(ekf(robot, imu)).items()
    assert (node, others) == ("/**/ekf_filter_node", [])
    parameters: dict[str, Any] = section["ros__parameters"]
    return parameters


def but(**odometry: Any) -> Robot:
    return BENCH.model_copy(update={"odometry": BENCH.odometry.model_copy(update=odometry)})


def chosen(vector: list[bool]) -> set[str]:
    return {name for name, taken in zip(STATE, vector, strict=True) if taken}


def test_every_parameter_is_one_that_robot_localization_has() -> None:
    assert set(printed()) == KNOWN
    assert [name.lower() for name in ORDER] == list(STATE)


def test_wheels_give_velocities_alone_and_the_imu_gives_its_yaw_rate() -> None:
    values = printed(imu="imu/data")
    assert (values["odom0"], values["imu0"]) == ("odom", "imu/data")
    assert chosen(values["odom0_config"]) == {"vx", "vy", "vyaw"}
    assert chosen(values["imu0_config"]) == {"vyaw"}
    assert values["two_d_mode"] is True


def test_frames_rate_and_noise_follow_from_robot_yaml() -> None:
    robot = BENCH.model_copy(
        update={
            "base": BENCH.base.model_copy(update={"odom_frame": "r1/odom", "base_frame": "r1/base"}),
            "limits": BENCH.limits.model_copy(
                update={"emergency_deceleration_mps2": 3.0, "angular_deceleration_radps2": 5.0}
            ),
        }
    )
    values = printed(robot)
    frames = [values[f"{name}_frame"] for name in ("odom", "base_link", "world")]
    assert frames == ["r1/odom", "r1/base", "r1/odom"]
    assert values["frequency"] == robot.rates.odometry_hz
    noise = dict(zip(STATE, values["process_noise_covariance"], strict=True))
    # within one period the velocity may change by limit × period: per second, limit² × period
    assert (noise["vx"], noise["vyaw"]) == pytest.approx((9.0 / 50.0, 25.0 / 50.0))
    assert all(value > 0.0 for value in noise.values())


def test_two_publishers_of_one_transform_are_reported_before_they_happen() -> None:
    assert "odometry.publish_tf: false" in note(but(publish_tf=True))
    assert note(but(publish_tf=False)) == ""


def test_the_command_prints_it_and_its_note() -> None:
    result = CliRunner().invoke(app, ["print", "ekf", "--imu", "imu/data"])
    assert result.exit_code == 0
    assert result.stdout == ekf(BENCH, "imu/data")
    assert "\nnote: the filter publishes odom → base_link" in result.stderr  # after the robot that it means


def test_the_docs_have_what_is_printed() -> None:
    page = (Path(__file__).parents[3] / "docs" / "odometry.md").read_text(encoding="utf-8")
    assert ekf(BENCH, "imu") in page


@pytest.mark.skipif(not SOURCE.is_dir(), reason="ROBOT_LOCALIZATION is not set to a checkout of robot_localization")
def test_the_source_of_robot_localization_has_these_names() -> None:
    code = (SOURCE / "src/ros_filter.cpp").read_text(encoding="utf-8")
    states = re.search(r"enum StateMembers.*?\{(.*?)\}", _header(), re.DOTALL)
    assert states is not None
    names = re.findall(r"StateMember(\w+)", states.group(1))
    assert names == list(ORDER)
    for parameter in KNOWN - {"odom0", "imu0"}:
        stem = re.sub(r"^(odom|imu)0", "", parameter)
        assert f'"{stem}"' in code, parameter
    assert re.search(r'ss << "odom" << topic_ind', code)
    assert re.search(r'ss << "imu" << topic_ind', code)


def _header() -> str:
    return (SOURCE / "include/robot_localization/filter_common.hpp").read_text(encoding="utf-8")
