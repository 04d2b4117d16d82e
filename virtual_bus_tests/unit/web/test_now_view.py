"""The page `Now`: which part of the chain is red, with which sentence, and values that are not there."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from canbase.msg import (
    DriverStatus,
    DriveStatus,
    ForeignPublisher,
    MuxLock,
    MuxSource,
    MuxState,
    SafetyState,
    StopEvent,
)
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, LaserScan

from canbase_config.load import load_robot, sample
from canbase_runtime.last_message import NOT_RECEIVED, SILENT_S, LastMessage
from canbase_web.floor_view import MOST_POINTS, outlines, points
from canbase_web.now_page import _rounded_up
from canbase_web.now_view import (
    Level,
    Robot,
    chain,
    fast_values,
    header_values,
    headline,
    held_sentence,
    slow_values,
    still_sentence,
)
from canbase_web.stops_page import rows_of

NAN = math.nan


def source(**changes: object) -> MuxSource:
    values: dict[str, object] = {
        "name": "joystick",
        "priority": 100,
        "active": True,
        "standing": MuxSource.FOLLOWED,
        "age_s": 0.02,
        "timeout_s": 0.3,
    }
    return MuxSource(**(values | changes))


def drive(**changes: object) -> DriveStatus:
    values: dict[str, object] = {
        "joint": "left_wheel",
        "state": "operation enabled",
        "target_radps": 1.0,
        "velocity_radps": 0.9,
        "voltage_v": NAN,
        "current_a": 2.5,
        "temperature_c": NAN,
        "torque_share": 0.1,
        "feedback_age_s": 0.0,
    }
    return DriveStatus(**(values | changes))


def driver(**changes: object) -> DriverStatus:
    values: dict[str, object] = {
        "state": DriverStatus.ENABLED,
        "cause": "none",
        "watchdog": "ok",
        "drives": [drive()],
        "standstill": False,
    }
    return DriverStatus(**(values | changes))


def safety(**changes: object) -> SafetyState:
    values: dict[str, object] = {
        "action": SafetyState.PASS,
        "cause": "none",
        "clearance_ahead_m": math.inf,
        "clearance_behind_m": NAN,
    }
    return SafetyState(**(values | changes))


WELL = Robot(
    mux=LastMessage(MuxState(ready=True, sources=[source()]), 0.1),
    safety=LastMessage(safety(), 0.1),
    driver=LastMessage(driver(), 0.1),
)


def test_a_robot_that_drives_is_green_and_says_who_drives() -> None:
    assert {part.level for part in chain(WELL)} == {Level.GOOD}
    assert header_values(WELL) == {
        "level": "good",
        "text": "enabled, moves · joystick drives",
        "waits_for_reset": False,
    }


def mux(**changes: object) -> LastMessage:
    return LastMessage(MuxState(**({"ready": True, "sources": [source()]} | changes)), 0.1)


UNARMED = source(standing=MuxSource.UNARMED, reason="waiting for zero")
PAUSE = MuxLock(name="pause", holds=True, standing=MuxLock.LOCKED, reason="holds")
STRANGER = ForeignPublisher(node="/x", topic="cmd_vel", problem="not named")
BLOCKED = safety(action=SafetyState.STOP, cause="obstacle", detail="0.12 m ahead", clears_on="free way")
NEAR = safety(action=SafetyState.SLOW, cause="obstacle_near", detail="0.4 m ahead")
LATCHED = driver(state=DriverStatus.LATCHED, cause="stop requested", detail="by whom", clears_on="reset")
BOOTS = driver(state=DriverStatus.BOOTING, cause="booting")
TRIPPED = driver(watchdog="tripped", watchdog_cause="lease lost", watchdog_rung=1)


@pytest.mark.parametrize(
    ("changes", "part", "level", "text"),
    [
        ({"mux": mux(sources=[])}, "source", Level.IDLE, "no active source"),
        ({"mux": mux(sources=[UNARMED])}, "source", Level.BAD, "joystick is not followed: waiting for zero"),
        ({"mux": mux(locks=[PAUSE])}, "velocity_mux", Level.BAD, "lock pause: "),
        ({"mux": mux(foreign=[STRANGER])}, "velocity_mux", Level.BAD, "/x publishes on cmd_vel: not named"),
        ({"mux": mux(ready=False, not_ready="drives off")}, "velocity_mux", Level.WARN, "drives off"),
        ({"safety": BLOCKED}, "safety_filter", Level.BAD, "stops: 0.12 m ahead; ends with: free way"),
        ({"safety": NEAR}, "safety_filter", Level.WARN, "slows: 0.4 m ahead"),
        ({"driver": LATCHED}, "motor_driver", Level.BAD, "latched: stop requested (by whom); ends with: reset"),
        ({"driver": BOOTS}, "motor_driver", Level.WARN, "booting: booting"),
        ({"driver": TRIPPED}, "watchdog", Level.BAD, "tripped: lease lost; its ladder: quick stop"),
        ({"driver": driver(watchdog="tripped", watchdog_rung=99)}, "watchdog", Level.BAD, "its ladder: unknown (99)"),
        ({"driver": driver(state=200)}, "motor_driver", Level.BAD, "offline: none"),
        ({"safety": safety(action=200, cause="obstacle")}, "safety_filter", Level.BAD, "unknown (200): obstacle"),
        ({"driver": driver(watchdog="missing")}, "watchdog", Level.BAD, "missing"),
        ({"driver": driver(drives=[drive(error_code=0x2310, error_text="overcurrent")])}, "drives", Level.BAD,
         "left_wheel: 2310h overcurrent"),
        ({"driver": driver(drives=[drive(boot_problem="no answer")])}, "drives", Level.BAD, "left_wheel: no answer"),
        ({"driver": driver(drives=[drive(health="85 °C, limit 80 °C")])}, "drives", Level.WARN, "85 °C"),
        ({"driver": driver(drives=[drive(state="fault")])}, "drives", Level.WARN, "left_wheel: fault"),
    ],
)  # fmt: skip
def test_the_part_that_stops_is_red_and_says_why(
    changes: dict[str, object], part: str, level: Level, text: str
) -> None:
    robot = replace(
        WELL,
        **{key: each if isinstance(each, LastMessage) else LastMessage(each, 0.1) for key, each in changes.items()},
    )
    (found,) = (each for each in chain(robot) if each.name == part)
    assert found.level is level
    assert text in found.text
    top = headline(robot)
    assert text in top.text
    assert top.level is (Level.GOOD if level is Level.IDLE else level)


def test_the_header_has_the_latched_stop_its_cause_and_its_reset_and_what_needs_a_look_is_not_in_the_way() -> None:
    latched = driver(
        state=DriverStatus.LATCHED, cause="stop requested", clears_on="reset", drives=[drive(health="85 °C")]
    )
    robot = replace(WELL, mux=mux(sources=[]), driver=LastMessage(latched, 0.1))
    assert header_values(robot) == {
        "level": "bad",
        "text": "latched: stop requested; ends with: reset · no active source",
        "waits_for_reset": True,
    }
    assert not header_values(replace(robot, driver=LastMessage(latched, 3.0)))["waits_for_reset"]
    assert header_values(replace(WELL, safety=LastMessage(safety(clears_on="reset"), 0.1)))["waits_for_reset"]


STOPS = (
    StopEvent(cause="estop", latched=True),
    StopEvent(cause="stop requested", latched=True, black_box="/x/stop.asc"),
    StopEvent(cause="obstacle", standstill=True, standstill_s=0.4, distance_m=0.1),
)


@pytest.mark.parametrize(
    ("robot", "newest"),
    [
        (WELL, "done"),
        (replace(WELL, driver=LastMessage(LATCHED, 0.1)), "needed"),
        (replace(WELL, driver=LastMessage(LATCHED, 9.0)), "needed"),
        (replace(WELL, safety=LastMessage(safety(estop=True, clears_on="release"), 0.1)), "needed"),
    ],
)
def test_a_reset_is_needed_for_the_newest_latched_stop_until_it_is_done(robot: Robot, newest: str) -> None:
    rows = rows_of(STOPS, robot)
    assert [(row["cause"], row["reset"]) for row in rows] == [
        ("obstacle", ""), ("stop requested", newest), ("estop", "done"),
    ]  # fmt: skip
    assert (rows[0]["time"], rows[0]["way"], rows[1]["file"]) == ("0.40 s", "0.100 m", "stop.asc")


@pytest.mark.parametrize("value", [0.8, 2.0, 0.5 / 0.075, 0.85, 13.37, 99.0])
def test_the_ends_of_an_axis_have_two_digits_and_its_quarters_few_more(value: float) -> None:
    """Six digits of a label do not fit beside a plot on a phone."""
    most = _rounded_up(value)
    assert value <= most <= 1.2 * value
    assert max(len(f"{most:g}"), len(f"{most / 2:g}")) <= 4


@pytest.mark.parametrize("name", ["mux", "safety", "driver"])
@pytest.mark.parametrize(("age_s", "fresh"), [(SILENT_S, True), (SILENT_S + 0.01, False)])
def test_a_part_that_is_silent_is_red_and_its_last_state_is_not_shown(name: str, age_s: float, fresh: bool) -> None:
    last = replace(getattr(WELL, name), age_s=age_s)
    robot = replace(WELL, **{name: last})
    assert (headline(robot).level is Level.GOOD) is fresh
    shown = json.dumps([slow_values(robot), header_values(robot)])
    if name == "driver":
        assert ("operation enabled" in shown) is fresh
    if not fresh:
        assert "no message for 2 s" in shown


def test_a_part_that_never_spoke_says_so() -> None:
    assert [part.level for part in chain(Robot())] == [Level.BAD] * 6
    assert headline(Robot()).text == "motor_driver: no message yet · velocity_mux: no message yet"


def test_values_that_a_drive_does_not_measure_are_dashes_and_the_whole_is_json() -> None:
    values = slow_values(WELL)
    assert values["drives"] == [
        ["left_wheel", "operation enabled", "1.00 rad/s", "0.90 rad/s", "2.50 A", "10.00 %", "–", "–", "0.00 s", ""]
    ]
    assert values["free"] == "free ahead all, behind unknown"
    json.dumps(values, allow_nan=False)


def test_the_numbers_of_the_plots_are_of_fresh_messages_alone_and_never_nan() -> None:
    twist = TwistStamped()
    twist.twist.linear.x, twist.twist.angular.z = 0.3, NAN
    odom = Odometry()
    odom.twist.twist.linear.x = 0.29
    joints = JointState(name=["left_wheel"], velocity=[1.1])
    robot = replace(
        WELL,
        selected=LastMessage(twist, 0.0),
        ordered=LastMessage(twist, 9.0),
        odom=LastMessage(odom, 0.0),
        joints=LastMessage(joints, 0.0),
    )
    values = fast_values(robot, 12.3456, (-0.1, 0.5, -1.0, math.inf))
    assert values == {
        "t": 12.346,
        "linear": [0.3, None, 0.29, -0.1, 0.5],
        "angular": [None, None, 0.0, -1.0, None],
        "wheels": [[1.0, 1.1]],
    }
    json.dumps(values, allow_nan=False)


def test_without_joint_states_the_drivers_own_speed_is_shown() -> None:
    assert fast_values(WELL, 1.0, (0.0, 0.0, 0.0, 0.0))["wheels"] == [[1.0, 0.9]]


def test_the_picture_from_above_has_the_footprint_and_the_ways_that_must_be_free() -> None:
    robot = load_robot(sample("bench")).robot
    found = outlines(robot)
    assert found["footprint"] == [0.3, 0.3, 0.3, 0.3]
    assert found["stop"][0] == pytest.approx(0.3 + robot.safety.stop_distance_m)
    assert found["slow"][0] == pytest.approx(0.3 + robot.safety.slow_distance_m)


@pytest.mark.parametrize("count", [1, 240, 241, 720, 5000])
def test_readings_are_placed_by_robot_yaml_and_there_are_never_too_many(count: int) -> None:
    scanner = load_robot(sample("example_can0")).robot.safety.scan
    scan = LaserScan(angle_min=0.0, angle_increment=1e-6, range_min=0.1, range_max=10.0, ranges=[1.0] * count)
    found = points(scanner, scan)
    assert 1 <= len(found) <= MOST_POINTS
    assert found[0] == [1.25, 0.0], "the scanner is 0.25 m before the middle"


@pytest.mark.parametrize("reading", [NAN, math.inf, -math.inf, 0.05, 10.5, 3.5])
def test_a_reading_that_is_none_or_too_far_for_the_picture_is_left_out(reading: float) -> None:
    scanner = load_robot(sample("example_can0")).robot.safety.scan
    scan = LaserScan(angle_increment=0.01, range_min=0.1, range_max=10.0, ranges=np.array([1.0, reading], np.float32))
    assert len(points(scanner, scan)) == 1


@pytest.mark.parametrize("field", ["angle_min", "angle_increment"])
@pytest.mark.parametrize("value", [NAN, math.inf])
def test_angles_that_are_no_numbers_give_no_points_that_are_none(field: str, value: float) -> None:
    scanner = load_robot(sample("example_can0")).robot.safety.scan
    scan = LaserScan(range_min=0.1, range_max=10.0, ranges=[1.0] * 10)
    setattr(scan, field, value)
    json.dumps(points(scanner, scan), allow_nan=False)


def test_an_empty_scan_has_no_points() -> None:
    assert points(load_robot(sample("example_can0")).robot.safety.scan, LaserScan()) == []


UNARMED = {"standing": MuxSource.UNARMED, "reason": "waiting for zero (restarted)"}
BEHIND = {"active": False, "standing": MuxSource.LOWER_PRIORITY, "reason": "joystick has priority"}


def of(*sources: MuxSource) -> LastMessage:
    return LastMessage(MuxState(sources=sources), 0.1)


HELD = (
    (of(source(name="web")), "drives"),
    (of(source(name="web", **UNARMED)), "not followed: waiting for zero (restarted)"),
    (of(source(), source(name="web", **BEHIND)), "not followed: joystick has priority"),
    (of(source()), "velocity_mux has no source web: it runs with another robot.yaml"),
    (replace(of(source(name="web")), age_s=3.0), "not followed: velocity_mux: no message for 3 s"),
    (NOT_RECEIVED, "not followed: velocity_mux: no message yet"),
)


def test_a_robot_that_follows_nothing_says_why() -> None:
    assert still_sentence(WELL.driver) == ""
    latched = "latched: stop requested (by whom); ends with: reset"
    assert still_sentence(LastMessage(LATCHED, 0.1)) == f"the robot does not move: {latched}"
    assert still_sentence(LastMessage(LATCHED, 9.0)) == "the robot does not move: motor_driver: no message for 9 s"


@pytest.mark.parametrize(("last", "sentence"), HELD)
def test_a_page_that_holds_says_drives_only_while_the_mux_follows_it(last: LastMessage, sentence: str) -> None:
    assert held_sentence(last, "web") == sentence
