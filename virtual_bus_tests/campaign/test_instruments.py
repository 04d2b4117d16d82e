"""The campaign's own instruments: its bus, its processes, its envelope. What they get wrong, no scenario would find."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import pytest

from canbase_campaign import plan
from canbase_campaign.can_bus import CanBus, Receiver
from canbase_campaign.clock import Clock, ComputerClock
from canbase_campaign.envelope import Envelope, moving_s, react_s
from canbase_campaign.faults import ADDED, FAULTS
from canbase_campaign.process import Process, Topics
from canbase_campaign.robots import campaign_robot
from canbase_campaign.wishes import Wishes
from canbase_campaign.world import World
from canbase_velocity.twist import ZERO, Twist

pytestmark = pytest.mark.campaign


class Listener(Process):
    name = "listener"

    def __init__(self, clock: Clock) -> None:
        super().__init__(ComputerClock(clock))
        self.heard: list[object] = []
        self.ticks: list[float] = []
        self.begin()

    def begin(self) -> None:
        self.every(0.01, lambda: self.ticks.append(round(self.clock.now_s, 4)))


class Ear(Receiver):
    def __init__(self, take: Callable[[int], None]) -> None:
        self._take = take

    def hear(self, cob_id: int, data: bytes) -> None:
        self._take(cob_id)


def bus_of(bitrate: int) -> tuple[Clock, CanBus]:
    clock = Clock(0.0)
    return clock, CanBus(clock, Random(0), bitrate)


def test_the_lower_identifier_wins_and_each_sender_keeps_its_order() -> None:
    clock, bus = bus_of(1_000_000)
    heard: list[int] = []
    bus.join("ear", Ear(heard.append))
    one, two = bus.join("one", Receiver()), bus.join("two", Receiver())
    one.send(0x201, b"")
    one.send(0x080, b"")
    two.send(0x181, b"")
    two.send(0x281, b"")
    clock.run_until(1.0)
    # 201 is on the bus already; then 080 < 181 and, of two alone, 181 < 281
    assert heard == [0x201, 0x080, 0x181, 0x281]


def test_eight_bytes_take_a_quarter_of_a_millisecond_at_500_kbit_per_s() -> None:
    clock, bus = bus_of(500_000)
    times: list[float] = []
    bus.join("ear", Ear(lambda cob_id: times.append(clock.now_s)))
    bus.join("mouth", Receiver()).send(0x100, bytes(8))
    clock.run_until(1.0)
    assert times == pytest.approx([0.00025], rel=0.02)


def test_who_is_cut_off_hears_nothing_and_the_others_do() -> None:
    clock, bus = bus_of(500_000)
    heard: list[str] = []
    for name in ("near", "far"):
        bus.join(name, Ear(lambda cob_id, name=name: heard.append(name)))  # type: ignore[misc]
    mouth = bus.join("mouth", Receiver())
    bus.disturbance.blocked.add(("mouth", "far"))
    mouth.send(0x100, b"")
    clock.run_until(1.0)
    assert heard == ["near"]


def test_what_is_delayed_does_not_overtake() -> None:
    clock, bus = bus_of(500_000)
    heard: list[int] = []
    bus.join("ear", Ear(heard.append))
    mouth = bus.join("mouth", Receiver())
    bus.disturbance.delay_s = 0.05
    for cob_id in range(0x100, 0x120):
        mouth.send(cob_id, b"")
    clock.run_until(1.0)
    assert heard == list(range(0x100, 0x120))


def test_who_hangs_finds_the_newest_message_and_its_timer_goes_on_from_there() -> None:
    clock = Clock(0.0)
    listener, topics = Listener(clock), Topics(clock, Random(0))
    topics.subscribe("cmd_vel", listener, listener.heard.append)
    clock.run_until(0.015)
    listener.hang("test")
    for number in range(3):
        topics.publish("cmd_vel", number)
    clock.run_until(0.095)
    assert listener.heard == []
    listener.go_on("test")
    assert listener.heard == [2]
    clock.run_until(0.12)
    assert listener.ticks == [0.0, 0.01, 0.095, 0.105, 0.115]


def test_who_died_forgets_and_ticks_again_after_its_restart() -> None:
    clock = Clock(0.0)
    listener = Listener(clock)
    clock.run_until(0.005)
    listener.hang("test")
    listener.receive("frames", 10, listener.heard.append, 1)
    listener.die()
    clock.run_until(0.1)
    listener.restart()
    clock.run_until(0.115)
    assert listener.heard == []
    assert listener.ticks == [0.0, 0.1, 0.11]


def test_an_order_holds_then_the_base_has_its_time_to_react_and_then_it_must_brake() -> None:
    """order 0.5 s of braking at t = 0, never again; the base goes on as if nothing were

    t      0 ──── 0.05 ──────────── 0.35 ─────────► the allowance falls
    order  0.5    gone; beyond since 0.05, T_react = 0.3
    """
    envelope = Envelope(react_s=0.3, now_s=0.0)
    envelope.order(0.5, 0.0)
    for step in range(1, 72):
        now_s = step * 0.005
        assert envelope.bound_s(0.5, now_s) >= 0.5, now_s
    assert envelope.bound_s(0.5, 0.40) == pytest.approx(0.46, abs=0.011)
    assert envelope.bound_s(0.0, 0.41) <= 0.5


def test_of_two_sources_on_one_topic_each_order_counts_whichever_came_last() -> None:
    """every 10 ms an order of 0.5 s of braking, and 5 ms later, just before the judge looks, one of 0.1 s"""
    envelope = Envelope(react_s=0.0, now_s=0.0)
    for step in range(1, 50):
        now_s = step * 0.01
        envelope.order(0.5, now_s - 0.006)
        envelope.order(0.1, now_s - 0.001)
        assert envelope.bound_s(0.5, now_s) >= 0.5
    assert envelope.bound_s(0.0, 0.52) < 0.5


def test_a_base_that_brakes_with_its_order_is_never_beyond_it() -> None:
    envelope = Envelope(react_s=0.0, now_s=0.0)
    envelope.order(0.4, 0.0)
    assert envelope.bound_s(0.4, 0.0) == pytest.approx(0.4)
    for step in range(1, 40):
        now_s = step * 0.01
        envelope.order(0.0, now_s)
        braking_s = max(0.0, 0.4 - now_s)
        assert envelope.bound_s(braking_s, now_s) >= braking_s


def test_pulses_that_nobody_orders_have_the_time_to_react_together() -> None:
    """t 0 order of 0.5 s of braking; from 1.0 on 0.1 s of motion every 0.2 s, and nothing is ordered

    beyond  1.0-1.1  1.2-1.3  1.4-1.5  1.6: the 0.3 s are over
    """
    envelope = Envelope(react_s=0.3, now_s=0.0)
    envelope.order(0.5, 0.0)
    found = [
        now_s
        for now_s in (step * 0.01 for step in range(300))
        if (tau_s := 0.4 if now_s >= 1.0 and now_s * 5.0 % 1.0 < 0.5 else 0.0) > envelope.bound_s(tau_s, now_s)
    ]
    assert found[0] == pytest.approx(1.65, abs=0.06)
    envelope.order(0.5, 3.0)
    assert envelope.bound_s(0.4, 3.0) >= 0.4
    assert envelope.bound_s(0.4, 3.3) >= 0.4, "an order that was kept gives it its time again"


def test_several_layers_have_their_times_one_after_the_other() -> None:
    robot = campaign_robot()
    assert 0.4 < react_s(robot, layers=1) < 0.5
    assert 0.7 < react_s(robot, layers=2) < 0.85


def test_what_is_within_the_tolerance_counts_as_standing() -> None:
    robot = campaign_robot()
    assert moving_s(robot, 0.05, -0.2) == 0.0
    assert moving_s(robot, 0.86, 0.0) == pytest.approx(0.8 / robot.limits.deceleration_mps2)
    assert moving_s(robot, 0.0, -1.24) == pytest.approx(1.0 / robot.limits.angular_deceleration_radps2)


def order(wishes: Wishes, topic: str, twist: Twist, at: float) -> None:
    """Sent and received at once."""
    wishes.take(topic, twist, at)
    wishes.arrive(topic, twist, at)


def test_who_orders_motion_over_a_reset_counts_from_its_next_zero_on() -> None:
    """t   0 joystick and navigation order; 0.1 reset; joystick goes on; 0.3 zero; 0.35 it orders again"""
    robot = campaign_robot()
    wishes, forward = Wishes(robot, 0.0), Twist(0.4, 0.0)
    for at in (0.0, 0.05):
        order(wishes, "cmd_vel_joy", forward, at)
    wishes.on_stop(0.1)
    order(wishes, "cmd_vel_joy", forward, 0.2)
    assert wishes.greatest_s(0.2) == 0.0
    order(wishes, "cmd_vel_nav", forward, 0.25)
    assert wishes.greatest_s(0.25) > 0.0, "navigation had ordered nothing when the reset was done"
    order(wishes, "cmd_vel_nav", ZERO, 0.26)
    order(wishes, "cmd_vel_joy", ZERO, 0.3)
    order(wishes, "cmd_vel_joy", forward, 0.35)
    assert wishes.greatest_s(0.35) == pytest.approx(0.4 / robot.limits.deceleration_mps2)


def test_a_program_that_was_silent_for_its_time_counts_again_a_joystick_does_not() -> None:
    robot = campaign_robot()
    for topic, counts in (("cmd_vel_nav", True), ("cmd_vel_joy", False)):
        wishes = Wishes(robot, 0.0)
        order(wishes, topic, Twist(0.4, 0.0), 0.0)
        wishes.on_stop(0.1)
        order(wishes, topic, Twist(0.4, 0.0), 5.0)
        assert (wishes.greatest_s(5.0) > 0.0) is counts


def test_a_command_that_is_on_its_way_over_a_reset_was_not_held_by_what_anybody_knows() -> None:
    """t   0 navigation orders motion, which arrives at 0.4; 0.1 reset; 0.5 another reset"""
    wishes = Wishes(campaign_robot(), 0.0)
    for at in (0.0, 0.1, 0.4):
        wishes.take("cmd_vel_nav", Twist(0.4, 0.0), at)
    wishes.on_stop(0.1)
    assert wishes.greatest_s(0.4) > 0.0
    wishes.arrive("cmd_vel_nav", Twist(0.4, 0.0), 0.4)
    wishes.on_stop(0.5)
    assert wishes.greatest_s(0.5) == 0.0


def test_a_fault_that_was_added_leaves_the_scenarios_without_it_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    plans = {seed: plan.draw_plan(seed) for seed in range(60)}
    monkeypatch.setattr(plan, "ADDED", tuple(name for name in ADDED if name != "stop_requested"))
    monkeypatch.setattr(plan, "FAULTS", {name: kind for name, kind in FAULTS.items() if name != "stop_requested"})
    without = {seed for seed, each in plans.items() if "stop_requested" not in {fault.name for fault in each.faults}}
    assert 50 < len(without) < 60
    assert {seed: plan.draw_plan(seed) for seed in without} == {seed: plans[seed] for seed in without}


def test_two_orders_of_one_moment_are_two_leases_as_on_a_computer() -> None:
    """Virtual time stands still between them; two stamps of a filter never do."""
    world = World(campaign_robot(), seed=1)
    world.clock.run_until(world.clock.now_s + 2.0)
    before = dict(world.watchdog.core._leases.refused)
    decision = world.velocity.decision
    assert decision is not None
    for _ in range(2):
        world.velocity._issue(decision)
    world.clock.run_until(world.clock.now_s + 0.1)
    assert dict(world.watchdog.core._leases.refused) == before
