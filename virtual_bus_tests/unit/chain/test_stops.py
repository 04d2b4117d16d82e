"""Stops of driver, watchdog and simulated drives together: who may have power gets them, and their words are true."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.supervision.stop_history import StopReport, standstill_text
from canbase_runtime.driver_state import DriverState
from canbase_sim import faults
from canbase_sim.cia402 import axis
from canbase_sim.cia402.states import Bit
from canbase_sim.faults import KINDS
from canbase_watchdog.watchdog import State
from support.chain_world import World
from unit.driver.test_stop_history import TRIP

SYNC, NMT_RESETS = 0x080, (b"\x82\x01", b"\x82\x02")


def driving(mps: float = 0.3) -> World:
    world = World()
    world.drive(Twist2D(mps, 0.0), 1.2)
    return world


def blind_watchdog(world: World) -> bool:
    """Heartbeat and state of a watchdog that never trips; False."""
    world.inject(0x77E, "05")
    world.inject(0x1FE, "01 00 00 00 00 00 00 00")
    return False


# --- a boot-up message of a drive that goes on (a second node with its id, a glitch of its firmware)


@pytest.mark.parametrize("nodes", [(1,), (2,), (1, 2)])
def test_a_boot_up_message_in_motion_stops_the_drive_that_sent_it_too(nodes: tuple[int, ...]) -> None:
    """0.3 m/s ── boot-up of one drive or of both, which go on ── quick stop of all: 0.15 s, 0.03 m."""
    world = driving()
    world.watchdog = (
        None  # it sends a quick stop too; here the driver is alone, with a state frame that says "watching"
    )
    path_m, begin = world.truth.path_m, world.now_s
    for node_id in nodes:
        world.inject(0x700 + node_id, "00")

    assert world.run(1.0, lambda: blind_watchdog(world) or world.truth.standing_s > 0.05)
    assert world.truth.path_m - path_m < 0.06
    assert (world.core.finding.cause.value, world.core.stops[0].latched) == ("drive restarted", True)
    stopped = [
        data for at, frame in world.log for data in [frame.data] if at >= begin and frame.cob_id == 0x200 + nodes[0]
    ]
    assert b"\x02\x00" in [data[:2] for data in stopped]
    assert world.sent(SYNC, world.now_s - 0.05)


# --- what a drive says about itself when the watchdog trips


@pytest.mark.parametrize("is_about_motion", [True, False])
def test_a_trip_about_motion_names_a_drive_in_local_mode_and_another_trip_does_not(
    is_about_motion: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.3 m/s ── bit 9 of the statuswords falls, and an encoder or the leases end ── trip; 1 s later it is the same."""
    world = driving()
    monkeypatch.setattr(axis, "_ALWAYS", int(Bit.VOLTAGE_ENABLED))
    world.leases = is_about_motion
    if is_about_motion:
        faults.apply(world.bench.nodes, 1, "encoder_lost", world.now_s, {})
    assert world.run(1.0, lambda: world.core.state is DriverState.STOPPING)
    for _ in range(2):
        assert world.core.finding.detail.startswith("watchdog: ")
        assert ("left_wheel (node 1) may be in local mode" in world.core.finding.detail) is is_about_motion
        world.run(1.0)


# --- values that stop coming


def velocity_lost(world: World, cob_id: int) -> None:
    """Frames of 606Ch of one drive get lost on their way to the driver."""
    driver = world.core
    take = driver.on_frame
    driver.on_frame = lambda frame, now_s: [] if frame.cob_id == cob_id else take(frame, now_s)  # type: ignore[method-assign]


def test_a_velocity_that_no_longer_comes_stops_the_base_and_is_not_published_as_odometry() -> None:
    """6041h and 6064h live, 606Ch does not come: after timeouts.feedback_s it is a drive that is silent."""
    world = driving()
    velocity_lost(world, 0x281)
    world.run(0.09)
    assert world.snapshot.odometry.valid
    world.run(0.03)
    assert not world.snapshot.odometry.valid
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.STOPPING, "drive silent")
    assert world.core.finding.detail.startswith("node 1 (left_wheel): no velocity (606Ch) for 0.1")
    assert math.isfinite(world.snapshot.drives[0].feedback_age_s)
    assert not world.snapshot.standstill


# --- the end of the process


def test_a_drive_that_does_not_confirm_that_its_power_is_off_keeps_what_stops_it() -> None:
    """NMT reset communication can erase 1016h: a drive that may have power must stop by the missing heartbeat."""
    world = driving()
    begin = world.now_s
    velocity_lost(world, 0x181)  # nothing of its statusword is heard any more
    world.core.request_shutdown()
    assert world.run(5.0, lambda: world.core.finished)
    assert world.sent(0x000, begin).count(NMT_RESETS[0]) == 0
    assert NMT_RESETS[1] in world.sent(0x000, begin)


# --- what is said


def test_after_the_driver_hung_it_says_that_the_watchdog_tripped() -> None:
    """SIGSTOP for 2 s at 0.3 m/s: the watchdog stops the drives. Drives that left OPERATIONAL are what came of it."""
    world = driving()
    world.pause_driver(2.0)
    world.run(0.1)
    assert world.watchdog is not None
    assert world.watchdog.status.state is State.TRIPPED
    assert [stop.cause for stop in world.core.stops] == ["watchdog tripped"]
    assert world.core.stops[0].stopped_by == "watchdog"
    assert world.core.finding.detail in ("watchdog: driver silent", "watchdog: lease lost")


def test_a_hazard_that_latches_during_a_ramp_that_does_not_is_shown_and_recorded() -> None:
    world = driving()
    world.core.request_shutdown()
    world.run(0.05)
    assert [(stop.cause, stop.latched) for stop in world.core.stops] == [("shutdown", False)]
    world.core.request_stop()
    world.run(0.02)
    assert world.core.finding.cause.value == "stop requested"
    assert [(stop.cause, stop.latched) for stop in world.core.stops] == [("shutdown", False), ("stop requested", True)]


def test_the_way_to_enabled_warns_of_nothing() -> None:
    world = World()
    causes: list[str] = []

    def note() -> bool:
        causes.append(world.core.finding.cause.value)
        return world.core.state is DriverState.ENABLED

    assert world.run(3.0, note)
    assert "drive not ready" not in causes
    assert "preparing" in causes


def test_a_distance_that_was_not_measured_is_not_a_number_in_no_line() -> None:
    report = StopReport(TRIP, standstill=True, standstill_s=2.4, distance_m=math.nan, turned_rad=math.nan)
    assert standstill_text(report) == "after 2.40 s, distance not measured"
    assert standstill_text(replace(report, distance_m=0.5)) == "after 2.40 s and 0.500 m"
    assert standstill_text(replace(report, standstill=False)) == "not seen"


def test_a_base_that_a_new_driver_finds_in_motion_is_not_said_to_stand() -> None:
    """The driver is killed at 0.3 m/s and started again at once, which takes the drives over."""
    world = driving()
    world.kill_driver()
    world.run(0.02)
    world.start_driver()

    def said_falsely() -> bool:
        return world.snapshot.standstill and abs(world.truth.linear_mps) > 0.02

    assert not world.run(1.5, said_falsely)


# --- standstill needs evidence


def test_a_lost_encoder_is_no_evidence_of_standstill_until_the_wheel_must_have_rolled_out() -> None:
    """0.3 m/s ── encoder lost: 0 m/s, and the wheel runs ── stop requested after 0.2 s ── power off at once."""
    world = driving()
    world.watchdog = None
    KINDS["encoder_lost"][0](world.node, world.now_s)

    def watched() -> bool:
        return blind_watchdog(world)

    world.run(0.2, watched)
    assert not world.snapshot.standstill
    world.core.request_stop()
    world.run(0.05, watched)
    assert world.powered[0] is False
    assert world.truth.v_left_mps < 1.5
    world.run(9.0, watched)
    assert not world.snapshot.standstill
    world.run(1.0, watched)
    assert world.snapshot.standstill
    assert world.snapshot.standstill_assumed.startswith("left_wheel showed no motion for 0.0")
    assert world.snapshot.standstill_assumed.endswith("so standstill is assumed")
