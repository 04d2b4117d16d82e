"""The load of the bus as it is worked out beforehand, against what really is on the bench's bus; what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pydantic import ValidationError
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.bus_load import FULL_LOAD, cyclic_load, frame_bits
from canbase_config.errors import ConfigError
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from support.chain_world import bench_robot, robot_of, world_of
from support.timed_bus import on_a_wire

EIGHT = robot_of(*((node_id, 0, "left" if node_id % 2 else "right") for node_id in range(1, 9)))


def test_an_empty_frame_has_55_bits_at_most_and_a_full_one_135() -> None:
    assert [frame_bits(0), frame_bits(1), frame_bits(8)] == [55, 65, 135]


LEAST_SHARE = {True: 0.99, False: 0.75}
"""Of what was worked out: drives without SYNC may send less often."""


def test_what_is_worked_out_is_what_two_drives_of_each_kind_bring_on_the_bus(kind: str) -> None:
    world = world_of(kind)
    world.drive(seconds=0.5)
    before = len(world.log)
    world.run(2.0)
    bits = sum(frame_bits(len(frame.data)) for _, frame in world.log[before:] if not 0x580 < frame.cob_id < 0x680)
    share = bits / 2.0 / (cyclic_load(world.robot) * world.robot.bus.bitrate)
    assert LEAST_SHARE[world.robot.drives[0].kind.pdo.synchronous] <= share <= 1.01


@pytest.mark.parametrize(
    ("robot", "bitrate", "load"),
    [
        (bench_robot(), 125_000, 0.64),
        (bench_robot(), 500_000, 0.16),
        (EIGHT, 500_000, 0.58),
        (EIGHT, 1_000_000, 0.29),
    ],
)
def test_robots_that_fit(robot: Robot, bitrate: int, load: float) -> None:
    assert cyclic_load(on_a_wire(robot, bitrate)) == pytest.approx(load, abs=0.006)


@pytest.mark.parametrize(("bitrate", "load"), [(250_000, 116), (125_000, 233)])
def test_eight_drives_on_a_slow_bus_are_refused(bitrate: int, load: int) -> None:
    with pytest.raises(ValidationError, match=rf"8 motors at rates.control_hz 100 take up to {load}% of {bitrate} bit"):
        on_a_wire(EIGHT, bitrate)


def test_a_virtual_bus_has_no_bit_rate_to_be_too_slow() -> None:
    values = EIGHT.model_dump()
    values["bus"]["bitrate"] = 10_000
    assert cyclic_load(Robot.model_validate(values)) > 20.0


def test_the_limit_is_sharp() -> None:
    """Eight drives at 250 kbit/s, and the control rate at which they are just not refused."""
    values = EIGHT.model_dump() | {"bus": {"interface": "socketcan", "channel": "can0", "bitrate": 250_000}}

    def load_at(control_hz: float) -> float:
        return cyclic_load(Robot.model_validate(values | {"rates": {"control_hz": control_hz}}))

    highest = max(hz for hz in range(60, 100) if 2815 * hz + 10 * 10 * 65 + 22 * 135 < 250_000 * FULL_LOAD)
    assert FULL_LOAD - 0.011 < load_at(highest) <= FULL_LOAD
    with pytest.raises(ValidationError, match="too much to rely on"):
        load_at(highest + 1)


def can0(folder: Path, bitrate: str) -> Path:
    """The sample for a real bus with two drives, at this bit rate."""
    text = sample("example_can0").read_text(encoding="utf-8")
    text, found = re.subn(r"^  bitrate: 500000.*$", f"  bitrate: {bitrate}", text, flags=re.MULTILINE)
    assert found == 1
    file = folder / "robot.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def test_the_error_names_file_line_key_load_and_the_ways_out(tmp_path: Path) -> None:
    file = can0(tmp_path, "50000")
    line = file.read_text(encoding="utf-8").splitlines().index("  bitrate: 50000") + 1
    with pytest.raises(ConfigError) as caught:
        load_robot(file)
    assert str(caught.value) == (
        f"{file}:{line}: bus.bitrate: the cyclic frames of 2 motors at rates.control_hz 100 take up to 160% of "
        "50000 bit/s: too much to rely on; set the bus and all drives to 250000 bit/s (32%) or lower control_hz to 32"
    )


def test_a_nearly_full_bus_is_a_warning_of_every_command_that_reads_the_file(tmp_path: Path) -> None:
    file = can0(tmp_path, "125000")
    warning, *_not_commissioned = load_robot(file).warnings
    told = (
        "take up to 64% of 125000 bit/s: little room is left for boots and tools; set the bus and all drives to 250000"
    )
    assert told in str(warning)
    done = CliRunner().invoke(app, ["config", "check", str(file)])
    assert done.exit_code == 0
    assert f"warning: {file}:" in done.stderr
    assert told in done.stderr


def test_a_bus_with_room_is_no_warning(tmp_path: Path) -> None:
    for file in (can0(tmp_path, "250000"), sample("example_can0")):
        assert [warning for warning in load_robot(file).warnings if "commission" not in str(warning)] == []
