"""What canbase metrics exposes: names and units by OpenMetrics, every field, and nothing that is not known."""

from __future__ import annotations

import math

import pytest
from canbase.msg import DriverStatus, ForeignPublisher, MuxState, SafetyState
from prometheus_client.metrics_core import Metric
from prometheus_client.openmetrics.parser import text_string_to_metric_families
from prometheus_client.parser import text_string_to_metric_families as plain_families

from canbase_driver.causes import DriverCause
from canbase_fleet.exposition import Exposition
from canbase_fleet.robot_view import MOST_STOPS, OTHER, RobotView, counted
from canbase_runtime.driver_state import DriverState
from support.fleet_views import ROBOT, drive, driver, mux, safety, well

UNITS = {
    "seconds", "ratio", "volts", "amperes", "celsius", "meters", "meters_per_second", "radians_per_second",
}  # fmt: skip
OWN = {"canbase", "canbase_data_age_seconds", "canbase_stops", "canbase_messages_dropped"}


def families(view: RobotView) -> dict[str, Metric]:
    """As prometheus_client's own parser of OpenMetrics reads them, which is strict."""
    text, content_type = Exposition(view, ROBOT, "1.2.3").text(plain=False)
    assert content_type.startswith("application/openmetrics-text; version=1.0.0")
    return {family.name: family for family in text_string_to_metric_families(text.decode())}


def values(view: RobotView, name: str) -> dict[tuple[str, ...], float]:
    """The samples of one family, by the values of their labels."""
    family = families(view).get(name)
    return {} if family is None else {tuple(s.labels.values()): s.value for s in family.samples}


def test_every_metric_has_a_help_and_a_unit_that_is_in_its_name() -> None:
    for name, family in families(well()).items():
        assert family.documentation.endswith("."), name
        assert family.unit in UNITS | {""}, name
        assert name.endswith(family.unit), name


def test_a_running_robot_in_numbers() -> None:
    view = well()
    assert values(view, "canbase_bus_load_ratio") == {(): 0.2}
    assert values(view, "canbase_cycle_overruns") == {(): 2.0}
    assert values(view, "canbase_drive_velocity_radians_per_second") == {
        ("left_wheel", "1"): 0.9,
        ("right_wheel", "2"): 0.9,
    }
    assert values(view, "canbase_scanner_usable_ratio")[("scan",)] == pytest.approx(0.9)
    assert values(view, "canbase_clearance_behind_meters") == {(): math.inf}
    assert values(view, "canbase_source_followed") == {("joystick",): 1.0, ("action",): 0.0}
    assert values(view, "canbase_lock_holds") == {("pause",): 0.0}
    assert values(view, "canbase_stops") == {("overspeed", "watchdog"): 2.0}
    assert values(view, "canbase") == {("bench", "1.2.3"): 1.0}


@pytest.mark.parametrize("state", DriverState)
def test_of_the_states_of_the_driver_exactly_one_holds(state: DriverState) -> None:
    found = values(well(driver=driver(state=int(state))), "canbase_driver_state")
    assert len(found) == len(DriverState)
    assert [word for (word,), value in found.items() if value] == [state.word]


def test_a_cause_that_the_interface_does_not_have_is_none_of_the_known_ones() -> None:
    """So `canbase_driver_cause{canbase_driver_cause="none"} == 0` still tells that something is wrong."""
    found = values(well(driver=driver(cause="by magic")), "canbase_driver_cause")
    assert len(found) == len(DriverCause)
    assert not any(found.values())
    assert values(well(safety=safety(cause="by magic")), "canbase_filter_cause")[("unknown",)] == 1.0
    assert not any(values(well(safety=safety(action=9)), "canbase_filter_action").values())
    assert values(well(driver=driver(watchdog="fine")), "canbase_watchdog_state")[("unknown",)] == 1.0


def test_what_is_not_known_has_no_sample() -> None:
    assert values(well(), "canbase_drive_current_amperes") == {}
    assert values(well(), "canbase_source_age_seconds") == {("joystick",): 0.01}
    assert values(well(driver=driver(bus_load=math.nan)), "canbase_bus_load_ratio") == {}


@pytest.mark.parametrize(
    ("silent", "prefixes"),
    [
        (
            {"driver": driver(1.6)},
            ("canbase_driver", "canbase_drive_", "canbase_bus", "canbase_watchdog"),
        ),
        ({"safety": safety(1.6)}, ("canbase_filter", "canbase_estop", "canbase_scanner", "canbase_clearance")),
        ({"mux": mux(1.6)}, ("canbase_mux", "canbase_source", "canbase_lock")),
    ],
)
def test_a_topic_that_is_silent_takes_its_metrics_along_and_only_those(
    silent: dict[str, object], prefixes: tuple[str, ...]
) -> None:
    (name,) = silent
    before, after = families(well()), families(well(**silent))
    gone = before.keys() - after.keys()
    assert all(any(each.startswith(prefix) for each in gone) for prefix in prefixes)
    assert not any(each.startswith(prefixes) for each in after)
    ages = values(well(**silent), "canbase_data_age_seconds")
    assert sorted(ages.values()) == [0.1, 0.1, 1.6], name


def test_before_anything_came_the_ages_are_infinite_and_nothing_else_is_said() -> None:
    assert families(RobotView()).keys() == OWN
    assert set(values(RobotView(), "canbase_data_age_seconds").values()) == {math.inf}


def test_labels_have_a_bound_whatever_strangers_publish() -> None:
    """Names that robot.yaml does not have are left out; a joint that is sent twice is one."""
    strange = [drive(f"wheel_{i}") for i in range(1000)]
    view = well(driver=driver(drives=[drive(), drive(), *strange]))
    assert values(view, "canbase_drive_enabled") == {("left_wheel", "1"): 1.0}
    message = mux().message
    for each in (*message.sources, *message.locks):
        each.name = "unheard of"
    assert values(well(mux=mux(sources=message.sources, locks=message.locks)), "canbase_source_active") == {}
    many = [ForeignPublisher(topic=f"t{i}") for i in range(500)]
    assert values(well(mux=mux(foreign=many)), "canbase_mux_unexpected_publishers") == {(): 500.0}
    stops: dict[tuple[str, str], int] = {}
    for i in range(MOST_STOPS + 50):
        stops = counted(stops, "somebody", f"cause {i}")
    assert len(stops) == MOST_STOPS + 1
    assert stops[OTHER] == 50


EXPORTED = {
    DriverStatus: {
        "state", "cause", "watchdog", "watchdog_age_s", "watchdog_rung", "watchdog_lease_age_s", "watchdog_trips",
        "watchdog_leases_refused", "watchdog_frames_dropped", "watchdog_bus_errors", "watchdog_pause_max_s",
        "pose_resets", "standstill", "command_age_s", "commands_refused", "cycles", "overruns", "cycle_lateness_max_s",
        "frames_dropped", "send_errors", "bus_problem", "controller", "receive_errors", "error_frames", "bus_failures",
        "bus_load", "drives",
    },
    SafetyState: {
        "action", "cause", "estop", "emergency", "clearance_ahead_m", "clearance_behind_m", "ordered_linear_mps",
        "ordered_angular_radps", "lease_errors", "scanners",
    },
    MuxState: {"ready", "sources", "locks", "foreign"},
}  # fmt: skip
LEFT_OUT = {
    DriverStatus: {"stamp", "detail", "clears_on", "watchdog_cause", "command_fresh"},
    SafetyState: {"stamp", "detail", "clears_on", "command_age_s", "scan_age_s", "lease_sequence"},
    MuxState: {"stamp", "active", "not_ready"},
}
"""Sentences, and what other metrics tell already."""


@pytest.mark.parametrize("kind", [DriverStatus, SafetyState, MuxState])
def test_a_new_field_of_a_message_is_exported_or_left_out_on_purpose(kind: type) -> None:
    assert set(kind.get_fields_and_field_types()) == EXPORTED[kind] | LEFT_OUT[kind]  # type: ignore[attr-defined]


def test_who_accepts_no_openmetrics_gets_the_older_format() -> None:
    text, content_type = Exposition(well(), ROBOT, "1.2.3").text(plain=True)
    assert content_type == "text/plain; version=0.0.4; charset=utf-8"
    assert "canbase_watchdog_trips" in {family.name for family in plain_families(text.decode())}
