"""`canbase doctor`, from what was heard to its rows: one robot that is well, and one change after another to it."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from canbase.msg import (
    DriverStatus,
    DriveStatus,
    ForeignPublisher,
    MuxLock,
    MuxSource,
    MuxState,
    SafetyState,
    ScannerState,
)
from rich.console import Console

from canbase_config.load import load_robot, sample
from canbase_doctor.check import Verdict, exit_code, first_failure, table
from canbase_doctor.default_checks import default_checks
from canbase_doctor.evidence import Evidence, Heard
from canbase_driver.causes import DriverCause
from canbase_driver.supervision.hazards import HAZARDS

Change = Callable[[Any], None]

STALL = next(hazard for hazard in HAZARDS if hazard.cause is DriverCause.STALLED)


def healthy() -> dict[str, Any]:
    """The last message of each topic of a robot that is well and stands."""
    drives = [
        DriveStatus(joint=joint, node_id=node, nmt_state="operational", state="operation enabled", stops_by_itself=True)
        for node, joint in enumerate(("left_wheel", "right_wheel"), 1)
    ]
    return {
        "motor_driver/status": DriverStatus(
            state=DriverStatus.ENABLED, cause="none", watchdog="ok", watchdog_cause="none", standstill=True,
            command_age_s=0.01, command_fresh=True, drives=drives, watchdog_age_s=0.02, watchdog_lease_age_s=0.01,
            watchdog_pause_max_s=0.005,
        ),
        "safety_filter/state": SafetyState(cause="none", lease_sequence=100),
        "velocity_mux/state": MuxState(sources=[MuxSource(name="joystick"), MuxSource(name="action")]),
    }  # fmt: skip


def evidence(now_s: dict[str, Any], before: dict[str, Any] | None = None) -> Evidence:
    """A robot that said `before` first and `now_s` last; a topic whose message is None is silent."""
    first = healthy() if before is None else before
    heard = {
        topic: Heard((first[topic], message), (1.0, 2.0)) for topic, message in now_s.items() if message is not None
    }
    return Evidence(load_robot(sample("bench")).robot, "bench.yaml", 3.0, heard=heard)


def changed(topic: str, **values: Any) -> Evidence:
    """A healthy robot but for these fields."""
    now_s = healthy()
    for name, value in values.items():
        setattr(now_s[topic], name, value)
    return evidence(now_s)


@pytest.mark.parametrize(("age_s", "found"), [(1.5, False), (1.6, True), (18.0, True)])
@pytest.mark.parametrize("topic", ["motor_driver/status", "safety_filter/state", "velocity_mux/state"])
def test_a_sample_that_is_old_is_not_taken_for_what_is(topic: str, age_s: float, found: bool) -> None:
    """A latched topic gives the last words of a node that hangs to whoever asks."""
    seen = evidence(healthy())
    heard = {**seen.heard, topic: Heard(seen.on(topic).messages, (0.0, seen.now_s - age_s))}
    checks = default_checks(replace(seen, heard=heard))
    assert any(f"nothing on {topic} for {age_s:.1f} s" in check.found for check in checks) is found
    assert (exit_code(checks) != 0) is found


@pytest.mark.parametrize(("standing", "reason", "advice"), [
    (MuxSource.UNARMED, "waiting for zero (motor_driver is LATCHED)", "release the joystick"),
    (MuxSource.UNARMED, "2 publishers on cmd_vel_joy (joy, other): give each a topic", "release the joystick"),
    (MuxSource.DELAYED, "delayed by 1.20 s (limit 0.30 s)", "look at the network"),
    (MuxSource.UNKNOWN, "a reason of another version", "look at the log of velocity_mux"),
    (99, "a reason of a later version", "look at the log of velocity_mux"),
])  # fmt: skip
def test_a_source_that_is_not_followed_is_named_with_what_to_do(standing: int, reason: str, advice: str) -> None:
    """What to do goes by the standing that the mux has decided: the sentence and the ages may be any."""
    source = MuxSource(name="joystick", active=True, standing=standing, timeout_s=0.3, reason=reason)
    failed = first_failure(default_checks(changed("velocity_mux/state", active="joystick", sources=[source])))
    assert failed is not None
    assert failed.found == f"joystick is not followed: {reason}"
    assert failed.advice.startswith(advice)


def drive_changed(**values: Any) -> Evidence:
    now_s = healthy()
    for name, value in values.items():
        setattr(now_s["motor_driver/status"].drives[1], name, value)
    return evidence(now_s)


def not_ok(seen: Evidence) -> list[tuple[str, Verdict]]:
    return [(check.name, check.verdict) for check in default_checks(seen) if check.verdict is not Verdict.OK]


def test_a_robot_that_is_well_has_nothing_but_good_rows_and_exit_code_0() -> None:
    checks = default_checks(evidence(healthy()))
    assert {check.verdict for check in checks} == {Verdict.OK}
    assert [check.advice for check in checks] == [""] * 9
    assert exit_code(checks) == 0


@pytest.mark.parametrize(
    ("seen", "row", "verdict", "told"),
    [
        (changed("motor_driver/status", state=DriverStatus.LATCHED, clears_on="bye"), "motor_driver", "FAIL", "bye"),
        (changed("motor_driver/status", state=DriverStatus.DISARMED, detail="sim"), "motor_driver", "FAIL", "sim"),
        (
            changed("motor_driver/status", state=DriverStatus.LATCHED, cause="stalled", clears_on=STALL.clears_on),
            "motor_driver",
            "FAIL",
            "it ends with: reset, with the wheel free to turn",
        ),
        (changed("motor_driver/status", state=DriverStatus.OFFLINE), "motor_driver", "FAIL", "offline"),
        (changed("motor_driver/status", state=DriverStatus.BOOTING), "motor_driver", "warn", "booting"),
        (changed("motor_driver/status", state=200), "motor_driver", "FAIL", "offline"),
        (changed("motor_driver/status", watchdog="OK"), "watchdog", "FAIL", "unknown: none"),
        (changed("motor_driver/status", watchdog="missing"), "watchdog", "FAIL", "start canbase serve watchdog"),
        (changed("motor_driver/status", watchdog="tripped", watchdog_rung=3), "watchdog", "FAIL", "disable voltage"),
        (changed("motor_driver/status", watchdog="tripped", watchdog_rung=9), "watchdog", "FAIL", "reset node"),
        (changed("motor_driver/status", watchdog_trips=2), "watchdog's counters", "warn", "trips grew"),
        (changed("motor_driver/status", watchdog_leases_refused=2), "watchdog's counters", "warn", "leases_refused 2"),
        (changed("motor_driver/status", watchdog_pause_max_s=0.051), "watchdog's counters", "warn", "51 ms"),
        (changed("motor_driver/status", watchdog="tripped", watchdog_cause="lease"), "watchdog", "FAIL", "lease"),
        (changed("motor_driver/status", overruns=1), "its counters", "warn", "overruns grew"),
        (changed("safety_filter/state", action=SafetyState.STOP, cause="estop"), "safety_filter", "FAIL", "estop"),
        (changed("safety_filter/state", action=SafetyState.SLOW, detail="0.4 m"), "safety_filter", "warn", "0.4 m"),
        (changed("safety_filter/state", lease_errors=1), "safety_filter", "FAIL", "lease.socket"),
        (drive_changed(error_code=0x2310, state="fault"), "drive right_wheel (node 2)", "FAIL", "0x2310"),
        (drive_changed(stops_by_itself=False), "drive right_wheel (node 2)", "warn", "will not stop"),
        (
            drive_changed(feedback_age_s=math.nan, heartbeat_age_s=math.nan),
            "drive right_wheel (node 2)", "FAIL", "termination",
        ),
        (
            changed("velocity_mux/state", sources=[MuxSource(name="joystick", refused=3)]),
            "velocity_mux", "warn", "joystick",
        ),
        (
            changed("velocity_mux/state", foreign=[ForeignPublisher(
                topic="/cmd_vel_joy", node="/push", problem="of type geometry_msgs/msg/Twist, which is not received")]),
            "publisher on /cmd_vel_joy", "warn", "/push: of type geometry_msgs/msg/Twist, which is not received end",
        ),
    ],
)  # fmt: skip
def test_each_thing_that_is_wrong_is_one_row_that_says_what_to_do(
    seen: Evidence, row: str, verdict: str, told: str
) -> None:
    assert not_ok(seen) == [(row, Verdict(verdict))]
    check = next(check for check in default_checks(seen) if check.name == row)
    assert told in f"{check.found} {check.advice}"
    assert check.advice


def test_a_counter_that_grew_before_doctor_came_is_no_warning() -> None:
    then, now_s = healthy(), healthy()
    then["motor_driver/status"].overruns = now_s["motor_driver/status"].overruns = 7
    assert not_ok(evidence(now_s, then)) == []


@pytest.mark.parametrize(
    ("topic", "rows"),
    [
        ("motor_driver/status", ["watchdog", "motor_driver"]),
        ("safety_filter/state", ["safety_filter"]),
        ("velocity_mux/state", ["velocity_mux"]),
    ],
)
def test_a_silent_part_fails_and_the_exit_code_is_1(topic: str, rows: list[str]) -> None:
    checks = default_checks(evidence(healthy() | {topic: None}))
    assert [check.name for check in checks if check.verdict is Verdict.FAIL] == rows
    assert exit_code(checks) == 1
    failed = first_failure(checks)
    assert failed is not None
    assert failed.name == rows[0]


def test_the_table_shows_what_was_found_and_what_to_do() -> None:
    told = io.StringIO()
    seen = changed("motor_driver/status", state=DriverStatus.LATCHED, detail="stop asked for", clears_on="reset")
    Console(file=told, width=120).print(table("bench at /", default_checks(seen)))
    for text in ("bench at /", "motor_driver", "FAIL", "stop asked for", "→ it ends with: reset"):
        assert text in told.getvalue()


SOUND = {"topic": "scan", "required": True, "fresh": True, "age_s": 0.05, "usable_share": 0.98}


@pytest.mark.parametrize(
    ("changes", "dropped_before", "verdict", "told"),
    [
        ({}, 0, Verdict.OK, "last usable scan 0.05 s old, 98% of its beams are usable"),
        ({"dropped": 7}, 7, Verdict.OK, "98%"),
        ({"dropped": 7}, 2, Verdict.WARN, "5 scans dropped"),
        ({"usable_share": 0.3}, 0, Verdict.WARN, "30% of its beams"),
        ({"fresh": False, "dropped": 7, "problem": "angle_increment is 0"}, 2, Verdict.FAIL, "angle_increment is 0"),
        ({"fresh": False, "age_s": math.nan, "usable_share": math.nan}, 0, Verdict.FAIL, "no usable scan yet"),
        ({"fresh": False, "required": False, "age_s": math.nan, "usable_share": math.nan}, 0, Verdict.OK, "required"),
    ],
)
def test_each_scanner_has_its_row(changes: dict[str, Any], dropped_before: int, verdict: Verdict, told: str) -> None:
    now_s, before = healthy(), healthy()
    now_s["safety_filter/state"].scanners = [ScannerState(**{**SOUND, **changes})]
    before["safety_filter/state"].scanners = [ScannerState(**{**SOUND, "dropped": dropped_before})]
    (row,) = [check for check in default_checks(evidence(now_s, before)) if check.name == "scanner scan"]
    assert row.verdict is verdict
    assert told in row.found


def test_a_drive_that_stopped_because_the_watchdog_withholds_its_heartbeat_is_well() -> None:
    seen = drive_changed(error_code=0x8130, state="switch on disabled")
    assert not_ok(seen) == [("drive right_wheel (node 2)", Verdict.FAIL)]
    seen.on("motor_driver/status").last.watchdog_rung = 4
    assert not_ok(seen) == [("drive right_wheel (node 2)", Verdict.WARN)]
    seen.on("motor_driver/status").last.drives[1].error_code = 0x2310
    assert not_ok(seen) == [("drive right_wheel (node 2)", Verdict.FAIL)]


def test_an_emergency_message_of_a_drive_that_drives_on_is_no_failure() -> None:
    assert not_ok(drive_changed(error_code=0xFF01)) == [("drive right_wheel (node 2)", Verdict.WARN)]
    assert not_ok(drive_changed(error_code=0xFF01, state="fault")) == [("drive right_wheel (node 2)", Verdict.FAIL)]


def test_why_a_drive_does_not_boot_is_in_its_row() -> None:
    failed = first_failure(default_checks(drive_changed(boot_problem="set `layout.velocity_bits: 16`")))
    assert failed is not None
    assert failed.found.endswith("set `layout.velocity_bits: 16`")


@pytest.mark.parametrize(("heartbeat_s", "told"), [(12.0, "no frame received"), (0.1, "it is not booted yet")])
def test_a_drive_without_feedback_is_not_said_to_run_on(heartbeat_s: float, told: str) -> None:
    seen = drive_changed(feedback_age_s=math.nan, heartbeat_age_s=heartbeat_s, stops_by_itself=False)
    [check] = [check for check in default_checks(seen) if check.verdict is not Verdict.OK]
    assert told in check.found
    assert "will not stop" not in check.advice


def test_a_lock_that_holds_the_base_is_named() -> None:
    held = MuxLock(name="gate", holds=True, reason="2 publishers on gate")
    seen = changed("velocity_mux/state", locks=[held])
    assert not_ok(seen) == [("velocity_mux", Verdict.WARN)]
    assert not_ok(changed("velocity_mux/state", locks=[held], active="joystick")) == []
    assert not_ok(changed("velocity_mux/state", locks=[MuxLock(name="gate")])) == []
