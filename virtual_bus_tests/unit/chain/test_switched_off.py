"""What an operator switched off stays off over a kill, a crash and a reboot. In virtual time."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from canbase_base.latch_record import Defect, Found, Mark, Record
from canbase_driver.supervision.latch import allowed_before_the_start
from canbase_driver.supervision.lifecycle import Aim
from canbase_runtime.driver_state import DriverState
from support.chain_world import FORWARD, World

AWAY_S = 0.5


def restart_driver(world: World) -> None:
    world.kill_driver()
    world.run(AWAY_S)
    world.start_driver()


def stays_off(world: World) -> None:
    """No power and no motion, by a zero command that would enable it, then by one to move."""
    begin_m = world.truth.travel_m
    for command in (FORWARD.ZERO, FORWARD):
        world.command = command
        assert not world.run(2.0, lambda: any(world.powered)), world.core.finding
    assert world.truth.travel_m == pytest.approx(begin_m, abs=1e-4)


# 0.3 m/s ── deactivate (shutdown) ── answered ── SIGKILL ── start ── command 0.3 m/s: nothing ── activate ── drives
@pytest.mark.parametrize("aim", [Aim.CONFIGURED, Aim.RELEASED])
@pytest.mark.parametrize("restart", [restart_driver, World.reboot])
def test_it_is_off_after_a_restart_until_it_is_activated(aim: Aim, restart: Callable[[World], None]) -> None:
    world = World(keeps=True)
    world.drive()
    assert world.go(aim).done
    world.run(1.0)
    for _ in range(2):
        restart(world)
        stays_off(world)
        assert world.core.aim is aim
        assert world.core.finding.detail.endswith(", switched off by an operator before this start")
    if restart is World.reboot:
        return
    world.command = world.command.ZERO if world.command else None
    if aim is Aim.RELEASED:
        assert world.go(Aim.CONFIGURED).done
        restart(world)
        stays_off(world)
        world.command = world.command.ZERO if world.command else None
    world.run(0.1)
    assert world.go(Aim.ACTIVE).done
    assert world.core.finding.detail == ""
    world.run(0.05)
    world.command = FORWARD
    world.run(0.8)
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, abs=0.01)


def test_killed_in_the_stop_of_the_deactivation_it_is_latched_and_off() -> None:
    world = World(keeps=True)
    world.drive()
    world.core.request_aim(Aim.CONFIGURED, world.now_s, lambda _outcome: None)
    world.run(0.03)
    assert any(world.powered)
    restart_driver(world)
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.LATCHED, "ended with power")
    world.command = FORWARD.ZERO
    world.run(1.0)
    assert world.reset().done
    stays_off(world)


def test_a_latched_robot_that_is_deactivated_is_both_after_a_restart() -> None:
    world = World(keeps=True)
    world.enable()
    world.core.request_stop()
    world.run_until(DriverState.LATCHED, 1.0)
    assert world.go(Aim.CONFIGURED).done
    restart_driver(world)
    assert world.core.state is DriverState.LATCHED
    world.run(1.0)
    assert world.reset().done
    stays_off(world)


def test_one_that_nobody_switched_off_has_power_after_a_restart() -> None:
    """As by systemd: SIGTERM, or a robot that waits for its lifecycle manager."""
    world = World(keeps=True)
    world.enable()
    world.core.request_shutdown()
    assert world.run(2.0, lambda: world.core.finished)
    restart_driver(world)
    world.enable()


def test_waiting_for_a_lifecycle_manager_switches_nothing_off() -> None:
    world = World(keeps=True, aim=Aim.RELEASED)
    world.run(0.1)
    assert world.go(Aim.CONFIGURED).done
    restart_driver(world)
    world.enable()


def test_an_activation_that_fails_leaves_it_off() -> None:
    world = World(keeps=True)
    world.enable()
    assert world.go(Aim.CONFIGURED).done
    world.watchdog = None
    assert not world.go(Aim.ACTIVE).done
    world.start_watchdog()
    restart_driver(world)
    stays_off(world)


def test_a_deactivation_that_the_disk_does_not_keep_is_answered_with_no() -> None:
    world = World(keeps=True)
    world.enable()
    world.disk.file.writable = False
    outcome = world.go(Aim.CONFIGURED)
    assert not outcome.done
    assert outcome.sentence.startswith("configured, and a restart may not keep it: the record of stops cannot be")
    assert not any(world.powered)


@pytest.mark.parametrize(
    ("found", "aim"),
    [
        (None, Aim.ACTIVE),
        (Found(), Aim.ACTIVE),
        (Found(Record(Mark.LIVE, 1)), Aim.CONFIGURED),
        (Found(Record(code=2)), Aim.RELEASED),
        (Found(Record(code=3)), Aim.CONFIGURED),
        (Found(Record(code=1), Defect.OWNER), Aim.ACTIVE),
    ],
)
def test_what_the_record_says(found: Found | None, aim: Aim) -> None:
    assert allowed_before_the_start(found) is aim
