"""A small world: the campaign's, with its time cut as coarse as its timeouts allow, and nothing left to chance."""

from __future__ import annotations

import math
from collections.abc import Callable

from canbase_campaign.clock import Pace
from canbase_campaign.disk import StopDisk
from canbase_campaign.outside import Surroundings
from canbase_campaign.process import Process
from canbase_campaign.robots import campaign_robot
from canbase_campaign.world import World
from canbase_config.robot import Robot
from canbase_driver.supervision import state_machine
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.lifecycle import Aim
from canbase_velocity.twist import ZERO, Twist
from small_worlds.events import EVENTS, EVER_S, Event

STEP_S = 0.05
"""Of all timers."""
POINT_S = 0.2
"""Something may happen at each multiple of this."""
AFTER_S = 0.01
"""What the timers sent has arrived by then."""
COARSE = Pace(
    watchdog_tick_s=STEP_S,
    drives_poll_s=STEP_S,
    command_parts=1.0,
    topic_jitter_s=0.0,
    cycle_jitter_s=0.0,
    sdo_delay_s=0.0,
    plant_step_s=STEP_S / 5.0,
    bandwidth_radps=40.0,
)
TORN_AT = 100
"""A byte of the first of two pages."""
ENABLE_S = 0.9
"""In place of state_machine.ENABLE_TIMEOUT_S, which is longer than canonical.OLD_S."""
NEUTRAL_S = 1.0
"""In place of 2 s, for the same reason: whether a source is armed by absence must not depend on an age that is old."""
STICK_S = 0.1
"""Between two messages of the joystick."""
SPEED_MPS = 0.4
SETTLES_S = 2.4


def small_robot() -> Robot:
    """The campaign's robot with the slowest loops that its timeouts allow, and with the fastest drives."""
    robot = campaign_robot()
    watchdog = robot.watchdog.model_copy(update={"slowest_ramp_mps2": robot.limits.acceleration_mps2})
    rates = robot.rates.model_copy(
        update={"control_hz": 1.0 / STEP_S, "command_hz": 1.0 / STEP_S, "odometry_hz": 1.0, "status_hz": 25.0}
    )
    timeouts = robot.timeouts.model_copy(update={"feedback_s": 0.2})
    sources = {
        name: source if source.neutral_after_s is None else source.model_copy(update={"neutral_after_s": NEUTRAL_S})
        for name, source in robot.mux.sources.items()
    }
    mux = robot.mux.model_copy(update={"sources": sources})
    return robot.model_copy(update={"rates": rates, "timeouts": timeouts, "watchdog": watchdog, "mux": mux})


def _nobody(outcome: object) -> None:
    """No part waits for it."""


class SmallWorld:
    """One world with its operator. `resets`: outcome of each reset at the driver; `freed`: those of the filter."""

    def __init__(self, start: str) -> None:
        """Raises KeyError for a start that is not in STARTS."""
        state_machine.ENABLE_TIMEOUT_S = ENABLE_S
        self.world: World = World(small_robot(), 0, COARSE)
        self.world.bus.bitrate = math.inf  # type: ignore[assignment]
        self.around: Surroundings = Surroundings(self.world)
        self.parts: tuple[Process, ...] = (self.world.driver, self.world.watchdog, self.world.velocity)
        self.disks: dict[str, StopDisk] = {
            "driver": self.world.driver.disk,
            "watchdog": self.world.watchdog.disk,
            "velocity": self.world.velocity.disk,
        }
        self.resets: list[RequestOutcome] = []
        self.freed = 0
        self.asked_s: list[float] = []
        self.held = self._talks = False
        self.has_radio = True
        self.ends: list[tuple[float, str]] = []
        """What holds now, and until when."""
        self.world.processes["action"].die()
        self.world.enable()
        for do in BEGINS[start]:
            do(self)
            self.pass_to_point(SETTLES_S)

    def pass_to_point(self, least_s: float = POINT_S) -> None:
        """At least so much time passes, up to a moment at which something may happen: just after all timers."""
        clock = self.world.clock
        clock.run_until(math.ceil((clock.now_s - AFTER_S + least_s) / POINT_S - 1e-6) * POINT_S + AFTER_S)

    def happens(self, event: Event) -> None:
        """It begins now, and ends by itself when its time is over."""
        event.begin(self)
        if event.lasts_s < EVER_S:
            clock = self.world.clock
            end = clock.now_s - AFTER_S + event.lasts_s
            self.ends.append((end, event.name))
            clock.at(end, self._over, event.name)
        elif event.once:
            self.ends.append((math.inf, event.name))

    def turn_stick(self) -> None:
        """Push it if it is released, release it if it is held: then it sends zero, as a joystick at rest does."""
        self.held = not self.held
        if not self._talks:
            self._talks = True
            self._send()

    def reset(self) -> None:
        """Both resets, as `canbase reset` requests them."""
        self.asked_s.append(self.world.clock.now_s)
        velocity = self.world.velocity
        before = velocity.filter.estop if velocity.running else None
        velocity.reset()
        if before is not None and velocity.filter.estop is not before:
            self.freed += 1
        self.world.driver.reset(self.resets)

    def turn_lifecycle(self) -> None:
        """Deactivate the driver if it is active, activate it if it is not."""
        core = self.world.driver.core
        core.request_aim(Aim.CONFIGURED if core.aim is Aim.ACTIVE else Aim.ACTIVE, self.world.clock.now_s, _nobody)

    def kill_and_tear(self, name: str) -> None:
        """A process dies while it writes its record of stops: one of the two pages is not whole."""
        self.world.processes[name].die()
        data = self.disks[name].file.data
        if data is not None:
            data[TORN_AT] ^= 0xFF

    def _over(self, name: str) -> None:
        self.ends = [end for end in self.ends if end[1] != name]
        EVENTS[name].end(self)

    def _send(self) -> None:
        if self.has_radio:
            self.world.topics.publish("cmd_vel_joy", Twist(SPEED_MPS, 0.0) if self.held else ZERO)
        self.world.clock.after(STICK_S, self._send)


BEGINS: dict[str, tuple[Callable[[SmallWorld], None], ...]] = {
    "stopped": (lambda small: small.world.driver.stop(),),
    "stopped, stick held": (lambda small: small.world.driver.stop(), SmallWorld.turn_stick),
    "pressed, stick held": (lambda small: small.around.press(True), SmallWorld.turn_stick),
    "inactive, stick held": (SmallWorld.turn_lifecycle, SmallWorld.turn_stick),
    "standing": (lambda small: None,),
    "driving": (SmallWorld.turn_stick,),
}
STARTS = tuple(BEGINS)
"""Where a search begins: latched by a stop, the emergency stop pressed, the driver not active, ready, and driving."""
