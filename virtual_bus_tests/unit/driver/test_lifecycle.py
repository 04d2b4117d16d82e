"""The driver's lifecycle in virtual time, with the watchdog and simulated drives on the bus."""

from __future__ import annotations

import pytest

from canbase_base.latch_record import Mark
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.lifecycle import Aim
from canbase_runtime.driver_state import DriverState
from canbase_watchdog.watchdog import State as WatchdogState
from support.chain_world import FORWARD, World

DRIVER_HEARTBEAT = 0x77F
SYNC = 0x080
NMT = 0x000


@pytest.fixture
def released() -> World:
    """A driver that has just started, without autostart."""
    return World(aim=Aim.RELEASED)


def test_unconfigured_nothing_at_all_is_sent(released: World) -> None:
    released.command = FORWARD
    released.run(15.0)
    assert [frames for frames in released.ticks if frames] == []
    assert released.core.state is DriverState.OFFLINE
    assert released.core.finding.cause.value == "not configured"


def test_configured_drives_are_booted_and_heard_and_get_no_power(released: World) -> None:
    assert released.go(Aim.CONFIGURED).done
    released.command = FORWARD
    released.run(2.0)
    released.command = None
    released.run(2.0)
    assert released.core.state is DriverState.DISARMED
    assert released.core.finding.cause.value == "inactive"
    assert released.powered == [False, False]
    assert released.snapshot.odometry.valid
    assert released.truth.path_m == 0.0


def test_activated_they_have_power_and_follow_once_zero_was_commanded(released: World) -> None:
    assert released.go(Aim.CONFIGURED).done
    outcome = released.go(Aim.ACTIVE)
    assert outcome.done, outcome.sentence
    assert released.powered == [True, True]
    released.run(0.05)
    released.command = FORWARD
    released.run(0.8)
    assert released.truth.linear_mps == pytest.approx(0.3, abs=0.01)


def test_deactivated_at_speed_the_wheels_stand_before_the_power_goes_and_before_it_is_done() -> None:
    world = World()
    world.drive()
    outcomes: list[RequestOutcome] = []
    world.core.request_aim(Aim.CONFIGURED, world.now_s, outcomes.append)
    world.run(5.0, lambda: not any(world.powered))
    assert world.truth.standing_s > 0.0
    assert outcomes == []
    world.run(0.1)
    assert outcomes[0].done
    assert world.core.finding.cause.value == "inactive"
    world.run(3.0)  # the command still orders 0.3 m/s
    assert world.truth.linear_mps == 0.0
    assert world.watchdog is not None
    assert world.watchdog.status.state is WatchdogState.WATCHING
    world.command = Twist2D.ZERO
    assert world.go(Aim.ACTIVE).done


def test_cleaned_up_the_drives_are_let_go_and_do_not_miss_the_driver() -> None:
    world = World()
    world.drive()
    assert world.go(Aim.RELEASED).done
    let_go = world.now_s
    assert world.sent(NMT, let_go - 0.02) == [bytes((130, 1)), bytes((130, 2))]
    world.run(3.0)
    assert world.sent(DRIVER_HEARTBEAT, let_go + 0.002) == []
    assert world.sent(SYNC, let_go + 0.002) == []
    assert world.sent(0x081) == world.sent(0x082) == []  # no emergency message
    assert world.go(Aim.CONFIGURED).done
    assert world.core.finding.cause.value == "inactive"


def test_a_latched_stop_outlives_the_whole_way_round() -> None:
    world = World()
    world.drive()
    world.core.request_stop()
    world.run(2.0)
    world.command = Twist2D.ZERO
    world.run(0.1)
    for aim in (Aim.CONFIGURED, Aim.RELEASED, Aim.CONFIGURED):
        assert world.go(aim).done
        assert world.core.state is DriverState.LATCHED
    outcome = world.go(Aim.ACTIVE)
    assert not outcome.done
    assert "stop requested" in outcome.sentence
    assert world.powered == [False, False]
    assert world.reset().done
    world.run(0.1)
    assert world.core.finding.cause.value == "inactive"  # the activation that failed was taken back
    assert world.go(Aim.ACTIVE).done


def test_a_configuration_that_fails_is_taken_back_and_says_what_is_missing(released: World) -> None:
    released.node.line.silent = True
    outcome = released.go(Aim.CONFIGURED)
    assert not outcome.done
    assert "node 1" in outcome.sentence
    released.run(0.1)
    assert released.core.finding.cause.value == "not configured"
    released.node.line.silent = False
    assert released.go(Aim.CONFIGURED).done


def test_a_deactivation_that_is_not_confirmed_in_time_is_not_taken_back() -> None:
    world = World()
    world.drive()
    world.node.line.cut = True  # it may have power, as far as anybody knows
    outcome = world.go(Aim.CONFIGURED)
    assert not outcome.done
    assert world.core.aim is Aim.CONFIGURED
    world.node.line.cut = False
    world.command = Twist2D.ZERO
    world.run(3.0)
    assert world.powered == [False, False]
    assert world.reset().done
    world.run(0.02)
    assert world.core.finding.cause.value == "inactive"
    assert world.go(Aim.ACTIVE).done


def test_an_activation_that_fails_is_taken_back_and_says_why(released: World) -> None:
    assert released.go(Aim.CONFIGURED).done
    released.command = FORWARD
    outcome = released.go(Aim.ACTIVE)
    assert not outcome.done
    assert "command not zero" in outcome.sentence
    released.command = None
    released.run(3.0)
    assert released.powered == [False, False]


def test_a_reset_of_an_unconfigured_driver_is_refused(released: World) -> None:
    released.run(0.1)
    assert released.reset() == RequestOutcome(False, "refused: lifecycle: unconfigured; configure it first")


def test_a_driver_that_shuts_down_obeys_a_deactivation_and_its_record_keeps_it() -> None:
    """At 0 s SIGTERM, at 0.05 s `deactivate` and then `activate`: the next start gets no power."""
    world = World()
    world.drive()
    sentences: list[str] = []
    world.core.request_shutdown()
    world.run(0.05)
    world.core.request_aim(Aim.CONFIGURED, world.now_s, lambda outcome: sentences.append(outcome.sentence))
    world.core.request_aim(Aim.ACTIVE, world.now_s, lambda outcome: sentences.append(outcome.sentence))
    assert sentences == ["refused: motor_driver is shutting down"]
    world.run(5.0, lambda: world.core.finished)
    assert world.powered == [False, False]
    assert (world.core.record.mark, world.core.record.code) == (Mark.CLEAR, Aim.ACTIVE - Aim.CONFIGURED)


def test_of_two_changes_at_once_the_second_is_refused(released: World) -> None:
    sentences: list[str] = []
    released.core.request_aim(Aim.CONFIGURED, released.now_s, lambda _outcome: None)
    released.core.request_aim(Aim.ACTIVE, released.now_s, lambda outcome: sentences.append(outcome.sentence))
    assert sentences == ["refused: a change to CONFIGURED is under way"]
