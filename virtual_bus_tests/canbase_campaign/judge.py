"""What must hold in every scenario, whatever goes wrong: looked at every 10 ms, against the ground truth.

properties.py has each property's sentence, and what no software can do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_campaign.action_process import Goal
from canbase_campaign.allowance import LADDER_S, Active, Allowance, is_late
from canbase_campaign.envelope import (
    BUS_S,
    ORDER_S,
    TICK_S,
    braking_s,
    coasting_share,
    moving_s,
    notice_s,
    pivot_share,
    react_s,
)
from canbase_campaign.excuses import STEP_S, Faults, Ledger
from canbase_campaign.goal_judge import GoalJudge
from canbase_campaign.judged_by import CYCLES, MESSAGE_S, jerk_adds_s, lag_s, max_wheel_mps
from canbase_campaign.motion_judge import MotionJudge
from canbase_campaign.odometry_judge import OdometryJudge
from canbase_campaign.outside import Outside, Surroundings
from canbase_campaign.pause_judge import PauseJudge
from canbase_campaign.planned import Plan
from canbase_campaign.reach import BRAKES_S, Reach
from canbase_campaign.rest_judge import RestJudge
from canbase_campaign.robots import DrawnRobot
from canbase_campaign.short_judge import ShortJudge
from canbase_campaign.shown import Shown
from canbase_campaign.strangers import SENT_S, Strangers
from canbase_campaign.wishes import Wishes
from canbase_campaign.world import World
from canbase_hazards.stated_times import QUICK_STOP_S
from canbase_sim.cia402.states import State
from canbase_velocity.twist import ZERO, Twist

RAMP_LATE_S = 0.3
"""One drive of several may still be on its own ramp, when the others that held it have released."""
ROUNDING_S = 0.002
"""Of τ, from one step to the next one."""
TURNED_RAD = 0.35
"""What was ahead of a base that has turned by so much is beside it."""
SWING_SHARE, SWING_S = 0.1, 0.3
"""Of the speed that it braked from: a loaded base swings back with its drives' velocity loops, for this long [s]."""
OWN_TIMER_S = TICK_S + BUS_S + STEP_S
"""A drive's own timer, the frame it misses, and the judge's next look [s]."""
HEARD_S = 0.3
"""The stop button publishes ten times a second that it is pressed: the filter has received it then, if it runs."""
FOUND_S = 0.6
"""After its start a process has found the publishers of a topic."""


def longest_lag_s(drawn: DrawnRobot) -> float:
    """From an order of the filter until the wheels brake, the soft begin of the ramp included [s]."""
    rates, limits = drawn.robot.rates, drawn.robot.limits
    return MESSAGE_S + CYCLES / rates.control_hz + lag_s(drawn.body) + jerk_adds_s(limits)


@dataclass(frozen=True, slots=True)
class Violation:
    """A property that did not hold. `at_s` from the start of the scenario."""

    name: str
    at_s: float
    detail: str


class Judge:
    """Watches one scenario. `violations`: the first one of each property."""

    def __init__(self, world: World, around: Surroundings, outside: Outside, plan: Plan) -> None:
        self._world, self._around, self._outside = world, around, outside
        self._start = now_s = world.clock.now_s
        self.violations: list[Violation] = []
        self.ledger, self._active = Ledger(), Active()
        self._sped_up = False
        self._one_s, self._max_wheel_mps = react_s(world.robot, layers=1), max_wheel_mps(world.robot)
        self.react_s = self._one_s
        """Of the layers that the faults of this moment leave [s]."""
        self._faults = Faults(plan, now_s, self._one_s)
        self._coasting, self._pivot = coasting_share(world.drawn), pivot_share(world.robot)
        self._reach, self._strangers, self._shown = Reach(world), Strangers(world), Shown(world)
        self._envelope = self._allowance("envelope", self._one_s)
        self._wishes = Wishes(world.robot, now_s)
        self._wish = self._allowance("sources", self._one_s + world.robot.safety.command_timeout_s)
        sees_s = world.robot.safety.scan.timeout_s + 2.0 * around.scan_s + longest_lag_s(world.drawn)
        self._blind = self._allowance("blind", sees_s)
        self._touched = False
        self._leased, self._leased_at = ZERO, -math.inf
        self._awaits_zero = self._pushed = False
        self._rests_since = math.inf
        """When the last reset was done, as long as no source has had the base move since."""
        self._hold: Allowance | None = None
        self._from_mps = self._from_tau_s = self._acts_s = self._acted_s = 0.0
        """The fastest wheel since something is latched; how long its last mover may still act, and how long it did."""
        self._acted_at = -math.inf
        self._stood = False
        self._latched_at = self._again_since = self._tripped_at = now_s
        self._again_tau_s = 0.0
        self._latches: dict[str, object] = {}
        self._resets_done = 0
        self._watching_at = now_s
        self._off_since = math.inf
        """When an operator switched motor_driver off, whatever a new process makes of it; infinity: nobody has."""
        self._pressed_at, self._unheard_at, self._lock_from = math.inf, -math.inf, -math.inf
        self._pressed_gives: dict[str, float] = {}
        """The most that each excuse gave since the button was pressed: what came late then stays late."""
        self._suspended_s = 0.0
        self._odometry = OdometryJudge(world, self._shown, self.ledger)
        self._goals = GoalJudge(world, self._shown, self.ledger)
        self._motion = MotionJudge(world, self._shown, self.ledger)
        self._short = ShortJudge(world, self._shown, self.ledger)
        self._rest = RestJudge(world, self._shown, self.ledger)
        holds_s = self._one_s + world.robot.safety.command_timeout_s
        self._pauses = PauseJudge(world, self._allowance("pauses", holds_s))
        self.trips: list[str] = []
        self.lives, self._fresh = 1, False
        """How often the base drove, with a reset between; whether one was done, and it has not moved since."""
        world.on_lease = self._on_lease
        world.on_goal_end = self._on_goal_end
        world.action.on_order = self._on_goal_order
        world.topics.watch = self._on_message
        world.topics.arrivals |= {source.topic: self._on_arrival for source in world.robot.mux.sources.values()}
        world.topics.arrivals[world.robot.safety.scan.topic] = self._on_scan
        self._step()

    @property
    def at_rest(self) -> bool:
        """Something is latched, and the base has come to a stand since."""
        return bool(self._latches) and self._stood

    @property
    def longest_goal_s(self) -> float:
        """No goal of this scenario may take longer [s]."""
        return self._goals.longest_s

    def finish(self) -> None:
        """The scenario is over: no goal may be left."""
        problem = self._goals.left()
        if problem:
            self._violate("goal", problem)

    def _allowance(self, name: str, base_s: float) -> Allowance:
        return Allowance(name, self.ledger, base_s, self._world.clock.now_s, self._coasting, self._pivot)

    def _look_at_faults(self, tau_s: float, now_s: float) -> None:
        """What is active at this moment."""
        active, robot = self._active, self._world.robot
        self._faults.step(now_s)
        active.coasting = tau_s > 0.0 and self._coasts()
        active.lost = self._reach.lost
        active.second_fault_s = notice_s(robot) * self._faults.overlap(now_s)
        active.late_s = 2.0 * self._world.bus.disturbance.late_s
        active.ladder_s = LADDER_S * (now_s <= self._strangers.ordered_on_bus_at + self._one_s)
        self.react_s = self._one_s + active.more_s

    def _violate(self, name: str, detail: str) -> None:
        if all(violation.name != name for violation in self.violations):
            self.violations.append(Violation(name, self._world.clock.now_s - self._start, detail))
            self._world.note(f"VIOLATION of {name}: {detail}")

    def _on_lease(self, twist: Twist) -> None:
        if self._awaits_zero and not twist.is_zero:
            self._violate("zero", f"{twist} is ordered, and the command was not zero since the emergency stop")
        locked_s = self._locked_s(self._world.clock.now_s)
        if locked_s > HEARD_S and not twist.is_zero:
            self._violate("locked", f"{twist} is ordered, {locked_s:.2f} s after a lock was closed")
        self._leased, self._leased_at = twist, self._world.clock.now_s
        tau_s = braking_s(self._world.robot, twist.linear_mps, twist.angular_radps)
        self._envelope.order(tau_s, self._world.clock.now_s)
        self._motion.order(twist)
        self._rest.order(twist.is_zero, self._world.clock.now_s)

    def _on_scan(self, topic: str, scan: object) -> None:
        self._pauses.on_scan(self._world.clock.now_s)

    def _locked_s(self, now_s: float) -> float:
        """So long a lock holds that the mux can know of."""
        return now_s - max(self._world.locked_at, self._lock_from)

    def _on_message(self, topic: str, message: object) -> None:
        """What the sources want; and a command of zero after an emergency stop, before anything else is ordered."""
        now_s = self._world.clock.now_s
        if topic == "odom":
            problem = self._odometry.take(message, now_s)
            if problem:
                self._violate("odometry", problem)
        if not isinstance(message, Twist):
            return
        self._wishes.take(topic, message, now_s)
        self._pauses.take(topic, message, now_s)
        if topic == "cmd_vel_mux" and message.is_zero and not self._around.pressed:
            self._awaits_zero = False

    def _on_arrival(self, topic: str, message: Twist) -> None:
        self._wishes.arrive(topic, message, self._world.clock.now_s)
        self._pauses.arrive(topic, message, self._world.clock.now_s)
        self._goals.arrived(topic, message)

    def _on_goal_order(self, twist: Twist) -> None:
        problem = self._goals.ordered(twist)
        if problem:
            self._violate("over", problem)

    def _step(self) -> None:
        now_s = self._world.clock.now_s
        self._shown.look()
        tau_s = moving_s(self._world.robot, self._shown.linear_mps, self._shown.angular_radps)
        self.ledger.step(tau_s > 0.0, now_s)
        self._reach.step(tau_s == 0.0)
        self._strangers.step(now_s)
        if self._world.computer.suspended_s > self._suspended_s:  # neutral start: nothing from before it holds
            self._suspended_s = self._world.computer.suspended_s
            self._wishes.on_stop(now_s)
        self._look_at_faults(tau_s, now_s)
        self._check_latches(now_s)
        self._check_speed(tau_s, now_s)
        self._check_neutral(tau_s, now_s)
        self._check_drives(now_s)
        self._check_stop_button(tau_s, now_s)
        self._check_short(now_s)
        self._check_rest(tau_s, now_s)
        if not self._world.velocity.running:
            self._lock_from = now_s + FOUND_S
        self._check_wall(tau_s, now_s)
        if self._fresh and tau_s > 0.0 and not self._latches:
            self.lives, self._fresh = self.lives + 1, False
        self._goals.step(locked=self._locked_s(now_s) > HEARD_S)
        self._odometry.step(now_s)
        name, detail = self._motion.step(now_s, self._reach.lost)
        if name:
            self._violate(name, detail)
        self._world.clock.after(STEP_S, self._step)

    def _check_wall(self, tau_s: float, now_s: float) -> None:
        """Where the scanner reports that it sees nothing the base may creep, and so touch what is there."""
        blind = self._around.scanner is not None and self._around.scanner.hides and self._shown.linear_mps > 0.0
        robot, linear_mps = self._world.robot, self._shown.linear_mps
        self._sped_up = now_s > self._around.wall_at and (self._sped_up or abs(linear_mps) > self._around.room_mps)
        slowly_s, ahead_s = braking_s(robot, robot.safety.blind_mps, 0.0), moving_s(robot, linear_mps, 0.0)
        self._blind.order(slowly_s if blind else max(slowly_s, ahead_s), now_s)
        allowed_s = self._blind.bound_s(ahead_s, now_s, self._active)
        strange = now_s <= self._strangers.acted_at + self.react_s
        if blind and ahead_s > allowed_s and not (strange and self.ledger.excuse("blind", "strange hands")):
            self._violate(
                "blind", f"{self._shown} where no scanner sees: {ahead_s:.3f} s to stop, {allowed_s:.3f} allowed"
            )
        if min(self._around.free_m) >= 0.0:
            self._touched = False
        elif not self._touched and not self._may_touch(blind, tau_s <= slowly_s, now_s):
            self._touched = True
            self._violate("obstacle", f"touched at {self._shown}")

    def _may_touch(self, blind: bool, slow: bool, now_s: float) -> bool:
        """A base that the filter does not order against the wall, and that is moved by what no layer can know."""
        if blind and slow:
            return self.ledger.excuse("obstacle", "creeps")
        rows = {
            "unreachable": self._reach.was_lost,
            "strange hands": self._was_pushed(),
            "lying sensor": self._motion.ran_away,
            "sped up": self._sped_up,
            "turned away": self._around.turned_rad > TURNED_RAD,
            "second fault": self._faults.overlap_at >= self._around.wall_at - self._one_s,
        }
        row = next((row for row, holds in rows.items() if holds), "")
        return bool(row) and not self._orders_into(blind, now_s) and self.ledger.excuse("obstacle", row)

    def _orders_into(self, blind: bool, now_s: float) -> bool:
        """Whatever moved the base there, the filter orders motion on against the wall."""
        ahead_m, behind_m = self._around.free_m
        towards_mps = self._leased.linear_mps * (1.0 if ahead_m < behind_m else -1.0)
        return self._is_leased(now_s) and towards_mps > (self._world.robot.safety.blind_mps if blind else 0.0)

    def _check_speed(self, tau_s: float, now_s: float) -> None:
        allowed_s = self._envelope.bound_s(tau_s, now_s, self._active)
        if tau_s > allowed_s:
            self._violate("envelope", f"{self._shown}: {tau_s:.3f} s to stop, the leases allow {allowed_s:.3f} s")
        self._wish.order(self._wishes.greatest_s(now_s), now_s)
        allowed_s = self._wish.bound_s(tau_s, now_s, self._active)
        if tau_s > allowed_s:
            self._violate("sources", f"{self._shown}: {tau_s:.3f} s to stop, the sources want {allowed_s:.3f} s")
        if self._hold is None:
            return
        self._from_mps = max(self._from_mps, self._shown.fastest_mps)
        acts_s = self._reach.acts_s(now_s, self._motion.runaway_s)
        if acts_s > 0.0:
            self._acts_s, self._acted_at = acts_s, now_s
        base = self._world.drives.bench.base
        rests = moving_s(self._world.robot, base.v_mps, base.w_radps) == 0.0
        stands = tau_s == 0.0 and rests
        self._stood = self._stood or (stands and now_s >= self._latched_at + QUICK_STOP_S)
        beyond = tau_s > self._hold.bound_s(tau_s, now_s, self._active) and not self._on_its_ramp(tau_s, now_s)
        if beyond or self._again(tau_s, rests, now_s):
            self._violate("held", f"{self._shown} while {' and '.join(self._latches)} latched")

    def _again(self, tau_s: float, rests: bool, now_s: float) -> bool:
        """It stood and moves, by nothing that excuses it."""
        if not self._stood or tau_s == 0.0 or rests:
            return self._rest_again(0.0, now_s)
        strangers = self._strangers
        rows = {
            "unreachable": self._reach.was_lost,
            "strange hands": now_s < strangers.sends_from + self.react_s,
            "deaf watchdog": now_s < strangers.deaf_from + self.react_s,
        }
        row = next((row for row, holds in rows.items() if holds), "")
        if row and self.ledger.excuse("held", row):
            return self._rest_again(tau_s, now_s)
        return self._moves_again(tau_s, now_s)

    def _check_neutral(self, tau_s: float, now_s: float) -> None:
        """From a reset on until an allowed source orders motion. What rolls without power moves without an order."""
        if self._latches or self._wishes.greatest_s(now_s) > 0.0:
            self._rests_since = math.inf
        acted_at = self._strangers.acted_at
        self._pushed = now_s < acted_at + self.react_s or (self._pushed and tau_s > 0.0)
        if tau_s == 0.0 or now_s <= self._rests_since or not any(self._reach.turning()):
            return
        rows = {
            "unreachable": self._reach.was_lost,
            "strange hands": self._pushed,
            "lying sensor": self._reach.acts_s(now_s, self._motion.runaway_s) > 0.0 or self._shown.is_blind,
        }
        row = "" if self._is_leased(now_s) else next((row for row, holds in rows.items() if holds), "")
        if not row or not self.ledger.excuse("neutral", row):
            self._violate("neutral", f"{self._shown}, {now_s - self._rests_since:.2f} s after a reset")

    def _is_leased(self, now_s: float) -> bool:
        """The filter orders motion."""
        return not self._leased.is_zero and now_s <= self._leased_at + ORDER_S

    def _rest_again(self, tau_s: float, now_s: float) -> bool:
        """It stands, or moves by what is excused: it may roll out from that `tau_s`."""
        self._again_since, self._again_tau_s = now_s, tau_s
        return False

    def _on_its_ramp(self, tau_s: float, now_s: float) -> bool:
        """No faster than one ramp leaves it that began RAMP_LATE_S after the stop."""
        late = tau_s <= self._from_tau_s + RAMP_LATE_S - (now_s - self._latched_at)
        return late and self.ledger.excuse("held", "late ramp")

    def _moves_again(self, tau_s: float, now_s: float) -> bool:
        """After a stop: longer than what moves it may, or faster and faster when that has lost its power."""
        if self._on_its_ramp(tau_s, now_s):
            self._again_tau_s = tau_s
            return False
        swings = now_s <= self._again_since + SWING_S and self._shown.fastest_mps <= SWING_SHARE * self._from_mps
        if swings and self.ledger.excuse("held", "swing"):
            self._again_tau_s = tau_s
            return False
        if now_s <= self._acted_at + STEP_S:
            self._again_tau_s = math.inf  # it may have got faster until the very moment when its power went
            self._acted_s += STEP_S
            row = "acts alone" if self._acts_s == math.inf else "lying sensor"
            return self._acted_s > self._acts_s or not self.ledger.excuse("held", row)
        rolls_out = now_s <= self._acted_at + BRAKES_S or not any(self._reach.turning())
        slows = tau_s <= self._again_tau_s + ROUNDING_S
        self._again_tau_s = min(tau_s, self._again_tau_s)
        return not (slows and rolls_out and self.ledger.excuse("held", "rolls out"))

    def _check_latches(self, now_s: float) -> None:
        watchdog = self._world.watchdog
        done = sum(outcome.done for outcome in self._outside.resets)
        if watchdog.running and watchdog.watching:
            self._watching_at = now_s
        latched = self._latched_now()
        if "watchdog" in latched and "watchdog" not in self._latches:
            self._tripped_at = now_s
            self.trips.append(watchdog.trip_cause)
        if self._gone("driver", latched) and done == self._resets_done:
            self._violate("latched", "the driver left LATCHED without a reset")
        asked = self._outside.asked_at >= self._tripped_at - STEP_S and watchdog.reset_done
        if self._gone("watchdog", latched) and not asked:
            self._violate("latched", "the watchdog left TRIPPED without a reset")
        if done > self._resets_done:
            self._wishes.on_stop(now_s)
            self._faults.on_reset(now_s)
            self._rests_since = now_s
        self._fresh, self._resets_done = self._fresh or done > self._resets_done, done
        if (latched or self._latches) and latched.keys() != self._latches.keys():
            self._note_latches(latched, now_s)
        self._latches = latched

    def _latched_now(self) -> dict[str, object]:
        """What is latched, or was when its process died; and what was requested of the driver."""
        driver, watchdog, processes = self._world.driver, self._world.watchdog, self._world.processes
        latches = self._latches.items()
        latched = {name: core for name, core in latches if name in processes and not processes[name].alive}
        if driver.alive and driver.latched:
            latched["driver"] = driver.core
        if driver.alive and driver.asked:
            latched[f"the request to {driver.asked}"] = driver.core
        if watchdog.alive and watchdog.tripped:
            latched["watchdog"] = watchdog.core
        return latched

    def _gone(self, name: str, latched: dict[str, object]) -> bool:
        """It was latched and is not any more, in this life or after a start: what is dead stays as it was."""
        return name in self._latches and name not in latched

    def _note_latches(self, latched: dict[str, object], now_s: float) -> None:
        self._world.note(f"latched: {', '.join(latched) or 'nothing'}")
        if not latched:
            self._hold = None
        elif self._hold is None:
            self._hold, self._stood, self._latched_at = self._allowance("held", self._one_s), False, now_s
            self._acted_s = 0.0
            shown = self._shown
            self._from_mps = shown.fastest_mps
            self._from_tau_s = moving_s(self._world.robot, shown.linear_mps, shown.angular_radps)

    def _check_drives(self, now_s: float) -> None:
        robot = self._world.robot
        off = self._world.driver.asked == "deactivate"
        self._off_since = min(self._off_since, now_s) if off else math.inf
        for change in self._world.drives.changes():
            self._world.note(f"drive {change.node_id}: {change.before.name} → {change.after.name}")
            by_stranger = now_s < self._strangers.sent_at + SENT_S and self.ledger.excuse("enabling", "strange hands")
            grace_s = robot.timeouts.watchdog_s + notice_s(robot)
            if change.after is State.OPERATION_ENABLED and now_s > self._watching_at + grace_s and not by_stranger:
                self._violate("enabling", f"drive {change.node_id}, {now_s - self._watching_at:.2f} s without watchdog")
            if change.after is State.OPERATION_ENABLED and now_s > self._off_since + SENT_S and not by_stranger:
                self._violate("enabling", f"drive {change.node_id}, and motor_driver was switched off")
        fastest_mps = max(self._max_wheel_mps, self._reach.fastest_mps)
        turning = self._reach.turning()
        brakes_s = fastest_mps / robot.limits.emergency_deceleration_mps2 if turning else 0.0
        for node_id, axis in turning:
            self._check_alone(node_id, axis, brakes_s, now_s)

    def _check_alone(self, node_id: int, axis: int, brakes_s: float, now_s: float) -> None:
        """A drive that hears neither master: its own time, and that of its ramp."""
        heard_at, lost_at = self._reach.heard(node_id), self._reach.lost_at[node_id]
        personal_s = self._reach.alone_s if self._reach.alone_s < math.inf else 0.0
        over_s = now_s - heard_at - personal_s - brakes_s - OWN_TIMER_S
        rows = (
            ("no watch", 0.0 if self._reach.stops_alone(node_id) else math.inf),
            ("unreachable", max(0.0, lost_at - heard_at)),
            ("swing", SWING_S * self._reach.ramp_has_ended(node_id, axis)),
        )
        if is_late("heartbeat", self.ledger, over_s, rows):
            self._violate("heartbeat", f"drive {node_id}.{axis} turns, {now_s - heard_at:.2f} s without its masters")

    def _check_stop_button(self, tau_s: float, now_s: float) -> None:
        if not self._around.pressed:
            self._pressed_at, self._pressed_gives = math.inf, {}
            return
        self._pressed_at = min(self._pressed_at, now_s)
        topics, topic = self._world.topics, self._world.robot.safety.estop.topic
        if topics.loss.get(topic) or not self._world.velocity.running:
            self._unheard_at = now_s
        if now_s > max(self._pressed_at, self._unheard_at) + HEARD_S:
            self._awaits_zero = True
            self._wishes.on_stop(now_s)
        robot, fastest_mps, gives = self._world.robot, self._reach.fastest_mps, self._pressed_gives
        longest_s = braking_s(robot, robot.limits.linear_mps, robot.limits.angular_radps)
        gives |= {row: max(seconds, gives.get(row, 0.0)) for row, seconds in self._active.gives_s()}
        if self._reach.lost:
            gives["unreachable"] = now_s - self._pressed_at
        if self._active.coasting:
            rolls_s = braking_s(robot, fastest_mps, 2.0 * fastest_mps / robot.base.track_m) / self._coasting
            gives["rolls out"] = max(0.0, rolls_s - longest_s)
        over_s = now_s - self._pressed_at - self._around.button_s - self._one_s - longest_s
        if tau_s > 0.0 and is_late("estop", self.ledger, over_s, gives.items()):
            self._violate("estop", f"{self._shown}, {now_s - self._pressed_at:.2f} s after it was pressed")

    def _check_rest(self, tau_s: float, now_s: float) -> None:
        """At zero order, and after a pause."""
        problem = self._pauses.step(tau_s, now_s, locked=self._locked_s(now_s) > HEARD_S, active=self._active)
        if problem:
            self._violate("pauses", f"{self._shown}: {problem}")
        world = self._world
        moved = now_s <= self._strangers.acted_at + self.react_s
        gives = dict(self._active.gives_s())
        gives["unreachable"] = math.inf if self._reach.was_lost else 0.0
        gives["rolls out"] = math.inf if self._coasts() else 0.0
        gives["strange hands"] = math.inf if moved else 0.0
        gives["pushed"] = math.inf if world.drives.bench.base.push_n != world.drawn.push_n else 0.0
        gives["lying sensor"] = math.inf if self._motion.ran_away or not self._shown.tells_truth else 0.0
        problem = self._rest.step(now_s, tau_s == 0.0, gives)
        if problem:
            self._violate("rest", problem)

    def _check_short(self, now_s: float) -> None:
        """From the moment on in which a filter that runs has received the button."""
        topics, topic = self._world.topics, self._world.robot.safety.estop.topic
        disturbed = topic in topics.loss or topic in topics.delay_s or topic in topics.beside
        if self._around.pressed and self._world.velocity.running and not disturbed:
            self._short.begin(now_s)
        gives = dict(self._active.gives_s())
        gives["one fault"] = self._one_s * self._faults.one(now_s)
        gives["unreachable"] = math.inf if self._reach.lost else 0.0
        gives["rolls out"] = math.inf if self._active.coasting else 0.0
        gives["strange hands"] = self._one_s * (now_s <= self._strangers.acted_at + self.react_s)
        gives["lying sensor"] = math.inf if self._motion.ran_away or not self._shown.tells_truth else 0.0
        problem = self._short.step(now_s, gives)
        if problem:
            self._violate("short", problem)

    def _on_goal_end(self, goal: Goal) -> None:
        outcome = goal.ends[-1]
        self._world.note(f"goal {goal.number} ends: {outcome.code.name}: {outcome.message}")
        problem = self._goals.ended(goal)
        if problem:
            self._violate("goal", problem)

    def _coasts(self) -> bool:
        """The wheels of one side roll: no motor of it brakes."""
        drives = self._world.drives
        return any(drives.roll(side) for side in drives.sides)

    def _was_pushed(self) -> bool:
        """Strange hands moved the base after the wall came, or just before."""
        return self._around.wall_at - self.react_s < self._strangers.acted_at
