"""What must hold in every small world, looked at after each step of its timers, against the wheels themselves."""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_campaign.envelope import Envelope, braking_s, moving_s, notice_s, react_s
from canbase_campaign.judged_by import Bounds, max_wheel_mps
from canbase_campaign.wishes import Wishes
from canbase_hazards.stated_times import QUICK_STOP_S
from canbase_sim.cia402.states import State
from canbase_sim.node import SimulatedNode
from canbase_velocity.twist import Twist
from small_worlds.events import FAULT_EVENTS
from small_worlds.world import SPEED_MPS, STEP_S, SmallWorld

PROPERTIES = {
    "fresh": "the base moves only while somebody orders it, and for the stated time after",
    "latched": "after a latched stop the base comes to a stand, and nothing moves or gets power before a reset is done",
    "watched": "no drive gets power without a watchdog that lives and is not tripped",
    "alive": "after a part stopped living the base stands, or is without power, within the stated time",
    "cut off": "a drive that receives neither watchdog nor driver stops by itself",
    "neutral": "after a reset or a restart nobody is followed who ordered motion then and has not shown zero since",
    "rest": "a world to which nothing happens any more comes to rest: the search has looked at all of its future",
    "exception": "no core raises an exception",
    "runaway": "no wheel is faster than it was ordered to be for longer than the stated time",
}
FAULTS = frozenset(event.name for event in FAULT_EVENTS)
HEARD_S = 2.0 * STEP_S
"""The button publishes at once that it is pressed, and a filter that runs takes it in its next step."""
OBEY_S = QUICK_STOP_S + 2.0 * STEP_S
"""A drive has braked by a quick stop after this: the first rung of docs/bus.md, and two steps."""
UNCHANGED = ("_small", "_world", "_lives", "_allowed")
"""Of no memory: the world itself, and what is the same for ever."""


@dataclass(frozen=True, slots=True)
class Found:
    """A property that did not hold. `at_s` in virtual time."""

    name: str
    at_s: float
    detail: str


class _Hold:
    """From its beginning on the base has to brake, to stand, and to stay there."""

    def __init__(self, react_s: float, now_s: float) -> None:
        self._envelope = Envelope(react_s, now_s)
        self._since, self._stood = now_s, False
        self._tau_s = math.inf

    def is_broken(self, tau_s: float, now_s: float, coasting: bool, react_s: float) -> bool:
        """`react_s`: what the faults of this moment leave to the layers. A base without force that slows down rolls
        out, from however fast it was: `runaway` bounds that."""
        self._envelope.react_s = react_s
        self._stood = self._stood or (tau_s == 0.0 and now_s >= self._since + OBEY_S)
        rolls_out, self._tau_s = coasting and tau_s < self._tau_s, tau_s
        beyond = tau_s > self._envelope.bound_s(tau_s, now_s, coasting)
        return (beyond and not rolls_out) or (self._stood and tau_s > 0.0)


class Properties:
    """Watches one small world; `found`: the first violation, None as long as everything holds."""

    def __init__(self, small: SmallWorld) -> None:
        self._small, self._world = small, small.world
        robot, now_s = small.world.robot, small.world.clock.now_s
        self._one_s = self._react_s = react_s(robot, layers=1)
        self._overlap_at = -math.inf
        """When two faults held last."""
        self._allowed = Bounds.of(robot)
        self._brakes_s = max(braking_s(robot, SPEED_MPS, 0.0), max_wheel_mps(robot) / robot.limits.deceleration_mps2)
        self._wishes = Wishes(robot, now_s - 10.0)
        self._fresh = Envelope(self._react_s + robot.safety.command_timeout_s, now_s)
        self._latches: set[str] = set()
        self._latched: _Hold | None = None
        self._neutral: _Hold | None = None
        self._was_enabled = small.world.driver.enabled
        self._lives = self._cores()
        self._with_power = {part.name: False for part in small.parts}
        """Whether there was power when the part was seen alive last."""
        self._born: set[str] = set()
        self._resets, self._freed = len(small.resets), small.freed
        self._watching_at = self._fast_since = self._pressed_at = now_s
        self._alive_at = {part.name: now_s for part in small.parts}
        self.found: Found | None = None
        small.world.topics.watch = self._on_message
        small.world.drives.changes()
        self._step()

    @property
    def memory(self) -> dict[str, object]:
        """What the properties remember: a part of a world's state."""
        return {name: value for name, value in vars(self).items() if name not in UNCHANGED}

    def _violate(self, name: str, detail: str) -> None:
        if self.found is None:
            self.found = Found(name, self._world.clock.now_s, detail)

    def _on_message(self, topic: str, message: object) -> None:
        if isinstance(message, Twist):
            self._wishes.take(topic, message, self._world.clock.now_s)
            self._wishes.arrive(topic, message, self._world.clock.now_s)
            if topic == "cmd_vel_joy" and message.is_zero:
                self._neutral = None

    def _step(self) -> None:
        world, now_s = self._world, self._world.clock.now_s
        base = world.drives.bench.base
        tau_s = moving_s(world.robot, base.v_mps, base.w_radps)
        coasting = tau_s > 0.0 and self._coasts()
        self._note_faults(now_s)
        self._note_new_lives(now_s)
        self._note_latches(now_s)
        self._note_starts(now_s)
        self._check_motion(tau_s, coasting, now_s)
        self._check_power(now_s)
        self._check_alive(tau_s, now_s)
        self._check_cut_off(tau_s, now_s)
        self._check_runaway(now_s)
        world.clock.after(STEP_S, self._step)

    def _note_faults(self, now_s: float) -> None:
        """As the campaign's judge: a second layer has its time while two faults hold, and for one reaction after."""
        holding = sum(name in FAULTS for _, name in self._small.ends)
        self._overlap_at = now_s if holding > 1 else self._overlap_at
        overlaps = now_s <= self._overlap_at + self._one_s
        self._react_s = self._one_s + notice_s(self._world.robot) * overlaps

    def _cores(self) -> dict[str, object]:
        world = self._world
        return {"driver": world.driver.core, "watchdog": world.watchdog.core, "velocity": world.velocity.filter}

    def _note_new_lives(self, now_s: float) -> None:
        """A part that died while there was power, or whose record of stops cannot be read, comes back latched."""
        before, self._lives = self._lives, self._cores()
        self._born = {name for name, core in self._lives.items() if core is not before[name]}
        for part in self._small.parts:
            if part.name in self._born and not self._small.disks[part.name].readable:
                self._latches.add("emergency stop" if part.name == "velocity" else part.name)
            if part.name in self._born and part.name != "velocity" and self._with_power[part.name]:
                self._latches.add(part.name)
            if part.alive:
                self._with_power[part.name] = self._powered()

    def _note_latches(self, now_s: float) -> None:
        """A latch is noted where it is seen, and forgotten by an accepted reset of its own part alone."""
        if any(outcome.done for outcome in self._small.resets[self._resets :]):
            self._latches -= {"driver", "watchdog"}
        if self._small.freed != self._freed:
            self._latches.discard("emergency stop")
        self._resets, self._freed = len(self._small.resets), self._small.freed
        self._latches |= self._seen_latched(now_s)
        if not self._latches:
            self._latched = None
        elif self._latched is None:
            self._latched = _Hold(self._react_s, now_s)

    def _seen_latched(self, now_s: float) -> set[str]:
        """A filter that ran while the button was pressed has received it."""
        driver, watchdog, velocity = self._small.parts
        if not (self._small.around.pressed and velocity.running):
            self._pressed_at = now_s
        seen = {
            "driver": driver.alive and self._world.driver.latched,
            "watchdog": watchdog.alive and self._world.watchdog.tripped,
            "emergency stop": now_s > self._pressed_at + HEARD_S,
        }
        return {name for name, is_latched in seen.items() if is_latched}

    def _note_starts(self, now_s: float) -> None:
        """Enabled, or a filter that is new: an operator who holds the joystick then has to show zero first."""
        world = self._world
        is_enabled = world.driver.alive and world.driver.enabled
        starts = is_enabled and not self._was_enabled
        self._was_enabled = is_enabled
        if (starts or "velocity" in self._born) and self._small.held:
            self._neutral = _Hold(self._react_s, now_s)

    def _check_motion(self, tau_s: float, coasting: bool, now_s: float) -> None:
        self._fresh.react_s = self._react_s + self._world.robot.safety.command_timeout_s
        self._fresh.order(self._wishes.greatest_s(now_s), now_s)
        if tau_s > self._fresh.bound_s(tau_s, now_s, coasting):
            self._violate("fresh", f"{self._speed()}, which is more than anybody orders")
        if self._latched is not None and self._latched.is_broken(tau_s, now_s, coasting, self._react_s):
            self._violate("latched", f"{self._speed()} while {' and '.join(sorted(self._latches))} latched")
        if self._neutral is not None and self._neutral.is_broken(tau_s, now_s, coasting, self._react_s):
            self._violate("neutral", f"{self._speed()}: the stick was held when it began, and never showed zero")

    def _check_power(self, now_s: float) -> None:
        world = self._world
        if world.watchdog.running and world.watchdog.watching:
            self._watching_at = now_s
        grace_s = world.robot.timeouts.watchdog_s + notice_s(world.robot) + 2.0 * STEP_S
        for change in world.drives.changes():
            if change.after is not State.OPERATION_ENABLED:
                continue
            if now_s > self._watching_at + grace_s:
                self._violate(
                    "watched", f"drive {change.node_id} on, {now_s - self._watching_at:.2f} s without watchdog"
                )
            if self._latches & {"driver", "watchdog"}:
                self._violate("latched", f"drive {change.node_id} gets power while {sorted(self._latches)} latched")

    def _check_alive(self, tau_s: float, now_s: float) -> None:
        for part in self._small.parts:
            if part.running:
                self._alive_at[part.name] = now_s
            elif now_s > self._alive_at[part.name] + self._react_s + self._brakes_s and self._powered() and tau_s > 0.0:
                self._violate(
                    "alive", f"{self._speed()}, {now_s - self._alive_at[part.name]:.2f} s without {part.name}"
                )

    def _check_cut_off(self, tau_s: float, now_s: float) -> None:
        allowed_s = self._world.robot.timeouts.drive_heartbeat_s + self._brakes_s + 2.0 * STEP_S
        heard = max(self._world.drives.heard.values())
        if now_s > heard + allowed_s and tau_s > 0.0 and self._powered():
            self._violate("cut off", f"{self._speed()}, {now_s - heard:.2f} s after the last heartbeat")

    def _check_runaway(self, now_s: float) -> None:
        wheel_mps = max(abs(axis.motor.speed_mps) for node in self._nodes() for axis in node.axes)
        if wheel_mps <= SPEED_MPS + self._allowed.runaway_mps or not self._powered():
            self._fast_since = now_s
        elif now_s > self._fast_since + self._allowed.runaway_s:
            self._violate("runaway", f"a wheel turns at {wheel_mps:.2f} m/s, {SPEED_MPS} m/s was the most ordered")

    def _nodes(self) -> list[SimulatedNode]:
        return list(self._world.drives.bench.nodes.values())

    def _powered(self) -> bool:
        return any(axis.motor.powered for node in self._nodes() for axis in node.axes)

    def _coasts(self) -> bool:
        """A wheel rolls: no power, or no force as its drive sees no motion of a dead encoder."""
        return any(self._world.drives.rolls(axis) for node in self._nodes() for axis in node.axes)

    def _speed(self) -> str:
        base = self._world.drives.bench.base
        return f"the base moves at {base.v_mps:+.3f} m/s, {math.degrees(base.w_radps):+.0f}°/s"
