"""What of a robot.yaml virtual time has: every limit is the file's, and what differs is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from canbase_campaign.faults import FAULTS
from canbase_config.load import load_robot, sample
from canbase_config.mux import MuxLock, MuxSource
from canbase_config.profile_file import profile_path
from canbase_config.robot import Robot
from canbase_config.safety import Scan
from canbase_qualification.job import FAILURES
from canbase_qualification.simulated_robot import UnfitError, simulated

EXAMPLE = load_robot(sample("example_can0")).robot
BENCH = load_robot(sample("bench")).robot


def changed(robot: Robot = EXAMPLE, **sections: dict[str, Any]) -> Robot:
    """Keys of sections, not checked."""
    update = {name: getattr(robot, name).model_copy(update=keys) for name, keys in sections.items()}
    return robot.model_copy(update=update)


def of_drives(*profiles: str) -> Robot:
    pairs = zip(EXAMPLE.drives, profiles, strict=True)
    return EXAMPLE.model_copy(update={"drives": tuple(d.model_copy(update={"profile": p}) for d, p in pairs)})


def test_limits_timeouts_rates_and_tolerances_are_those_of_the_file() -> None:
    robot = simulated(EXAMPLE).robot
    for section in ("limits", "timeouts", "rates", "watchdog", "drives", "base", "bus", "health"):
        assert getattr(robot, section) == getattr(EXAMPLE, section), section
    assert robot.safety.scan.model_copy(update={"x_m": 0.25}) == EXAMPLE.safety.scan


def test_the_two_sources_with_the_highest_priority_drive_under_the_names_of_the_campaign() -> None:
    sources = {
        "web": MuxSource(topic="web_vel", priority=10, timeout_s=0.4),
        "radio": MuxSource(topic="rc/cmd", priority=90, timeout_s=0.15),
        "nav2": MuxSource(topic="nav_vel", priority=30, timeout_s=0.6, neutral_after_s=3.0),
        "action": EXAMPLE.mux.sources["action"],
    }
    found = simulated(changed(mux={"sources": sources}))
    mux = found.robot.mux.sources
    assert (mux["joystick"].topic, mux["joystick"].timeout_s) == ("cmd_vel_joy", 0.15)
    assert (mux["navigation"].topic, mux["navigation"].timeout_s) == ("cmd_vel_nav", 0.6)
    assert mux["navigation"].neutral_after_s == 3.0
    assert mux["action"] == EXAMPLE.mux.sources["action"]
    assert any("web: never ordered motion" in sentence for sentence in found.not_judged)


def test_a_source_of_wheel_speeds_orders_velocities_and_that_is_said() -> None:
    sources = {
        **EXAMPLE.mux.sources,
        "base": MuxSource(topic="joints", priority=200, timeout_s=0.2, type="joint_command"),
    }
    found = simulated(changed(mux={"sources": sources}))
    assert found.robot.mux.sources["joystick"].type == "twist"
    assert found.robot.mux.sources["joystick"].timeout_s == 0.2
    assert any("base: ordered velocities of the base" in sentence for sentence in found.not_judged)


def test_a_robot_with_scanner_and_button_is_tried_with_every_fault_but_those_of_locks() -> None:
    found = simulated(EXAMPLE)
    assert FAULTS.keys() - set(found.faults) == {"two_on_a_lock"}
    assert found.failures == tuple(range(len(FAILURES)))


def test_without_a_scanner_and_a_button_that_must_be_there_their_loss_stops_nothing_and_that_is_said() -> None:
    found = simulated(BENCH)
    assert not any(name in found.faults for name in ("scan_stale", "obstacle", "scanner_frozen", "estop_stale"))
    assert "estop_pressed" in found.faults
    names = {FAILURES[place].key for place in found.failures}
    assert ("scan", "stale") not in names
    assert ("emergency stop", "stale") not in names
    assert ("emergency stop", "pressed") in names
    assert any("no scanner is required" in sentence for sentence in found.not_judged)
    assert any("safety.estop.required is false" in sentence for sentence in found.not_judged)


def test_one_scanner_stands_for_several_and_it_is_the_one_that_is_missed_last() -> None:
    slow = Scan(required=True, topic="rear", timeout_s=0.9, yaw_rad=3.0, upside_down=True)
    found = simulated(changed(safety={"more_scans": (slow,)}))
    scan = found.robot.safety.scan
    assert (scan.topic, scan.timeout_s, scan.x_m, scan.yaw_rad, scan.upside_down) == ("scan", 0.9, 0.0, 0.0, False)
    assert found.robot.safety.more_scans == ()
    assert any("one scanner stood for all 2" in sentence for sentence in found.not_judged)


def test_a_scanner_that_is_missed_soon_is_fast_enough() -> None:
    scan = EXAMPLE.safety.scan.model_copy(update={"timeout_s": 0.05})
    estop = EXAMPLE.safety.estop.model_copy(update={"timeout_s": 0.1})
    sentences = " ".join(simulated(changed(safety={"scan": scan, "estop": estop})).assumed)
    assert "sees all around, 50 times a second" in sentences
    assert "button publishes 25 times a second" in sentences
    assert "sees all around, 10 times a second" in " ".join(simulated(EXAMPLE).assumed)


def test_a_robot_without_goals_is_not_tried_with_their_failures() -> None:
    sources = {name: source for name, source in EXAMPLE.mux.sources.items() if name != "action"}
    found = simulated(changed(mux={"sources": sources}))
    assert not any(name.startswith("action") for name in found.faults)
    assert {FAILURES[place].what for place in found.failures}.isdisjoint(
        {"drive_distance_server", "client", "odometry"}
    )
    assert any("no goal was sent" in sentence for sentence in found.not_judged)


@pytest.mark.parametrize(("priority", "tried"), [(200, True), (60, False)])
def test_two_publishers_on_a_lock_are_tried_where_it_holds_every_source(priority: int, *, tried: bool) -> None:
    found = simulated(changed(mux={"locks": {"button": MuxLock(topic="button", priority=priority)}}))
    assert ("two_on_a_lock" in found.faults) == tried
    assert found.robot.mux.locks == {}
    assert any("mux.locks" in sentence for sentence in found.not_judged)
    assert any("button: open" in sentence for sentence in found.assumed)


def test_it_counts_as_commissioned_and_that_is_said_where_it_is_not() -> None:
    assert any("is commissioned" in sentence for sentence in simulated(EXAMPLE).assumed)
    assert not any("is commissioned" in sentence for sentence in simulated(simulated(EXAMPLE).robot).assumed)


def test_a_relay_and_a_profile_of_ones_own_are_not_judged(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(profile_path("generic").read_text())
    robot = of_drives(str(own), str(own))
    robot = changed(robot, watchdog={"relay": object()})
    sentences = " ".join(simulated(robot).not_judged)
    assert "watchdog.relay" in sentences
    assert f"{own} is a profile of your own" in sentences


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        (
            of_drives("generic", "roboteq"),
            "generic and roboteq: the judge knows robots whose drives are all of one kind",
        ),
        (changed(mux={"sources": {"action": EXAMPLE.mux.sources["action"]}}), "action alone: nobody drives but goals"),
        (changed(BENCH, bus={"bitrate": 10_000}), "bus.bitrate: 10000 bit/s do not carry the frames"),
    ],
)
def test_what_cannot_be_simulated_is_refused_with_its_key(robot: Robot, words: str) -> None:
    with pytest.raises(UnfitError, match=words):
        simulated(robot)
