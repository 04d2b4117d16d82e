"""The core alone, without drives: what it takes in, what it refuses, and what a caller of it may rely on."""

from __future__ import annotations

import math

import pytest

from canbase_driver.cia301.frame import Frame
from canbase_driver.core import DriverCore
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.supervision.bus_health import BusReport
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView
from support.chain_world import World, bench_robot

WATCHING = Frame(0x1FE, bytes.fromhex("01 00 80 00 14 00 00 00"))


@pytest.fixture
def core() -> DriverCore:
    return DriverCore(bench_robot())


def test_before_the_first_cycle_the_snapshot_says_that_nothing_is_known(core: DriverCore) -> None:
    snapshot = core.snapshot(10.0)
    assert (snapshot.state, snapshot.finding.cause.value, snapshot.watchdog.view) == (
        DriverState.BOOTING,
        "booting",
        WatchdogView.MISSING,
    )
    assert (snapshot.standstill, snapshot.odometry.valid, snapshot.command.fresh) == (False, False, False)
    assert math.isnan(snapshot.command.age_s)
    assert math.isnan(snapshot.watchdog.age_s)
    assert [drive.state for drive in snapshot.drives] == [None, None]


def test_the_first_cycles_beat_and_ask_the_drives_who_they_are(core: DriverCore) -> None:
    first = core.tick(10.0)
    second = core.tick(10.01)
    assert [str(frame) for frame in first] == ["77Fh [05]"]
    assert [str(frame) for frame in second] == ["601h [40 00 10 00 00 00 00 00]", "602h [40 00 10 00 00 00 00 00]"]
    assert core.finding.detail == "waiting for node 1 (left_wheel): the answer to 1000h:0"


def test_frames_of_others_are_none_of_its_business(core: DriverCore) -> None:
    for cob_id in (0x000, 0x080, 0x100, 0x183, 0x201, 0x27E, 0x601, 0x77E, 0x77F, 0x7E5):
        assert core.on_frame(Frame(cob_id, bytes(8)), 10.0) == []
    assert core.snapshot(10.0).bus.dropped == 0


def test_counters_of_the_bus_are_passed_on(core: DriverCore) -> None:
    core.on_bus("", 10.0, BusReport(send_errors=3, dropped=4))
    core.on_frame(Frame(0x1FE), 10.0)
    snapshot = core.snapshot(10.0)
    assert (snapshot.bus.send_errors, snapshot.bus.dropped) == (3, 5)


def test_the_command_is_taken_with_its_receive_time(core: DriverCore) -> None:
    assert core.accept_velocity_command(Twist2D(0.1, 0.0), 9.9)
    assert not core.accept_velocity_command(Twist2D(math.nan, 0.0), 10.0)
    snapshot = core.snapshot(10.0)
    assert snapshot.command.age_s == pytest.approx(0.1)
    assert (snapshot.command.fresh, snapshot.command.refused) == (True, 1)
    assert not core.snapshot(10.11).command.fresh


def test_without_a_watchdog_a_reset_is_refused_at_once(core: DriverCore) -> None:
    outcomes: list[RequestOutcome] = []
    core.request_reset(10.0, outcomes.append)
    assert outcomes == [
        RequestOutcome(False, "refused: watchdog: no frame of it yet; start it with `canbase serve watchdog`")
    ]


def test_a_reset_asks_the_watchdog_in_every_cycle_until_it_answers(core: DriverCore) -> None:
    core.on_frame(WATCHING, 10.0)
    outcomes: list[RequestOutcome] = []
    core.request_reset(10.0, outcomes.append)
    for cycle in range(1, 4):
        core.on_frame(WATCHING, 10.0 + 0.01 * cycle)
        asked = [frame for frame in core.tick(10.0 + 0.01 * cycle) if frame.cob_id == 0x27E]
        assert [str(frame) for frame in asked] == ["27Eh [01 52 53 54]"]
    core.on_frame(Frame(0x1FE, bytes.fromhex("01 00 80 00 14 00 01 04")), 10.04)
    assert [frame for frame in core.tick(10.04) if frame.cob_id == 0x27E] == []
    assert outcomes == []


def test_a_suspend_breaks_off_a_reset(core: DriverCore) -> None:
    """Its clock stood still meanwhile, and nobody waits for it any more."""
    core.on_frame(WATCHING, 10.0)
    outcomes: list[RequestOutcome] = []
    core.request_reset(10.0, outcomes.append)
    core.on_suspend(10.0)
    assert outcomes == [RequestOutcome(False, "broken off: the computer was suspended; reset again")]


def test_a_shutdown_breaks_off_a_reset_and_tells_its_caller(core: DriverCore) -> None:
    core.on_frame(WATCHING, 10.0)
    outcomes: list[RequestOutcome] = []
    core.request_reset(10.0, outcomes.append)
    core.request_shutdown()
    assert outcomes == [RequestOutcome(False, "broken off: motor_driver is shutting down")]
    frames = core.tick(10.01)
    assert core.finished
    assert not [frame for frame in frames if frame.cob_id == 0x000]  # of no drive is known that its power is off
    core.request_reset(10.02, outcomes.append)
    assert outcomes[1] == RequestOutcome(False, "refused: motor_driver is shutting down")


def test_a_shutdown_begins_no_boot(core: DriverCore) -> None:
    core.request_shutdown()
    sent = [frame for cycle in range(5) for frame in core.tick(10.0 + 0.01 * cycle)]
    assert not [frame for frame in sent if frame.cob_id in (0x601, 0x602)]


def test_a_stop_before_the_drives_are_there_is_latched_and_told(core: DriverCore) -> None:
    core.request_stop()
    core.tick(10.0)
    assert core.state is DriverState.LATCHED
    assert [(stop.stopped_by, stop.cause, stop.latched) for stop in core.stops] == [
        ("motor_driver", "stop requested", True)
    ]
    core.tick(10.01)
    assert len(core.stops) == 1


def test_the_lateness_of_cycles_is_counted(core: DriverCore) -> None:
    for cycle, lateness_s in enumerate((0.0, 0.004, 0.006)):
        core.tick(10.0 + 0.01 * cycle, lateness_s)
    snapshot = core.snapshot(10.1)
    assert (snapshot.cycle.cycles, snapshot.cycle.overruns, snapshot.cycle.lateness_max_s) == (3, 1, 0.006)


def test_a_stop_by_the_watchdog_is_recorded_as_its_own() -> None:
    world = World()
    world.drive()
    world.leases = False
    world.run(1.0)
    assert [(stop.stopped_by, stop.detail) for stop in world.core.stops] == [("watchdog", "watchdog: lease lost")]


def test_after_a_pause_of_the_whole_process_the_setpoint_does_not_jump() -> None:
    world = World()
    world.enable()
    world.command = Twist2D(0.5, 0.0)
    world.run(0.1)
    before_mps = world.targets_mps()[-1][0]
    driver, world.driver = world.driver, None
    world.run(0.2)
    world.driver = driver
    world.resume_cycles()
    world.run(0.004)
    assert world.targets_mps()[-1][0] - before_mps <= 0.8 * 0.1 + 1e-3  # acceleration × the longest step of the limits
