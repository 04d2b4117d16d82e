"""A joystick that is held while parts come and go, with all real cores in virtual time: what stays still until it is
released. Each story shows first that the joystick works, and at the end that it works again. Times in s.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from canbase_campaign.outside import Surroundings
from canbase_campaign.robots import campaign_robot
from canbase_campaign.world import World
from canbase_config.robot import Robot
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_runtime.driver_state import DriverState
from canbase_velocity.neutral import Arming
from canbase_velocity.twist import ZERO, Twist

FORWARD = Twist(0.3, 0.0)
STICK_HZ = 20.0
RESTS_M = 0.002
READY_S = 8.0


class Hand:
    """A person at the joystick. `holds`: what the joystick orders; None: it publishes nothing."""

    def __init__(self, topic: str = "cmd_vel_joy", robot: Robot | None = None) -> None:
        self.world = World(robot)
        self.around = Surroundings(self.world)
        self.holds: Twist | None = None
        self._topic = topic
        self._send()

    def _send(self) -> None:
        if self.holds is not None:
            self.world.topics.publish(self._topic, self.holds)
        self.world.clock.after(1.0 / STICK_HZ, self._send)

    def run(self, seconds: float) -> float:
        """Let time pass; how far the base went meanwhile [m]."""
        base = self.world.drives.bench.base
        before_m = base.path_m
        self.world.clock.run_until(self.world.clock.now_s + seconds)
        return base.path_m - before_m

    def wait_enabled(self) -> None:
        """Until the drives have power; a reset where one is needed."""
        outcomes: list[RequestOutcome] = []
        for _ in range(round(READY_S / 0.1)):
            self.run(0.1)
            if self.world.driver.core.state is DriverState.ENABLED:
                return
            if self.world.driver.core.state is DriverState.LATCHED:
                self.world.velocity.reset()
                self.world.driver.reset(outcomes)
        raise AssertionError(f"{self.world.driver.core.state}: {self.world.driver.core.finding} {outcomes}")

    def stays(self, seconds: float = 3.0) -> bool:
        """The base does not move."""
        return self.run(seconds) < RESTS_M

    def drives(self) -> bool:
        """The base follows the joystick, after it was released."""
        self.holds = ZERO
        self.run(0.3)
        self.holds = FORWARD
        return self.run(1.5) > 0.2


@pytest.fixture
def hand() -> Hand:
    """The robot is enabled, and follows the joystick, which is held."""
    hand = Hand()
    hand.world.enable()
    assert hand.drives()
    return hand


def driver_restarts(hand: Hand) -> None:
    hand.world.driver.die()
    hand.run(2.0)
    hand.world.driver.restart()


def velocity_restarts(hand: Hand) -> None:
    hand.world.velocity.die()
    hand.run(2.0)
    hand.world.velocity.restart()


def watchdog_restarts(hand: Hand) -> None:
    hand.world.watchdog.die()
    hand.run(2.0)
    hand.world.watchdog.restart()


def all_restart(hand: Hand) -> None:
    for process in hand.world.processes.values():
        process.die()
    hand.run(2.0)
    for process in hand.world.processes.values():
        process.restart()


def stop_service(hand: Hand) -> None:
    hand.world.driver.stop()
    hand.run(2.0)


def estop_pressed_and_released(hand: Hand) -> None:
    hand.around.press(True)
    hand.run(2.0)
    hand.around.press(False)
    hand.run(0.3)


def reset_while_no_scan_comes(hand: Hand) -> None:
    """The filter orders zero, so the driver accepts a reset; then the scans return."""
    hand.around.scans = False
    hand.run(1.0)
    hand.world.driver.stop()
    hand.run(2.0)
    hand.wait_enabled()
    hand.run(1.0)
    hand.around.scans = True


def reset_before_an_obstacle(hand: Hand) -> None:
    """The same with a wall ahead, which is taken away."""
    hand.around.put_wall(0.05)
    hand.run(3.0)
    hand.world.driver.stop()
    hand.run(2.0)
    hand.wait_enabled()
    hand.run(1.0)
    hand.around.take_wall()


def scans_return(hand: Hand) -> None:
    """Without any stop in between; nothing is reset."""
    hand.around.scans = False
    hand.run(2.0)
    hand.around.scans = True


EVENTS = (
    driver_restarts,
    velocity_restarts,
    watchdog_restarts,
    all_restart,
    stop_service,
    estop_pressed_and_released,
    reset_while_no_scan_comes,
    reset_before_an_obstacle,
    scans_return,
)


@pytest.mark.parametrize("event", EVENTS)
def test_a_stick_held_over_it_moves_nothing_until_it_is_released(hand: Hand, event: Callable[[Hand], None]) -> None:
    event(hand)
    hand.world.velocity.reset()
    assert hand.world.drives.bench.base.v_mps == pytest.approx(0.0, abs=1e-3)
    before_m = hand.world.drives.bench.base.path_m
    hand.wait_enabled()
    assert hand.stays()
    assert hand.world.drives.bench.base.path_m - before_m < RESTS_M
    hand.holds = ZERO
    hand.run(0.2)
    hand.world.velocity.reset()  # an emergency stop waits for it, and refused it while the joystick was held
    assert hand.drives()


def test_a_stick_that_is_held_at_power_on_moves_nothing_until_it_is_released() -> None:
    hand = Hand()
    hand.holds = FORWARD
    hand.wait_enabled()
    assert hand.stays(10.0)
    assert hand.drives()


def test_a_slow_scanner_at_power_on_does_not_release_a_held_stick() -> None:
    hand = Hand()
    hand.holds, hand.around.scans = FORWARD, False
    hand.wait_enabled()
    hand.run(2.0)
    hand.around.scans = True
    assert hand.stays(5.0)
    assert hand.drives()


@pytest.mark.parametrize("gap_s", [0.45, 1.0, 3.0])
def test_a_radio_gap_after_a_reset_is_no_release(hand: Hand, gap_s: float) -> None:
    stop_service(hand)
    hand.wait_enabled()
    hand.holds = None  # the mux orders zero, for which the driver waits
    hand.run(gap_s)
    hand.holds = FORWARD  # the joystick was never released
    assert hand.stays()
    assert hand.drives()


@pytest.mark.parametrize("gap_s", [0.45, 1.0, 3.0])
def test_a_radio_gap_across_a_reset_is_no_release(hand: Hand, gap_s: float) -> None:
    hand.holds = None
    hand.run(gap_s / 2)
    stop_service(hand)
    hand.wait_enabled()
    hand.run(gap_s / 2)
    hand.holds = FORWARD
    assert hand.stays()
    assert hand.drives()


@pytest.mark.parametrize(("gap_s", "followed"), [(0.5, True), (1.0, True), (1.6, False), (5.0, False)])
def test_a_gap_in_the_scans_counts_like_a_stop_once_the_base_has_been_held_for_a_second(
    hand: Hand, gap_s: float, followed: bool
) -> None:
    hand.around.scans = False
    hand.run(gap_s)
    hand.around.scans = True
    hand.run(0.5)
    assert (hand.run(1.0) > 0.1) is followed
    assert hand.drives()


def test_navigation_goes_on_when_the_scans_return() -> None:
    hand = Hand("cmd_vel_nav")
    hand.wait_enabled()
    assert hand.drives()
    scans_return(hand)
    assert hand.run(1.5) > 0.2


def test_navigation_that_was_idle_starts_with_a_velocity_and_not_while_it_goes_on_over_a_reset() -> None:
    hand = Hand("cmd_vel_nav")
    hand.wait_enabled()
    hand.run(2.1)
    hand.holds = FORWARD
    assert hand.run(1.5) > 0.2
    stop_service(hand)
    hand.wait_enabled()
    assert hand.stays(5.0)
    hand.holds = None
    hand.run(2.1)
    hand.holds = FORWARD
    assert hand.run(1.5) > 0.2


def slow_pad() -> Robot:
    """Its joystick is active for 2 s without a message, and absent after 1 s; its emergency stop needs no reset."""
    robot = campaign_robot()
    pad = robot.mux.sources["joystick"].model_copy(update={"timeout_s": 2.0, "neutral_after_s": 1.0})
    mux = robot.mux.model_copy(update={"sources": {**robot.mux.sources, "joystick": pad}})
    estop = robot.safety.estop.model_copy(update={"latched": False})
    return robot.model_copy(update={"mux": mux, "safety": robot.safety.model_copy(update={"estop": estop})})


# 0.5 m/s ── the joystick's program ends ── 0.1 the stop is pressed ── 0.8 released; `canbase config check` refuses this
# pair of keys since, and a mux that has it holds all the same
def test_a_joystick_that_ended_before_an_emergency_stop_moves_nothing_after_it() -> None:
    hand = Hand(robot=slow_pad())
    hand.wait_enabled()
    hand.holds = ZERO
    hand.run(0.3)
    hand.holds = Twist(0.5, 0.0)
    assert hand.run(1.5) > 0.3
    hand.holds = None
    hand.run(0.1)
    hand.around.press(True)
    hand.run(0.7)
    hand.around.press(False)
    hand.run(0.1)
    assert hand.stays(5.0)
    assert hand.drives()


@pytest.mark.parametrize("event", [driver_restarts, velocity_restarts, stop_service, reset_while_no_scan_comes])
def test_without_neutral_start_the_base_drives_off(
    hand: Hand, event: Callable[[Hand], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stories above can fail: this is what happened before there was a neutral start."""
    monkeypatch.setattr(Arming, "armed", property(lambda self: True))
    event(hand)
    if event is not reset_while_no_scan_comes:
        hand.holds = None  # a radio gap, in which the driver sees its zero
        hand.run(0.4)  # longer than its last command counts: the filter accepts a reset
        hand.wait_enabled()
        hand.holds = FORWARD
    assert not hand.stays()
