"""Robots that cannot stop in a stated way: what is refused, what is warned of, with which numbers and keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from canbase_config.errors import ConfigError
from canbase_config.load import load_robot, sample
from canbase_config.profile_file import load_profile
from canbase_config.robot import Robot
from canbase_config.stop_checks import uncertain_stops
from canbase_config.stopping import given_up_s, standstill_s
from support.crews import robot_with


def bench(folder: Path, old: str, new: str) -> Path:
    text = sample("bench").read_text()
    assert old in text
    file = folder / "robot.yaml"
    file.write_text(text.replace(old, new))
    return file


def test_a_deadline_that_is_shorter_than_the_ramp_is_refused_with_the_numbers(tmp_path: Path) -> None:
    file = bench(tmp_path, "lease:\n", "timeouts: {standstill_s: 1.0}\nlease:\n")
    with pytest.raises(ConfigError) as refused:
        load_robot(file)
    told = str(refused.value)
    assert "timeouts.standstill_s" in told
    assert "standstill_s (1) is shorter than the ramp: an ordinary stop takes up to 1.02 s" in told
    assert "leave standstill_s out" in told
    assert load_robot(bench(tmp_path, "lease:\n", "timeouts: {standstill_s: 1.1}\nlease:\n")).robot


def test_a_ramp_that_nobody_can_wait_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"takes up to 17\.\d\d s .* raise jerk_mps3 or deceleration_mps2"):
        load_robot(bench(tmp_path, "  linear_mps: 0.8\n", "  linear_mps: 0.8\n  jerk_mps3: 0.0107\n"))


def test_without_the_key_the_deadline_follows_from_the_limits(tmp_path: Path) -> None:
    soft = load_robot(bench(tmp_path, "  linear_mps: 0.8\n", "  linear_mps: 0.8\n  jerk_mps3: 0.2\n")).robot
    assert standstill_s(soft) == pytest.approx(0.12 + 2 * 4.0 + 0.5)
    fast = soft.limits.model_copy(update={"linear_mps": 3.0, "deceleration_mps2": 0.9, "jerk_mps3": 10.0})
    robot = soft.model_copy(update={"limits": fast})
    assert standstill_s(robot) == pytest.approx(0.12 + 2 * (3.0 / 0.9 + 0.09) + 0.5)
    assert given_up_s(robot) == pytest.approx(standstill_s(robot) + 0.12 + (3.6 * 1.1 + 0.05) / 0.45)


def of_kind(kind: str, **changes: object) -> Robot:
    robot = load_robot(sample("bench")).robot
    drive = robot.drives[0].model_copy(update={"profile": kind, "velocity_unit": None} | changes)
    return robot.model_copy(update={"drives": (drive, robot.drives[1])})


def test_a_drive_whose_own_ramp_is_not_proven_is_warned_of() -> None:
    (loc, told), *_ = uncertain_stops(of_kind("epos4"))
    assert loc == ("drives", 0, "profile")
    assert "may not be the stated one, 0.50 s and 0.24 m from 0.8 m/s: the unit of its 6085h has no source" in told


@pytest.mark.parametrize("kind", ["generic", "zlac8015d", "roboteq"])
def test_a_drive_with_a_known_ramp_is_not(kind: str) -> None:
    assert list(uncertain_stops(of_kind(kind))) == []


OWN = "title: own\noptions: {ramps: no}\n", "title: own\nself_stop: {abort_connection_code: 2}\n"


@pytest.mark.parametrize(
    ("profile", "told"),
    [
        (OWN[0], "may not be the stated one, 0.50 s and 0.24 m from 0.8 m/s: it has no 6085h"),
        (OWN[1], "a quick stop takes up to 0.58 s; when driver and watchdog end meanwhile, a own coasts after"),
    ],
)
def test_a_drive_that_cannot_be_told_how_to_stop_is_warned_of(tmp_path: Path, profile: str, told: str) -> None:
    (tmp_path / "own.yaml").write_text(profile)
    assert load_profile(str(tmp_path / "own.yaml")).title == "own"
    file = bench(tmp_path, "    # profile: generic ", "    profile: own.yaml # ")
    (warning,) = load_robot(file).warnings
    assert told in str(warning)


def test_a_quick_stop_within_the_heartbeat_is_not_cut_short(tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_text(OWN[1])
    text = bench(tmp_path, "    # profile: generic ", "    profile: own.yaml # ").read_text()
    (tmp_path / "robot.yaml").write_text(text.replace("lease:\n", "timeouts: {drive_heartbeat_s: 0.6}\nlease:\n"))
    assert load_robot(tmp_path / "robot.yaml").warnings == ()


@pytest.mark.parametrize(
    ("profile", "told"),
    [
        (
            "generic",
            "detected only where its drive gives half of the rated torque for watchdog.motion_missing_s (0.25)",
        ),
        ("kinco", "left_wheel, right_wheel cannot be watched for a dead encoder at standstill"),
    ],
)
def test_a_robot_that_wants_no_proof_of_a_stand_is_told_what_is_not_found(profile: str, told: str) -> None:
    robot = robot_with(profile)
    watchdog = robot.watchdog.model_copy(update={"stand_proof": "none"})
    sentences = dict(uncertain_stops(robot.model_copy(update={"watchdog": watchdog})))
    assert told in sentences["watchdog", "stand_proof"]
    assert ("watchdog", "stand_proof") not in dict(uncertain_stops(robot))


@pytest.mark.parametrize(
    ("jerk", "told"), [(0.1, "up to 1.15 s (0.92 m) after an order of zero"), (0.5, "0.72 s"), (5.0, "")]
)
def test_a_low_jerk_says_how_long_a_driver_that_hangs_is_followed(jerk: float, told: str) -> None:
    robot = load_robot(sample("bench")).robot
    soft = robot.model_copy(update={"limits": robot.limits.model_copy(update={"jerk_mps3": jerk})})
    sentences = dict(uncertain_stops(soft))
    assert (("limits", "jerk_mps3") in sentences) == bool(told)
    assert told in sentences.get(("limits", "jerk_mps3"), "")


@pytest.mark.parametrize(
    ("hz", "told"), [(20.0, "up to 0.35 s"), (25.0, "up to 1.7 m/s faster"), (49.0, "0.29 s"), (50.0, ""), (100.0, "")]
)
def test_slow_cycles_say_how_fast_a_wheel_without_an_encoder_gets(hz: float, told: str) -> None:
    robot = load_robot(sample("bench")).robot
    slow = robot.model_copy(update={"rates": robot.rates.model_copy(update={"control_hz": hz})})
    sentences = dict(uncertain_stops(slow))
    assert (("rates", "control_hz") in sentences) == bool(told)
    assert told in sentences.get(("rates", "control_hz"), "")


@pytest.mark.parametrize(("section", "place", "told"), [
    (
        {"safety": {"scan": {"same_clock": False}}},
        ("safety", "scan", "same_clock"), "drives at most 0.15 m/s (safety.blind_mps)",
    ),
    ({"safety": {"scan": {"noisy": False}}}, ("safety", "scan", "noisy"), "scans on scan may be of any age"),
    (
        {"safety": {"more_scans": [{"required": True, "topic": "rear", "same_clock": False}]}},
        ("safety", "more_scans", 0, "same_clock"), "how old the scans on rear are is unknown",
    ),
    (
        {"mux": {"sources": {"joystick": {"same_clock": False}}}},
        ("mux", "sources", "joystick", "same_clock"), "as long as the network delays them, up to 0.8 m each second",
    ),
    (
        {"mux": {"sources": {"joystick": {"stamped": False}}}},
        ("mux", "sources", "joystick", "stamped"), "how old the commands of joystick are is unknown",
    ),
])  # fmt: skip
def test_messages_whose_age_is_unknown_are_warned_of_with_the_speed_that_is_left(
    section: dict[str, Any], place: tuple[str | int, ...], told: str
) -> None:
    values = load_robot(sample("bench")).robot.model_dump()
    assert not list(uncertain_stops(Robot.model_validate(values)))
    _merge(values, section)
    ((found, sentence),) = uncertain_stops(Robot.model_validate(values))
    assert found == place
    assert told in sentence


def _merge(values: dict[str, Any], other: dict[str, Any]) -> None:
    for key, value in other.items():
        if isinstance(value, dict):
            _merge(values[key], value)
        else:
            values[key] = value


@pytest.mark.parametrize(("key", "value"), [("usable_share", 0.9), ("blind_mps", 3.0)])
def test_keys_that_make_what_no_scanner_sees_count_as_free_are_refused(tmp_path: Path, key: str, value: float) -> None:
    text = sample("bench").read_text()
    assert "\nsafety:\n" in text
    file = tmp_path / "robot.yaml"
    file.write_text(text.replace("\nsafety:\n", f"\nsafety:\n  {key}: {value}\n"))
    with pytest.raises(ConfigError, match=rf"safety\.{key}"):
        load_robot(file)


@pytest.mark.parametrize(
    ("range_m", "told"),
    [
        (None, ""),
        (30.0, ""),
        (6.0, ""),
        (4.0, "limits.linear_mps 3 needs a scanner with a range of 4.95 m"),
        (
            4.0,
            "the range of scan is 4 m, so straight on, where no other scanner looks, the base drives at most 2.59 m/s",
        ),
        (0.2, "at most 0.15 m/s"),
    ],
)
def test_a_range_that_is_too_short_for_the_speed_is_reported_with_the_speed_that_is_left(
    range_m: float | None, told: str
) -> None:
    robot = load_robot(sample("bench")).robot
    values = robot.model_dump()
    values["limits"] |= {"linear_mps": 3.0, "deceleration_mps2": 1.5, "emergency_deceleration_mps2": 3.0}
    values["safety"]["scan"]["range_m"] = range_m
    sentences = [text for place, text in uncertain_stops(Robot.model_validate(values)) if place[-1] == "range_m"]
    assert [told in text for text in sentences] == ([True] if told else [])
