"""Drives that come back silent, say two boot-up messages, or still turn when their driver is started anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

import pytest

from canbase_config.derive import watchdog_config
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_watchdog.watchdog import State, Watchdog
from support.chain_world import World


def stopped(world: World) -> None:
    """Latched by motor_driver/stop, without power, at standstill."""
    world.enable()
    world.core.request_stop()
    world.run_until(DriverState.LATCHED, 2.0)
    world.run(0.5)


def test_a_drive_that_came_back_while_its_cable_was_off_is_found_again() -> None:
    """Its boot-up message is lost, and it sends nothing by itself: its heartbeat is not configured any more."""
    world = World()
    stopped(world)
    world.node.line.cut = True
    world.node.power_cycle(world.now_s, off_s=0.2)
    world.run(2.0)
    world.node.line.cut = False
    world.run(2.0)
    outcome = world.reset()
    assert outcome.done, outcome.sentence
    world.run_until(DriverState.ENABLED, 1.0)


def test_a_drive_that_is_operational_and_sends_nothing_is_asked_again() -> None:
    """Somebody has switched off its heartbeat and its TPDOs. It answers SDOs all the while."""
    world = World()
    stopped(world)
    for data in ("2B 17 10 00 00 00 00 00", "23 00 18 01 81 01 00 C0", "23 01 18 01 81 02 00 C0"):
        world.inject(0x601, data)
    world.run(3.0)
    assert world.reset().done
    world.run_until(DriverState.ENABLED, 1.0)


class TwoBootUps(World):
    """Each NMT reset communication is answered by a second boot-up message, `second_s` after the first one."""

    second_s = 0.0

    def run(self, duration_s: float, until: Callable[[], bool] = lambda: False) -> bool:
        def reached() -> bool:
            resets = [at for at, frame in self.log[-2000:] if frame.cob_id == 0 and frame.data == b"\x82\x01"]
            if resets and resets[-1] != self._answered and self.now_s >= resets[-1] + self.second_s:
                self._answered = resets[-1]
                self.node.say_boot_up()
            return until()

        return super().run(duration_s, reached)

    _answered = 0.0


@pytest.mark.parametrize("second_s", [0.05, 0.2, 0.7, 1.5])
def test_a_drive_that_sends_two_boot_up_messages_needs_no_key_for_it(second_s: float) -> None:
    """Its profile says nothing of a second one. It may stop the robot twice; after that it is waited for."""
    world = TwoBootUps()
    world.second_s = second_s
    for _ in range(3):
        world.run(6.0)
        if world.core.state is not DriverState.ENABLED:
            assert world.core.state is DriverState.LATCHED
            assert "start.settle_s" in world.core.finding.detail
            world.reset()
    world.run(8.0)
    assert world.core.state is DriverState.ENABLED


def test_a_driver_that_is_started_while_drives_still_turn_brings_them_to_a_stand_and_trips_nothing() -> None:
    """Watchdog and driver die at once, and are started at once: before the drives miss their heartbeats."""
    world = World()
    world.drive(Twist2D(0.3, 0.0))
    world.command = Twist2D.ZERO
    world.kill_driver()
    world.watchdog = Watchdog(watchdog_config(world.robot), world.now_s)
    world.start_driver()
    world.run(1.5)
    assert world.watchdog is not None
    assert world.watchdog.status.state is not State.TRIPPED, world.watchdog.status.verdict
    assert world.truth.standing_s > 0.3


@pytest.mark.parametrize("nodes", [(1,), (2,), (1, 2)])
def test_a_drive_that_sends_a_boot_up_message_in_motion_is_stopped_by_the_driver_itself(nodes: tuple[int, ...]) -> None:
    """t   0  0.3 m/s: boot-up messages, though nothing has restarted ── the next cycle: quick stop by RPDO, and SYNC"""
    world = World()
    world.drive(Twist2D(0.3, 0.0))
    world.watchdog, began, from_m = None, world.now_s, world.truth.travel_m
    for node_id in nodes:
        world.bench.nodes[node_id].say_boot_up()
    world.run(0.03)
    for node_id in (1, 2):
        assert any(data[0] & 0x86 == 0x02 for data in world.sent(0x200 + node_id, since=began)), "quick stop"
    assert world.sent(0x080, since=began + 0.02)
    assert world.stands_after() < 0.3 / world.robot.limits.emergency_deceleration_mps2 + 0.1
    assert world.truth.travel_m - from_m < 0.05


def test_while_latched_status_and_reset_say_why_a_drive_cannot_be_booted() -> None:
    """It has lost its parameters in a power cycle, and refuses to map now what it mapped before."""
    world = World()
    stopped(world)
    world.node.power_cycle(world.now_s, off_s=0.2)
    entries = dict(world.node.dictionary.entries)
    entries[0x606C00] = replace(entries[0x606C00], code="h")
    world.node.dictionary.entries = MappingProxyType(entries)
    for tpdo in world.node._tpdos:
        tpdo._rules._entries = entries
    world.run(4.0)
    assert world.core.state is DriverState.LATCHED
    problem = world.snapshot.drives[0].boot_problem
    assert "TPDO2 takes 606Ch:0 with 16 bits, and not with 32" in problem
    assert "set `layout.velocity_bits: 16` in its drive profile" in problem
    assert problem.rstrip(".") in world.reset().sentence
