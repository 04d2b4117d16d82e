"""The VDA 5050 state: what is not known is never safe, each failure is an error, and the message fits the schema."""

from __future__ import annotations

import itertools
import json
import math
from typing import Any

import pytest
from canbase.msg import DriverStatus, ForeignPublisher, MuxLock, SafetyState, ScannerState
from jsonschema import Draft202012Validator

from canbase_driver.causes import DriverCause
from canbase_fleet.robot_view import RobotView
from canbase_fleet.safety_state import EStop, active_emergency_stop, driving, estop, field_violation
from canbase_fleet.vda5050 import V2, V3, essence, line, state
from canbase_fleet.vda_errors import MOST, errors
from canbase_runtime.driver_state import DriverState
from canbase_runtime.last_message import NOT_RECEIVED
from canbase_runtime.stop_cause import StopCause
from support.fleet_views import ROBOT, drive, driver, mux, safety, well
from support.vda5050_schema import OF_THE_CLIENT, schemas

NOW = "2026-11-25T04:05:06.78Z"
UNLATCHED = ROBOT.model_copy(
    update={
        "safety": ROBOT.safety.model_copy(update={"estop": ROBOT.safety.estop.model_copy(update={"latched": False})})
    }
)
BUTTON: dict[str, Any] = {"estop": True, "action": SafetyState.STOP, "cause": SafetyState.CAUSE_ESTOP}
WITHOUT_SCANNER: dict[str, Any] = {
    "clearance_ahead_m": math.nan,
    "clearance_behind_m": math.nan,
    "scanners": [ScannerState(topic="scan", age_s=math.nan, usable_share=math.nan)],
}


def types(view: RobotView) -> dict[str, str]:
    """Level by type."""
    return {error.type: error.level for error in errors(view, ROBOT)}


def test_a_robot_that_drives_has_no_error_and_no_stop() -> None:
    assert state(well(), ROBOT, NOW) == {
        "timestamp": NOW,
        "version": "2.1.0",
        "driving": True,
        "errors": [],
        "safetyState": {"eStop": "NONE", "fieldViolation": False},
    }


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"safety": safety(**BUTTON)}, EStop.MANUAL),
        ({"safety": safety(estop=True)}, EStop.MANUAL),  # released, and waits for its reset
        ({"driver": driver(state=DriverStatus.LATCHED, cause="stop requested")}, EStop.MANUAL),
        ({"driver": driver(watchdog="tripped")}, EStop.MANUAL),
        ({"driver": driver(watchdog="gone fishing")}, EStop.MANUAL),
        ({"safety": safety(cause="by magic")}, EStop.MANUAL),
        ({"driver": driver(watchdog="missing")}, EStop.AUTOACK),
        ({"safety": safety(action=SafetyState.STOP, cause=SafetyState.CAUSE_OBSTACLE)}, EStop.AUTOACK),
        ({"safety": safety(action=SafetyState.STOP, cause=SafetyState.CAUSE_SCAN_STALE)}, EStop.AUTOACK),
        ({"safety": safety(action=77)}, EStop.AUTOACK),
        ({"safety": safety(emergency=True)}, EStop.AUTOACK),
        ({"driver": driver(state=DriverStatus.STOPPING, cause="drive silent")}, EStop.AUTOACK),
        ({"driver": driver(state=DriverStatus.OFFLINE, cause="bus failed")}, EStop.AUTOACK),
        ({"driver": driver(state=99)}, EStop.AUTOACK),
        ({"safety": safety(action=SafetyState.SLOW, cause=SafetyState.CAUSE_OBSTACLE_NEAR)}, EStop.NONE),
        ({"driver": driver(state=DriverStatus.BOOTING, cause="booting")}, EStop.NONE),
    ],
)
def test_how_a_stop_is_acknowledged(changes: dict[str, Any], expected: EStop) -> None:
    assert estop(well(**changes), ROBOT) is expected


OBSTACLE: dict[str, Any] = {"action": SafetyState.STOP, "cause": SafetyState.CAUSE_OBSTACLE}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, EStop.NONE),
        ({"safety": safety(**OBSTACLE)}, EStop.NONE),
        ({"safety": safety(action=SafetyState.STOP, cause=SafetyState.CAUSE_SCAN_STALE)}, EStop.NONE),
        ({"safety": safety(**BUTTON)}, EStop.MANUAL),
        ({"safety": safety(**OBSTACLE, estop=True)}, EStop.MANUAL),
        ({"safety": safety(**OBSTACLE), "driver": driver(watchdog="missing")}, EStop.MANUAL),
        ({"safety": safety(**OBSTACLE), "driver": driver(state=DriverStatus.STOPPING)}, EStop.MANUAL),
        ({"safety": safety(**OBSTACLE), "driver": NOT_RECEIVED}, EStop.MANUAL),
        ({"safety": safety(action=SafetyState.STOP, cause="command_stale", clearance_behind_m=0.0)}, EStop.MANUAL),
        ({"safety": safety(action=SafetyState.STOP, cause="by magic")}, EStop.MANUAL),
    ],
)
def test_version_3_has_no_stop_that_ends_by_itself_but_that_of_the_protective_field(
    changes: dict[str, Any], expected: EStop
) -> None:
    """Without a button that latches, which is AUTOACK in 2.1.0."""
    view = well(**changes)
    assert active_emergency_stop(view, UNLATCHED) is expected
    stated = state(view, UNLATCHED, NOW, V3)
    assert (stated["version"], stated["safetyState"]["activeEmergencyStop"]) == ("3.0.0", expected.value)
    assert expected is EStop.MANUAL or estop(view, UNLATCHED) is EStop.NONE or field_violation(view, UNLATCHED)


def test_a_button_that_does_not_latch_is_acknowledged_by_itself() -> None:
    assert estop(well(safety=safety(**BUTTON)), UNLATCHED) is EStop.AUTOACK


def test_of_all_that_can_be_known_only_a_whole_and_well_robot_has_no_stop() -> None:
    """Every combination of driver, filter and mux that are well, latched, silent or never came: one is NONE."""
    drivers = [driver(), driver(1.6), NOT_RECEIVED, driver(watchdog="unknown"), driver(state=DriverStatus.LATCHED)]
    filters = [safety(), safety(1.6), NOT_RECEIVED, safety(**BUTTON), safety(cause="unknown")]
    muxes = [mux(), mux(1.6), NOT_RECEIVED]
    views = [RobotView(*parts) for parts in itertools.product(drivers, filters, muxes)]
    free = [view for view in views if estop(view, ROBOT) is EStop.NONE]
    assert [(view.driver, view.safety, view.mux) for view in free] == [(drivers[0], filters[0], muxes[0])]
    unsaid = [view for view in views if view not in free and all(e.level != "FATAL" for e in errors(view, ROBOT))]
    assert unsaid == []


@pytest.mark.parametrize("topic", ["driver", "safety", "mux"])
@pytest.mark.parametrize("age_s", [None, 1.51, 3600.0])
def test_a_topic_that_is_silent_is_an_error_and_a_stop_whatever_it_said_last(topic: str, age_s: float | None) -> None:
    last = {"driver": driver, "safety": safety, "mux": mux}[topic](age_s)
    view = well(**{topic: last})
    assert types(view)["state_unknown"] == "FATAL"
    assert estop(view, ROBOT) is EStop.MANUAL


def test_a_filter_that_is_silent_violates_the_field_and_a_driver_that_is_silent_drives() -> None:
    stands = driver(standstill=True)
    assert not driving(well(driver=stands))
    assert driving(well(driver=driver(1.6, standstill=True)))
    assert driving(RobotView())
    assert field_violation(well(safety=safety(1.6)), ROBOT)
    assert field_violation(RobotView(), ROBOT)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, False),
        ({"clearance_ahead_m": ROBOT.safety.stop_distance_m}, False),
        ({"clearance_ahead_m": 0.99 * ROBOT.safety.stop_distance_m}, True),
        ({"clearance_behind_m": 0.0}, True),  # also while it goes ahead, or nothing is ordered
        ({"clearance_ahead_m": math.nan}, True),
        ({"cause": "by magic"}, True),
        ({"scanners": [ScannerState(topic="scan", required=True, fresh=False, age_s=math.nan)]}, True),
        (WITHOUT_SCANNER, False),
        *(({"cause": cause.value}, True) for cause in StopCause if "scan" in cause.value),
        ({"cause": "obstacle"}, True),
        ({"cause": "obstacle_near"}, False),
        ({"cause": "estop"}, False),
    ],
)
def test_when_the_protective_field_is_violated(changes: dict[str, Any], expected: bool) -> None:
    assert field_violation(well(safety=safety(**changes)), ROBOT) is expected


def test_a_robot_without_a_scanner_says_that_it_has_no_protective_field() -> None:
    assert types(well(safety=safety(**WITHOUT_SCANNER))) == {"no_protective_field": "WARNING"}


@pytest.mark.parametrize(
    ("changes", "kind", "level"),
    [
        ({"driver": driver(state=DriverStatus.LATCHED, cause="drive fault")}, "driver_not_enabled", "FATAL"),
        ({"driver": driver(state=DriverStatus.BOOTING, cause="booting")}, "driver_not_enabled", "WARNING"),
        ({"driver": driver(state=DriverStatus.BOOTING, cause="drive missing")}, "driver_not_enabled", "FATAL"),
        ({"driver": driver(state=DriverStatus.DISARMED, cause="inactive")}, "driver_not_enabled", "FATAL"),
        ({"driver": driver(state=DriverStatus.OFFLINE, cause="booting")}, "driver_not_enabled", "FATAL"),
        ({"driver": driver(state=DriverStatus.DISARMED, cause="by magic")}, "driver_not_enabled", "FATAL"),
        ({"driver": driver(watchdog="missing")}, "watchdog", "FATAL"),
        ({"driver": driver(bus_problem="network is down")}, "can_bus", "FATAL"),
        ({"driver": driver(controller="error passive")}, "can_bus", "WARNING"),
        ({"driver": driver(drives=[drive()])}, "drive_unknown", "FATAL"),
        ({"driver": driver(drives=[drive(error_code=0x8611), drive("right_wheel")])}, "drive_fault", "FATAL"),
        ({"driver": driver(drives=[drive(boot_problem="x"), drive("right_wheel")])}, "drive_boot_failed", "FATAL"),
        ({"driver": driver(drives=[drive(health="hot"), drive("right_wheel")])}, "drive_health", "WARNING"),
        (
            {"driver": driver(drives=[drive(stops_by_itself=False), drive("right_wheel")])},
            "drive_not_guarded",
            "WARNING",
        ),
        ({"safety": safety(**BUTTON)}, "emergency_stop", "FATAL"),
        ({"safety": safety(action=SafetyState.STOP, cause="scan_frozen")}, "safety_filter", "FATAL"),
        ({"safety": safety(scanners=[ScannerState(topic="scan", required=True)])}, "scanner", "FATAL"),
        ({"safety": safety(scanners=[ScannerState(topic="scan", problem="no tf")])}, "scanner", "WARNING"),
        (
            {"mux": mux(foreign=[ForeignPublisher(topic="/t", node="/x", locks=True)])},
            "unexpected_publisher",
            "FATAL",
        ),
        ({"mux": mux(foreign=[ForeignPublisher(topic="/t", node="/x")])}, "unexpected_publisher", "WARNING"),
        ({"mux": mux(locks=[MuxLock(name="pause", holds=True)])}, "lock", "WARNING"),
    ],
)
def test_each_failure_is_an_error_with_its_level(changes: dict[str, Any], kind: str, level: str) -> None:
    assert types(well(**changes))[kind] == level


@pytest.mark.parametrize("cause", DriverCause)
@pytest.mark.parametrize("number", [number for number in DriverState if number is not DriverState.ENABLED])
def test_without_power_there_is_always_an_error(cause: DriverCause, number: DriverState) -> None:
    assert "driver_not_enabled" in types(well(driver=driver(state=int(number), cause=cause.value)))


def test_an_error_names_where_it_was_seen_and_what_ends_it() -> None:
    broken = drive(error_code=0x8611, error_text="following error")
    view = well(
        driver=driver(
            state=DriverStatus.LATCHED,
            cause="drive fault",
            detail="left_wheel is in fault",
            clears_on="reset",
            drives=[broken, drive("right_wheel")],
        )
    )
    stopped, fault = (error.as_json() for error in errors(view, ROBOT))
    assert stopped["errorDescription"] == "latched: drive fault, left_wheel is in fault"
    assert stopped["errorHint"] == "reset"
    assert fault["errorDescription"] == "error 8611h: following error"
    assert fault["errorReferences"] == [
        {"referenceKey": "joint", "referenceValue": "left_wheel"},
        {"referenceKey": "node", "referenceValue": "1"},
    ]


def test_a_message_has_a_bound_and_the_worst_comes_first() -> None:
    many = [ForeignPublisher(topic=f"t{i}", node="\n" * 9000, problem="x" * 9000) for i in range(500)]
    view = well(mux=mux(foreign=many), driver=NOT_RECEIVED)
    found = errors(view, ROBOT)
    assert len(found) == MOST
    assert found[0].type == "state_unknown"
    assert len(line(state(view, ROBOT, NOW))) < 100_000


def test_a_change_is_one_of_states_and_not_of_numbers() -> None:
    def seen(detail: str, **changes: Any) -> tuple[object, ...]:
        return essence(well(safety=safety(detail=detail, **BUTTON, **changes)), ROBOT)

    assert seen("pressed for 0.1 s") == seen("pressed for 0.2 s")
    assert seen("") != seen("", clearance_ahead_m=0.0)
    assert essence(well(driver=driver(standstill=True)), ROBOT) != essence(well(), ROBOT)
    stops = [
        well(safety=safety(action=SafetyState.STOP, cause=cause, clearance_ahead_m=0.0))
        for cause in (SafetyState.CAUSE_OBSTACLE, SafetyState.CAUSE_SHUTDOWN)
    ]
    assert {state(view, ROBOT, NOW, V2)["safetyState"]["eStop"] for view in stops} == {"AUTOACK"}
    assert essence(stops[0], ROBOT) != essence(stops[1], ROBOT), "activeEmergencyStop of 3.0.0 differs"


BAD_DRIVES = [drive("left_wheel\n", error_code=1, health="hot", boot_problem="x" * 9000)]
VIEWS = [
    well(),
    RobotView(),
    well(driver=driver(state=DriverStatus.LATCHED, cause="drive fault", clears_on="reset", drives=BAD_DRIVES)),
    well(safety=safety(**BUTTON), mux=mux(locks=[MuxLock(name="pause", holds=True)])),
]


@pytest.mark.parametrize(("version", "schema"), schemas())
@pytest.mark.parametrize("view", VIEWS)
def test_a_fleet_client_that_takes_the_keys_in_sends_a_valid_state(
    version: str, schema: dict[str, Any], view: RobotView
) -> None:
    message = OF_THE_CLIENT | json.loads(line(state(view, ROBOT, NOW, version)))
    other = OF_THE_CLIENT | json.loads(line(state(view, ROBOT, NOW, V2 if version == V3 else V3)))
    check = Draft202012Validator(schema, format_checker=Draft202012Validator.FORMAT_CHECKER)
    assert [error.message for error in check.iter_errors(message)] == []
    for wrong in (
        {"errors": [{"errorType": "x"}]},
        {"safetyState": {next(iter(message["safetyState"])): "MAYBE", "fieldViolation": True}},
        {"driving": None},
        {"timestamp": "yesterday"},
        {"safetyState": other["safetyState"]},
    ):
        assert not check.is_valid(message | wrong)
