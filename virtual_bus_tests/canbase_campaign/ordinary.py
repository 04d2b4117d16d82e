"""Ordinary driving of a random robot in virtual time: nothing is wrong, so nothing may trip, latch or lose its power.

Slopes, thresholds, carpet, payload, slow ramps, noise, a computer that is late now and then, and people who stop it.
What is ordinary follows from the body and the floor, never from what the robot tolerates.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Final

from canbase_campaign.clock import Pace
from canbase_campaign.hands import HANDS, Source
from canbase_campaign.outside import Surroundings
from canbase_campaign.robots import CREEP_SHARE, GRAVITY_MPS2, DrawnRobot, draw_robot
from canbase_campaign.world import World
from canbase_sim.cia402.axis import Axis
from canbase_sim.cia402.states import State
from canbase_velocity.twist import ZERO

PACE: Final = Pace(drives_poll_s=0.01, command_parts=2.0)
LOOK_S: Final = 0.02
STEEPEST: Final = 0.1
"""Slope: 10 %."""
LOADED: Final = 2.0
"""Payload of a robot that is loaded: double mass and yaw inertia."""
HOLD_S: Final = (0.02, 0.2)
"""An obstacle holds a wheel for this long, like a threshold [s]."""
HOLD_SHARE: Final = (0.2, 3.0)
"""It holds with this many times what the motor can push,"""
HIGHEST_M: Final = 0.008
"""... but no harder than an edge of this height holds the wheel that has to climb it: higher ones stop small wheels."""
CARPET: Final = (1.0, 1.0, 2.0, 4.0)
"""Dry friction, in multiples of the bare floor's."""
TURNS_ROUND_M: Final = 0.004
"""A drive that has to turn its torque round against the friction does so within this way: one that is softer is not
tuned for its floor."""
RAMP_SHARES: Final = (1.0, 1.0, 0.5, 0.3)
"""The drives' own ramps, as a share of the limits' acceleration: as set, by half, and by a third."""
NOISE_MPS: Final = (0.0, 0.0, 0.002, 0.005)
"""606Ch beside the true speed, of drives that measure badly; below base.standstill_mps, or the base never stands."""
LATE_S: Final = {"driver": 0.02, "watchdog": 0.06, "velocity": 0.05, "action": 0.1}
"""A process may get no processor for this long now and then [s]: the less priority, the longer."""
LET_GO: Final = (State.SWITCHED_ON, State.SWITCH_ON_DISABLED)
"""At a stand the driver takes the power off for a moment, which may be over at the next look: docs/decisions/0041."""
ROLLS_MPS: Final = 0.1
"""On a slope the wheels roll a little meanwhile."""
STORY: Final = 40


@dataclass(frozen=True, slots=True)
class FalseTrip:
    """Something stopped a robot that did nothing wrong. `story`: what had happened before."""

    seed: int
    at_s: float
    what: str
    robot: str
    story: tuple[str, ...]


class OrdinaryHour:
    """One robot that drives for a while. Nothing here is random but by its seed, which is also the robot's number."""

    def __init__(
        self,
        seed: int,
        pace: Pace = PACE,
        loaded: bool = False,
        drawn: DrawnRobot | None = None,
        steepest: float = STEEPEST,
    ) -> None:
        """`loaded`: with double payload, and never on a level floor. `drawn`: this robot in place of the seed's.

        `steepest`: slope of the floor at most, as a share.
        """
        self.seed, self.random = seed, Random(f"ordinary {seed}")
        self._loaded, self._steepest = loaded, steepest
        self.drawn = drawn or (draw_robot(seed, LOADED) if loaded else draw_robot(seed))
        self.world = World(seed=seed, pace=pace, drawn=self.drawn)
        self.around = Surroundings(self.world, has_scanner=self.drawn.robot.safety.scan.required)
        self._start = self.world.clock.now_s
        self.moving_s = 0.0
        """How long the base has been moving [s]."""
        self._story: deque[str] = deque(maxlen=STORY)
        self.world.note = self._note
        self._ramps = self.random.choice(RAMP_SHARES)
        self._noise_mps = self.random.choice(NOISE_MPS)
        narrow = any(drive.kind.layout.velocity_bits == 16 for drive in self.drawn.robot.drives)
        self._velocity = struct.Struct("<h" if narrow else "<i")
        if self._noise_mps:
            self.world.drives.measured = self._measured
        self._carpet()

    @property
    def now_s(self) -> float:
        """Since power on [s]."""
        return self.world.clock.now_s - self._start

    def run(self, seconds: float) -> FalseTrip | None:
        """From power on; the first false trip, at which it ends."""
        try:
            self.world.enable()
        except RuntimeError as error:
            return self._found(str(error))
        self.world.drives.changes()
        self._begin()
        return self.go_on(seconds - self.now_s)

    def go_on(self, seconds: float) -> FalseTrip | None:
        """So much longer."""
        end = self.world.clock.now_s + seconds
        while self.world.clock.now_s < end:
            self.world.clock.run_until(self.world.clock.now_s + LOOK_S)
            self.moving_s += 0.0 if self.world.drives.bench.base.resting else LOOK_S
            what = self._wrong()
            if what:
                return self._found(what)
        return None

    def _wrong(self) -> str:
        """What is not as it should be; empty: nothing."""
        watchdog, driver = self.world.watchdog, self.world.driver.core
        if watchdog.tripped:
            return f"watchdog: {watchdog.trip_cause}: {watchdog.core.status.verdict.detail}"
        if not self.world.driver.enabled:
            return f"driver: {driver.state.name.lower()}: {driver.finding.cause.value}: {driver.finding.detail}"
        for change in self.world.drives.changes():
            lets_go = change.after in LET_GO and self._stands
            if change.before is State.OPERATION_ENABLED and not lets_go:
                return f"drive {change.node_id}, axis {change.axis}: {change.before.name} → {change.after.name}"
        return ""

    @property
    def _stands(self) -> bool:
        base = self.world.drives.bench.base
        return max(abs(base.v_left_mps), abs(base.v_right_mps)) <= ROLLS_MPS

    def _found(self, what: str) -> FalseTrip:
        setup = f"{self.drawn}, ramps × {self._ramps:g}, noise {self._noise_mps:g} m/s"
        return FalseTrip(self.seed, self.now_s, what, setup, tuple(self._story))

    def _note(self, text: str) -> None:
        base = self.world.drives.bench.base
        speeds = f"wheels {base.v_left_mps:+.3f} {base.v_right_mps:+.3f} m/s"
        self._story.append(f"{self.now_s:9.3f} s  {text}; {speeds}")

    def _begin(self) -> None:
        self._change_hands()
        self._change_slope()
        self._later(self.random.uniform(1.0, 8.0), self._hold)
        self._later(self.random.uniform(1.0, 5.0), self._be_late)
        self._later(self.random.uniform(5.0, 30.0), self._interrupt)

    def _later(self, delay_s: float, do: Callable[..., None], *arguments: object) -> None:
        self.world.clock.after(delay_s, do, *arguments)

    # The source that drives

    def _change_hands(self) -> None:
        sources = self.drawn.robot.mux.sources
        name = self.random.choice([name for name, (source, _) in HANDS.items() if source in sources])
        source, hands = HANDS[name]
        self._note(f"{name} drives")
        topic = self.drawn.robot.mux.sources[source].topic
        lasts_s = self.random.uniform(2.0, 15.0)
        until = self.world.clock.now_s + lasts_s
        self._publish(topic, hands(self.random, self.drawn.robot.limits), until)
        self._later(lasts_s + self.random.choice((0.0, 0.0, 0.1, 1.0)), self._change_hands)

    def _publish(self, topic: str, source: Source, until: float) -> None:
        """At its end it releases the joystick, or stops publishing."""
        wait_s, twist = next(source)
        if self.world.clock.now_s >= until:
            if self.random.random() < 0.7:
                self.world.topics.publish(topic, ZERO)
            return
        self.world.topics.publish(topic, twist)
        self._later(wait_s, self._publish, topic, source, until)

    # The floor and the load

    def _carpet(self) -> None:
        """Thick carpet or bare floor, within what the motors can overcome."""
        body, base = self.drawn.body, self.world.drives.bench.base
        factor = self.random.choice(CARPET)
        room_n = min(body.peak_force_n - self._needs_n(), CREEP_SHARE * body.peak_force_n - body.coulomb_n)
        tuned_for_kg = body.mass_kg / len(self.drawn.robot.drives) + body.wheel_mass_kg
        stiffness_npm = tuned_for_kg * (body.bandwidth_radps / 2.0) ** 2
        most_n = TURNS_ROUND_M * stiffness_npm / 2.0 - body.coulomb_n
        self._carpet_n = max(0.0, min((factor - 1.0) * body.coulomb_n, room_n / 2.0, most_n))
        self._slope_n = max(0.0, room_n - self._carpet_n)
        for side in ("left", "right"):
            base.hold(side, self._carpet_n * len(self.drawn.robot.drives) / 2.0)

    def _needs_n(self) -> float:
        """Force of a motor on level, bare floor, for the limits' acceleration at the limits' speed [N]."""
        body, robot = self.drawn.body, self.drawn.robot
        wheels, limits, half_m = len(robot.drives), robot.limits, robot.base.track_m / 2.0
        mass_kg = body.mass_kg * body.payload_factor
        straight = (mass_kg / wheels + body.wheel_mass_kg) * limits.acceleration_mps2
        turning = mass_kg * (body.yaw_gyration_m / half_m) ** 2 / wheels + body.wheel_mass_kg
        turning *= limits.angular_acceleration_radps2 * half_m
        return straight + turning + body.coulomb_n + body.viscous_nspm * limits.linear_mps

    def _change_slope(self) -> None:
        """Up or down, no steeper than the motors climb while they accelerate."""
        body, base, wheels = self.drawn.body, self.world.drives.bench.base, len(self.drawn.robot.drives)
        weight_n = GRAVITY_MPS2 * body.mass_kg * body.payload_factor
        most_n = min(self._steepest * weight_n, wheels * self._slope_n)
        if self._loaded:
            base.push_n = most_n * self.random.choice((-1.0, 1.0)) * self.random.uniform(0.5, 1.0)
        else:
            base.push_n = most_n * self.random.choice((0.0, 0.0, self.random.uniform(-1.0, 1.0)))
        self._note(f"slope {base.push_n / weight_n:+.1%}")
        self._slow_ramps()
        self._later(self.random.uniform(2.0, 20.0), self._change_slope)

    def _hold(self) -> None:
        """A threshold."""
        force_n = min(self.random.uniform(*HOLD_SHARE) * self.drawn.body.peak_force_n, self._edge_n())
        sides = self.random.choice((("left",), ("right",), ("left", "right")))
        self._note(f"threshold: {' and '.join(sides)} held with {force_n:.0f} N a wheel")
        self._hold_sides(sides, force_n)
        self._later(self.random.uniform(*HOLD_S), self._let_loose, sides)
        self._later(self.random.uniform(1.0, 8.0), self._hold)

    def _edge_n(self) -> float:
        """Until it has climbed an edge of HIGHEST_M the load on a wheel holds it with weight × tan, cos = 1 - h / r."""
        body, robot = self.drawn.body, self.drawn.robot
        weight_n = GRAVITY_MPS2 * body.mass_kg * body.payload_factor / len(robot.drives)
        return weight_n * math.tan(math.acos(1.0 - HIGHEST_M / robot.base.wheel_radius_m))

    def _let_loose(self, sides: tuple[str, ...]) -> None:
        self._hold_sides(sides, 0.0)

    def _hold_sides(self, sides: tuple[str, ...], force_n: float) -> None:
        for side in sides:
            self.world.drives.bench.base.hold(side, (self._carpet_n + force_n) * len(self.drawn.robot.drives) / 2.0)

    # The drives

    def _axes(self) -> list[Axis]:
        return [axis for node in self.world.drives.bench.nodes.values() for axis in node.axes]

    def _slow_ramps(self) -> None:
        """The drives' own ramps upward are slower than the driver's setpoints; down they are those of the limits."""
        if self._ramps < 1.0:
            for axis in self._axes():
                axis.ramp_up_mps2 = self._ramps * self.drawn.robot.limits.acceleration_mps2

    def _measured(self, cob_id: int, data: bytes) -> bytes:
        """606Ch with noise, and the torque behind it as it is."""
        if cob_id & 0x780 not in (0x280, 0x480):
            return data
        node = self.world.drives.bench.nodes[cob_id & 0x7F]
        noise = round(self.random.uniform(-1.0, 1.0) * self._noise_mps / abs(node.axes[0].scale.actual_mps))
        form = self._velocity
        if len(data) < form.size:  # the drive's own mapping, before its boot
            return data
        return form.pack(form.unpack_from(data)[0] + noise) + data[form.size :]

    # The computer and its people

    def _be_late(self) -> None:
        """A process waits for its processor."""
        name = self.random.choice(tuple(LATE_S))
        process, late_s = self.world.processes[name], self.random.uniform(0.005, LATE_S[name])
        self._note(f"{name} is late by {late_s * 1000.0:.0f} ms")
        process.hang("late")
        self._later(late_s, process.go_on, "late")
        self._later(self.random.uniform(0.5, 5.0), self._be_late)

    def _interrupt(self) -> None:
        """A person presses the emergency stop and resets it, or walks before the base; a goal is sent."""
        what = self.random.choice((self._press, self._walk_by, self._ask_for_goal, self._ask_for_goal))
        what()
        self._later(self.random.uniform(5.0, 30.0), self._interrupt)

    def _press(self) -> None:
        self._note("emergency stop pressed")
        self.around.press(True)
        pressed_s = self.random.uniform(0.1, 3.0)
        self._later(pressed_s, self.around.press, False)
        self._later(pressed_s + self.random.uniform(0.3, 2.0), self._reset)

    def _reset(self) -> None:
        """The emergency stop ends by a reset, which needs a released joystick."""
        self.world.velocity.reset()
        if self.world.velocity.holds_stop:
            self._later(0.5, self._reset)

    def _walk_by(self) -> None:
        self._note("somebody walks before the base")
        self.around.put_wall(self.random.uniform(0.0, 0.5))
        self._later(self.random.uniform(0.5, 3.0), self.around.take_wall)

    def _ask_for_goal(self) -> None:
        limits = self.drawn.robot.limits
        distance_m = self.random.choice((-1.0, 1.0)) * self.random.uniform(0.05, 2.0)
        self._note(f"a goal of {distance_m:+.2f} m")
        self.world.action.send_goal(distance_m, self.random.uniform(0.1, 1.0) * limits.linear_mps)
