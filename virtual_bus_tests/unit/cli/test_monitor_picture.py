"""The picture of `canbase monitor`: what an operator reads from a snapshot, and never from a silent one."""

from __future__ import annotations

import io
import math
from dataclasses import replace

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
    StopEvent,
)
from rich.console import Console

from canbase_cli.monitor_picture import GOOD, WARN, Snapshot, line, picture
from canbase_runtime.last_message import SILENT_S, LastMessage

MUX = MuxState(
    active="joystick",
    ready=True,
    sources=[
        MuxSource(
            name="joystick",
            priority=100,
            active=True,
            standing=MuxSource.FOLLOWED,
            armed=True,
            age_s=0.02,
            delay_s=0.01,
            timeout_s=0.3,
            refused=3,
        ),
        MuxSource(
            name="action",
            priority=40,
            age_s=math.nan,
            delay_s=math.nan,
            timeout_s=0.3,
            standing=MuxSource.NEVER_RECEIVED,
            reason="never received",
        ),
    ],
    locks=[MuxLock(name="pause", priority=99, required=True, age_s=0.61, timeout_s=0.5)],
)
SAFETY = SafetyState(
    action=SafetyState.SLOW,
    cause=SafetyState.CAUSE_OBSTACLE_NEAR,
    detail="0.40 m free ahead: at most 0.30 m/s",
    clears_on="more free way ahead",
    clearance_ahead_m=0.4,
    clearance_behind_m=math.inf,
    command_age_s=0.01,
    scan_age_s=math.nan,
    ordered_linear_mps=0.3,
    scanners=[
        ScannerState(topic="scan", required=True, fresh=True, age_s=0.05, usable_share=0.97),
        ScannerState(
            topic="scan_rear", required=True, age_s=0.9, usable_share=0.5, dropped=8, problem="it has no readings"
        ),
    ],
)
DRIVER = DriverStatus(
    state=DriverStatus.ENABLED,
    cause="none",
    watchdog="ok",
    watchdog_cause="none",
    drives=[
        DriveStatus(joint="left_wheel", node_id=1, nmt_state="operational", state="operation enabled",
                    target_radps=3.0, velocity_radps=2.98, heartbeat_age_s=0.05),
        DriveStatus(joint="right_wheel", node_id=2, nmt_state="operational", state="fault", error_code=0x8130,
                    error_text="heartbeat lost", heartbeat_age_s=math.nan),
    ],
)  # fmt: skip
ALL = Snapshot("/r1", mux=LastMessage(MUX, 0.1), safety=LastMessage(SAFETY, 0.1), driver=LastMessage(DRIVER, 0.1))


def drawn(snapshot: Snapshot) -> str:
    console = Console(file=io.StringIO(), width=140, force_terminal=False)
    console.print(picture(snapshot))
    output = console.file
    assert isinstance(output, io.StringIO)
    return " ".join(output.getvalue().split())


def test_everything_that_an_operator_needs_is_there() -> None:
    text = drawn(ALL)
    for words in (
        "canbase: /r1",
        "joystick drives | filter slows: obstacle_near | driver ENABLED | watchdog ok",
        "100 joystick 0.02 s 0.01 s 0.30 s 3 drives",
        "40 action – – 0.30 s 0 never received; needs a zero first",
        "99 lock pause 0.61 s 0.50 s free",
        "orders +0.30 m/s +0.00 rad/s free ahead 0.40 m, behind all",
        "scanner scan 0.05 s old, 97% of its beams usable",
        "scanner scan_rear 0.90 s old, 50% of its beams usable, 8 scans dropped: it has no readings",
        "0.40 m free ahead: at most 0.30 m/s; ends with: more free way ahead",
        "1 left_wheel operational operation enabled +3.00 rad/s +2.98 rad/s 0.05 s",
        "2 right_wheel operational fault +0.00 rad/s +0.00 rad/s – 8130h heartbeat lost",
        "MOVES",
    ):
        assert words in text


def test_a_held_stick_that_is_not_followed_is_told_in_the_headline_and_with_its_reason() -> None:
    reason = "waiting for zero (motor_driver is LATCHED)"
    joystick = MuxSource(name="joystick", active=True, standing=MuxSource.UNARMED, delay_s=math.nan, reason=reason)
    mux = MuxState(active="joystick", not_ready="motor_driver is LATCHED", sources=[joystick])
    snapshot = replace(ALL, mux=LastMessage(mux, 0.1))
    assert line(snapshot).startswith("joystick is not followed: waiting for zero (motor_driver is LATCHED)  |")
    assert reason in drawn(snapshot)
    assert "The base cannot move: motor_driver is LATCHED" in drawn(snapshot)


@pytest.mark.parametrize(
    ("state", "style"),
    [("operation enabled", GOOD), ("fault", WARN), ("unknown", WARN), ("Operation enabled", WARN), ("", WARN)],
)
def test_a_drive_is_good_in_one_known_state_alone(state: str, style: str) -> None:
    """A word that CiA 402 does not have is no state at all."""
    drives = [DriveStatus(joint="left_wheel", state=state)]
    console = Console(file=io.StringIO(), width=140, force_terminal=True, color_system="standard")
    status = DriverStatus(state=DriverStatus.LATCHED, cause="x", watchdog="gone", drives=drives)
    segments = console.render(picture(replace(ALL, driver=LastMessage(status, 0.1))))
    found = [segment.style for segment in segments if state and segment.text.strip() == state]
    assert all(each == console.get_style(style) for each in found)
    assert bool(found) is bool(state)


def test_a_silent_node_is_told_as_silent_and_nothing_that_it_said_is_shown() -> None:
    text = drawn(replace(ALL, driver=LastMessage(DRIVER, 4.2)))
    assert "motor_driver: no message for 4 s" in text
    assert "left_wheel" not in text
    assert "ENABLED" not in text
    assert "joystick drives" in text


def test_silence_begins_right_after_its_limit() -> None:
    assert "ENABLED" in drawn(replace(ALL, driver=LastMessage(DRIVER, SILENT_S)))
    assert "ENABLED" not in drawn(replace(ALL, driver=LastMessage(DRIVER, math.nextafter(SILENT_S, math.inf))))


def test_before_anything_was_heard_nothing_is_claimed() -> None:
    text = drawn(Snapshot("/"))
    assert "velocity_mux: no message yet | safety_filter: no message yet | motor_driver: no message yet" in text
    assert "No stop since this picture was opened." in text


def test_a_trip_a_latched_stop_and_undelivered_leases_are_told() -> None:
    driver = DriverStatus(state=DriverStatus.LATCHED, cause="watchdog", detail="the watchdog tripped", standstill=True,
                          clears_on="reset", watchdog="tripped", watchdog_cause="overspeed")  # fmt: skip
    event = StopEvent(stopped_by="watchdog", cause="overspeed", detail="2.0 m/s measured", latched=True)
    safety = SafetyState(action=SafetyState.STOP, cause="estop", lease_errors=7)
    text = drawn(
        Snapshot("/", safety=LastMessage(safety, 0.0), driver=LastMessage(driver, 0.0), event=LastMessage(event, 12.0))
    )
    for words in (
        "filter STOPS: estop | driver LATCHED: watchdog | watchdog tripped",
        "the watchdog tripped; ends with: reset",
        "watchdog: overspeed",
        "7 leases were not delivered",
        "Last stop, 12 s ago: watchdog: overspeed, latched. 2.0 m/s measured",
    ):
        assert words in text


def test_text_from_the_bus_is_shown_as_it_is_and_never_as_markup() -> None:
    drive = DriveStatus(joint="left_wheel", state="fault", error_code=1, error_text="[red]x[/red]")
    driver = DriverStatus(state=DriverStatus.LATCHED, detail="[/bold]", drives=[drive])
    text = drawn(Snapshot("/", driver=LastMessage(driver, 0.0)))
    assert "[red]x[/red]" in text
    assert "[/bold]" in text


def test_the_line_changes_with_states_and_not_with_ages_and_speeds() -> None:
    faster = DriverStatus(state=DRIVER.state, cause="none", watchdog="ok", drives=[
        DriveStatus(joint="left_wheel", state="operation enabled", velocity_radps=9.0),
        DriveStatus(joint="right_wheel", state="fault"),
    ])  # fmt: skip
    assert line(ALL) == line(replace(ALL, driver=LastMessage(faster, 0.3)))
    assert line(ALL) == (
        "joystick drives  |  filter slows: obstacle_near  |  driver ENABLED  |  watchdog ok"
        "  |  left_wheel operation enabled  |  right_wheel fault"
    )


def test_the_line_tells_locks_and_foreign_publishers() -> None:
    lock = MuxLock(
        name="pause", holds=True, standing=MuxLock.SILENT, reason="has published nothing for 0.61 s (timeout 0.50 s)"
    )
    foreign = ForeignPublisher(topic="/cmd_vel", node="/evil", problem="only /safety_filter should")
    mux = MuxState(locks=[lock], foreign=[foreign])
    text = line(Snapshot("/", mux=LastMessage(mux, 0.0)))
    assert "lock pause silent  |  foreign publisher /evil on /cmd_vel: only /safety_filter should" in text
    assert "/evil publishes on /cmd_vel: only /safety_filter should" in drawn(Snapshot("/", mux=LastMessage(mux, 0.0)))
