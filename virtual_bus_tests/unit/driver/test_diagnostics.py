"""What /diagnostics says in words: levels, sentences and values."""

import dataclasses
import math
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from canbase_config.health import Health
from canbase_driver.causes import DriverCause, Finding
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia402 import DriveState
from canbase_driver.drives.drive_values import NamedValue
from canbase_driver.drives.health import HealthWatch
from canbase_driver.ros.diagnostics import diagnostics_message, unguarded, values_message
from canbase_driver.supervision.bus_health import ControllerState
from canbase_driver.supervision.watchdog_link import WatchdogCounters
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView
from support.snapshots import SNAPSHOT, with_driver, with_left

STAMP = Time(sec=1_700_000_000, nanosec=250_000_000)
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def entry(message: DiagnosticArray, name: str) -> DiagnosticStatus:
    """The only diagnostic entry with this name."""
    (found,) = (status for status in message.status if status.name == name)
    return found


def test_a_healthy_robot_is_ok_in_every_entry() -> None:
    message = diagnostics_message(SNAPSHOT, STAMP, robot="r1")
    assert message.header.stamp == STAMP
    assert [(status.name, status.level) for status in message.status] == [
        ("r1: motor_driver", OK),
        ("r1: bus", OK),
        ("r1: watchdog", OK),
        ("r1: drive left_wheel_joint", OK),
        ("r1: drive right_wheel_joint", OK),
    ]
    assert [status.message for status in message.status] == [
        "All drives are enabled.",
        "The bus works.",
        "The watchdog watches.",
        "Operation enabled, operational.",
        "Operation enabled, operational.",
    ]
    assert entry(message, "r1: drive right_wheel_joint").hardware_id == "r1 node 2 axis 1"


def test_named_values_are_in_the_entry_of_their_drive_and_in_a_message_of_their_own() -> None:
    values = (NamedValue("dc_link", "V", 24.05, 1.0), NamedValue("last_error", "", math.nan, -math.inf))
    snapshot = with_left(values=values)
    message = values_message(snapshot, STAMP, "r1")
    (own,) = message.status
    assert (message.header.stamp, own.name) == (STAMP, "r1: drive left_wheel_joint")
    assert [(each.key, each.value) for each in own.values] == [("dc_link [V]", "24.05"), ("last_error", "nan")]
    assert own.level == DiagnosticStatus.STALE
    shown = entry(diagnostics_message(snapshot, STAMP, robot="r1"), "r1: drive left_wheel_joint")
    assert ("dc_link [V]", "24.05") in [(each.key, each.value) for each in shown.values]
    assert shown.level == OK


def test_a_standstill_that_no_sensor_has_shown_is_named_as_assumed() -> None:
    why = "left_wheel showed no motion; its power has been off for 10 s, so standstill is assumed"
    for told, snapshot in ((why, with_driver(standstill=True, standstill_assumed=why)), ("", SNAPSHOT)):
        driver = entry(diagnostics_message(snapshot, STAMP), "robot: motor_driver")
        assert {pair.key: pair.value for pair in driver.values}["standstill assumed, not measured"] == told


def test_the_values_are_short_and_have_their_units() -> None:
    left = with_left(
        feedback_age_s=math.nan,
        error_code=0x8611,
        self_stop="heartbeat of the watchdog (1016h, 6007h)",
        internal_limit=True,
        voltage_v=48.1,
        boot_changes=("6085h:0: 0000000Ah → 00000B31h",),
    )
    message = diagnostics_message(left, STAMP)
    drive = {pair.key: pair.value for pair in entry(message, "robot: drive left_wheel_joint").values}
    assert drive == {
        "node": "1",
        "axis": "0",
        "NMT state": "operational",
        "CiA 402 state": "operation enabled",
        "statusword": "0637h",
        "error code": "8611h",
        "target [rad/s]": "5",
        "velocity [rad/s]": "4.9",
        "position [rad]": "123.5",
        "last status TPDO": "never received",
        "last heartbeat": "received 0.050 s ago",
        "stops by itself": "heartbeat of the watchdog (1016h, 6007h)",
        "warning (bit 7)": "False",
        "internal limit (bit 11)": "True",
        "voltage [V]": "48.1",
        "lacking or refused": "nothing",
        "changed by the boot": "6085h:0: 0000000Ah → 00000B31h",
        "last boot": "well",
    }
    loop = {pair.key: pair.value for pair in entry(message, "robot: motor_driver").values}
    assert loop["cycles"] == "12345"
    assert loop["greatest lateness [s]"] == "0.0004"
    bus = {pair.key: pair.value for pair in entry(message, "robot: bus").values}
    assert (bus["send errors"], bus["controller"]) == ("4", "error active")


@pytest.mark.parametrize(
    ("state", "level"),
    [
        (DriverState.OFFLINE, ERROR),
        (DriverState.BOOTING, WARN),
        (DriverState.DISARMED, WARN),
        (DriverState.ENABLING, WARN),
        (DriverState.ENABLED, OK),
        (DriverState.STOPPING, WARN),
        (DriverState.LATCHED, ERROR),
    ],
)
def test_the_level_of_the_driver_follows_its_state(state: DriverState, level: bytes) -> None:
    message = diagnostics_message(with_driver(state=state, finding={"cause": DriverCause.BOOTING}), STAMP)
    assert entry(message, "robot: motor_driver").level == level


def test_a_drive_that_is_missing_is_an_error() -> None:
    message = diagnostics_message(
        with_driver(state=DriverState.BOOTING, finding={"cause": DriverCause.DRIVE_MISSING}), STAMP
    )
    assert entry(message, "robot: motor_driver").level == ERROR


@pytest.mark.parametrize(
    ("detail", "clears_on", "sentence"),
    [
        ("left is in fault", "reset", "Latched (drive fault): left is in fault. It ends with: reset."),
        ("left is in fault.", "", "Latched (drive fault): left is in fault."),
        ("", "reset", "Latched (drive fault). It ends with: reset."),
    ],
)
def test_a_stopped_driver_says_why_and_what_ends_it(detail: str, clears_on: str, sentence: str) -> None:
    snapshot = with_driver(state=DriverState.LATCHED, finding=Finding(DriverCause.DRIVE_FAULT, detail, clears_on))
    assert entry(diagnostics_message(snapshot, STAMP), "robot: motor_driver").message == sentence


@pytest.mark.parametrize(
    ("name", "changes", "sentence"),
    [
        ("motor_driver", {"cycle": {"overruns": 5}}, "All drives are enabled. Since the last report: 3 more overruns."),
        (
            "bus",
            {"bus": {"send_errors": 5, "error_frames": 7}},
            "The bus works. Since the last report: 1 more send errors, 7 more error frames.",
        ),
        (
            "watchdog",
            {"watchdog": {"counters": WatchdogCounters(leases_refused=2)}},
            "The watchdog watches. Since the last report: 2 more leases refused.",
        ),
    ],
)
def test_a_counter_is_a_warning_only_while_it_grows(name: str, changes: dict[str, Any], sentence: str) -> None:
    grown = with_driver(**changes)
    told = entry(diagnostics_message(grown, STAMP, previous=SNAPSHOT), f"robot: {name}")
    assert (told.level, told.message) == (WARN, sentence)
    later = diagnostics_message(grown, STAMP, previous=grown)
    assert entry(later, f"robot: {name}").level == OK


def test_a_watchdog_that_was_restarted_counts_from_zero_and_that_is_no_news() -> None:
    before = with_driver(watchdog={"counters": WatchdogCounters(trips=3)})
    assert entry(diagnostics_message(SNAPSHOT, STAMP, previous=before), "robot: watchdog").level == OK


def test_a_growing_counter_does_not_make_an_error_a_warning() -> None:
    snapshot = with_driver(bus={"problem": "network is down", "send_errors": 5})
    message = diagnostics_message(snapshot, STAMP, previous=SNAPSHOT)
    assert entry(message, "robot: bus").level == ERROR


@pytest.mark.parametrize(
    ("changes", "level", "sentence"),
    [
        ({"bus": {"problem": "network is down."}}, ERROR, "The bus has failed: network is down."),
        (
            {"bus": {"controller": ControllerState.ERROR_PASSIVE}},
            WARN,
            "The CAN controller is error passive: check the cable.",
        ),
    ],
)
def test_what_the_bus_says(changes: dict[str, Any], level: bytes, sentence: str) -> None:
    bus = entry(diagnostics_message(with_driver(**changes), STAMP), "robot: bus")
    assert (bus.level, bus.message) == (level, sentence)


@pytest.mark.parametrize(("load", "level"), [(math.nan, OK), (0.6, OK), (0.61, WARN)])
def test_a_bus_that_is_nearly_full_is_a_warning(load: float, level: bytes) -> None:
    bus = entry(diagnostics_message(SNAPSHOT, STAMP, bus_load=load), "robot: bus")
    assert bus.level == level
    assert {pair.key: pair.value for pair in bus.values}["load [%]"] == f"{100.0 * load:g}"
    without_wire = diagnostics_message(SNAPSHOT, STAMP, bus_load=load, busy_above=math.inf)
    assert entry(without_wire, "robot: bus").level == OK


def test_a_drive_has_the_hardware_id_of_its_joint_and_else_its_place() -> None:
    message = diagnostics_message(
        SNAPSHOT, STAMP, hardware_ids={"left_wheel_joint": "000002E1:00001001:0000BEEF axis 0"}
    )
    left, right = (entry(message, f"robot: drive {side}_wheel_joint") for side in ("left", "right"))
    assert (left.hardware_id, right.hardware_id) == ("000002E1:00001001:0000BEEF axis 0", "robot node 2 axis 1")


@pytest.mark.parametrize(("pause_s", "level"), [(0.05, OK), (0.051, WARN)])
def test_a_watchdog_whose_loop_pauses_is_a_warning(pause_s: float, level: bytes) -> None:
    message = diagnostics_message(
        with_driver(watchdog={"counters": WatchdogCounters(pause_max_ms=round(1000 * pause_s))}), STAMP
    )
    assert entry(message, "robot: watchdog").level == level


@pytest.mark.parametrize(
    ("rung", "text"), [(0, "none"), (2, "NMT pre-operational"), (4, "heartbeat withheld"), (9, "9")]
)
def test_how_far_the_watchdog_has_gone_is_told(rung: int, text: str) -> None:
    watchdog = entry(diagnostics_message(with_driver(watchdog={"rung": rung}), STAMP), "robot: watchdog")
    assert {pair.key: pair.value for pair in watchdog.values}["rung of its ladder"] == text


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"view": WatchdogView.MISSING, "age_s": 0.25},
            "The watchdog is missing: its state frame was received 0.250 s ago. "
            "Is its process running, and on this bus?",
        ),
        (
            {"view": WatchdogView.MISSING, "age_s": math.nan},
            "The watchdog is missing: its state frame was never received. Is its process running, and on this bus?",
        ),
        (
            {"view": WatchdogView.TRIPPED, "cause": "lease lost"},
            "The watchdog has tripped: lease lost. Remove the cause, then reset.",
        ),
    ],
)
def test_a_watchdog_that_does_not_watch_is_an_error(changes: dict[str, Any], sentence: str) -> None:
    watchdog = entry(diagnostics_message(with_driver(watchdog=changes), STAMP), "robot: watchdog")
    assert (watchdog.level, watchdog.message) == (ERROR, sentence)


@pytest.mark.parametrize(
    ("changes", "level", "sentence"),
    [
        (
            {"state": DriveState.FAULT, "error_code": 0x8611, "error_text": "following error"},
            ERROR,
            "Error 8611h: following error.",
        ),
        ({"state": DriveState.FAULT_REACTION_ACTIVE}, ERROR, "Error 0000h: fault reaction active."),
        ({"error_code": 0x3210, "error_text": ""}, ERROR, "Error 3210h: operation enabled."),
        ({"feedback_age_s": math.nan}, ERROR, "No feedback yet; its heartbeat was received 0.050 s ago."),
        (
            {"stops_by_itself": False},
            WARN,
            "Operation enabled, but it would not stop by itself without us (1016h).",
        ),
        ({"state": DriveState.SWITCH_ON_DISABLED}, OK, "Switch on disabled, operational."),
    ],
)
def test_what_a_drive_says(changes: dict[str, Any], level: bytes, sentence: str) -> None:
    message = diagnostics_message(with_left(**changes), STAMP)
    drive = entry(message, "robot: drive left_wheel_joint")
    assert (drive.level, drive.message) == (level, sentence)
    assert entry(message, "robot: drive right_wheel_joint").level == OK


def test_a_warning_of_the_drive_is_no_fault_and_an_internal_limit_not_even_a_warning() -> None:
    warned = entry(diagnostics_message(with_left(warning=True), STAMP), "robot: drive left_wheel_joint")
    assert warned.level == WARN
    assert warned.message == "Operation enabled, but it warns of something (statusword bit 7)."
    limited = entry(diagnostics_message(with_left(internal_limit=True), STAMP), "robot: drive left_wheel_joint")
    assert limited.level == OK


def test_a_drive_that_will_not_stop_by_itself_is_told_once_it_is_booted() -> None:
    assert unguarded(SNAPSHOT) == ()
    left = with_left(stops_by_itself=False, boot_notes=("1016h: the drive watches no heartbeat",))
    assert unguarded(left) == (
        "left_wheel_joint (node 1) WILL NOT STOP BY ITSELF when this computer or the cable fails "
        "(1016h: the drive watches no heartbeat): only STO stops it then",
    )
    assert "1016h, 6007h not set" in unguarded(with_left(stops_by_itself=False))[0]


@pytest.mark.parametrize("state", [DriverState.OFFLINE, DriverState.BOOTING])
def test_before_that_nobody_knows(state: DriverState) -> None:
    assert unguarded(dataclasses.replace(with_left(stops_by_itself=False), state=state)) == ()
    assert unguarded(with_left(stops_by_itself=False, nmt_state=NmtState.PRE_OPERATIONAL)) == ()


def test_a_value_beyond_a_limit_of_health_is_a_warning_of_its_drive_alone() -> None:
    hot = with_left(temperature_c=91.0)
    warnings = HealthWatch(Health(temperature_high_c=80.0)).check_drives(hot.drives, 0.0)
    message = diagnostics_message(hot, STAMP, warnings=warnings)
    left, right = (entry(message, f"robot: drive {side}_wheel_joint") for side in ("left", "right"))
    assert (left.level, right.level) == (WARN, OK)
    assert left.message.endswith("temperature 91 °C is above health.temperature_high_c (80 °C).")
    faulty = diagnostics_message(with_left(temperature_c=91.0, error_code=0x4310), STAMP, warnings=warnings)
    assert entry(faulty, "robot: drive left_wheel_joint").level == ERROR
