"""Ordinary driving for hours, in virtual time: sources, filter, driver, drives and watchdog, and a loaded computer.

As a program it drives on several seeds and prints what tripped: `python -m unit.watchdog_soak HOURS [FIRST_SEED]`.
"""

from __future__ import annotations

import struct
import sys
from collections import deque
from collections.abc import Callable, Iterator
from random import Random

from canbase_bench.cia301.dictionary import key
from canbase_bench.cia402.states import State as DriveState
from canbase_bench.frame import Frame as BenchFrame
from canbase_bench.plant.base import PlantParameters
from canbase_bench.world.bench import Bench
from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_driver.core import DriverCore
from canbase_driver.frame import Frame
from canbase_driver.kinematics import Twist2D
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.lease import lease_datagram
from canbase_velocity.safety_filter import FilterConfig
from canbase_velocity.twist import Twist
from canbase_watchdog.policy import Verdict
from canbase_watchdog.watchdog import State, Watchdog

STEP_S = 0.001
GRAVITY_MPS2 = 9.81
WATCHDOG_STEPS, FILTER_STEPS, DRIVER_STEPS = 5, 20, 10
RUN_S = 300.0
"""One seed: one robot, one load, one floor, stiff or soft drives, their ramps and noise."""
STEEPEST = 0.1
"""Slope, 10 %: with double payload the weakest motors of the bench need half of their force for it."""
LONGEST_HOLD_S = 0.2
HOLD_N = (20.0, 250.0)
"""What holds a wheel for a moment: up to nearly three times what its motor can push."""

Source = Iterator[tuple[float, Twist]]
"""Velocity commands, each with the time until the next one [s]."""


class Soak:
    """One robot that drives for a while. `now` is the time [s]; nothing here is random but by its seed."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)
        self.robot = load_robot(sample("bench")).robot
        load, bandwidth = self.random.choice((0.5, 1.0, 1.0, 1.5, 2.0)), self.random.choice((50.0, 200.0))
        self.step, self._start = 0, 1000.0
        carpet_n = self.random.choice((6.0, 6.0, 12.0, 25.0))
        body = PlantParameters(payload_factor=load, bandwidth_radps=bandwidth, coulomb_n=carpet_n)
        self.bench = Bench(self.robot, self.now, body)
        self._weight_n = GRAVITY_MPS2 * body.mass_kg * load
        self._noise_mps = self.random.choice((0.0, 0.005, 0.02))
        self._ramp_share = self.random.choice((1.0, 1.0, 0.5, 0.3))
        self._floor_until, self._held_until, self._freed_until = 0.0, 0.0, 0.0
        self.driver = DriverCore(self.robot)
        self.watchdog_config = watchdog_config(self.robot)
        self.watchdog = Watchdog(self.watchdog_config, self.now)
        self.filter = SafetyFilter(FilterConfig.of(self.robot))
        self.path_m = 0.0
        self._sequence = 0
        self._source, self._source_until, self._source_next = self._joystick(), 0.0, 0.0
        self._to_driver: deque[tuple[float, Twist2D]] = deque()
        self._to_watchdog: deque[Frame] = deque()
        self._driver_step = self._watchdog_step = 0

    @property
    def now(self) -> float:
        """Monotonic time [s]."""
        return self._start + self.step * STEP_S

    @property
    def verdict(self) -> Verdict:
        """Why the watchdog tripped, if it did."""
        return self.watchdog.status.verdict

    def run(self, seconds: float) -> bool:
        """Drive on; True as soon as the watchdog has tripped."""
        for _ in range(round(seconds / STEP_S)):
            self.step += 1
            self._turn()
            if self.watchdog.status.state is State.TRIPPED:
                return True
        return False

    def _turn(self) -> None:
        now = self.now
        if now >= self._source_next:
            self._command(now)
        elif self.step % FILTER_STEPS == 0:
            self._issue(now)
        self._change_floor(now)
        while self._to_driver and self._to_driver[0][0] <= now:
            self.driver.on_command(self._to_driver.popleft()[1], now)
        if self.step >= self._driver_step:
            self._driver_step = self._late(self._driver_step + DRIVER_STEPS, 0.002, 30)
            self._send(self.driver.tick(now))
        if self.step % WATCHDOG_STEPS == 0:
            self._send([Frame(frame.cob_id, frame.data) for frame in self.bench.tick(now)])
        if self.step >= self._watchdog_step:
            self._watchdog_step = self._late(self.step + WATCHDOG_STEPS, 0.0005, 80)
            self._watch(now)

    def _late(self, due: int, chance: float, most: int) -> int:
        """The step of the next turn, which now and then is late; turns that were missed are not made up for."""
        if self.random.random() < chance:
            due += self.random.randint(5, most)
        return max(due, self.step + 1)

    def _change_floor(self, now: float) -> None:
        """Slopes for some seconds; now and then something holds a wheel for a moment, like a threshold."""
        random, base = self.random, self.bench.base
        if now >= self._floor_until:
            self._floor_until = now + random.uniform(2.0, 20.0)
            base.push_n = self._weight_n * random.choice((0.0, 0.0, random.uniform(-STEEPEST, STEEPEST)))
            self._slow_ramps()
        if self._held_until and now >= self._held_until:
            self._held_until, self._freed_until = 0.0, now + random.uniform(1.0, 8.0)
            base.hold("left", 0.0)
            base.hold("right", 0.0)
        elif not self._held_until and now >= self._freed_until:
            self._held_until = now + random.uniform(0.02, LONGEST_HOLD_S)
            force_n = random.uniform(*HOLD_N)
            for side in random.choice((("left",), ("right",), ("left", "right"))):
                base.hold(side, force_n)

    def _slow_ramps(self) -> None:
        """The drives' own ramps are slower than the driver's setpoints; down they must be as the limits say."""
        for node in self.bench.nodes.values():
            axis = node.axes[0]
            slope = self._ramp_share * self.robot.limits.acceleration_mps2
            if self._ramp_share < 1.0 and axis.state is DriveState.OPERATION_ENABLED:
                node.dictionary.values[key(0x6083)] = round(slope / axis.scale.slope_mps2)

    def _watch(self, now: float) -> None:
        """What has come meanwhile is taken in at once, and all of it counts as received now."""
        while self._to_watchdog:
            frame = self._noisy(self._to_watchdog.popleft())
            self.watchdog.on_frame(frame.cob_id, frame.data, now)
        self._send([Frame(frame.cob_id, frame.data) for frame in self.watchdog.tick(now)])

    def _noisy(self, frame: Frame) -> Frame:
        """606Ch of a drive that measures badly."""
        if not self._noise_mps or frame.cob_id & 0x780 != 0x280 or len(frame.data) not in (4, 6):
            return frame
        bits_per_mps = 1.0 / abs(self.watchdog_config.drives[0].velocity_mps_per_bit)
        noise = round(self.random.uniform(-1.0, 1.0) * self._noise_mps * bits_per_mps)
        noisy = struct.pack("<i", struct.unpack_from("<i", frame.data)[0] + noise)
        return Frame(frame.cob_id, noisy + frame.data[4:])

    def _command(self, now: float) -> None:
        if now >= self._source_until:
            self._source = self.random.choice((self._joystick, self._navigation, self._action, self._rest))()
            self._source_until = now + self.random.uniform(2.0, 15.0)
        wait_s, twist = next(self._source)
        self._source_next = now + wait_s
        self.filter.on_command(twist, now)
        self._issue(now)

    def _issue(self, now: float) -> None:
        """The lease first, at once; then the command, which takes its time to the driver and is lost now and then."""
        twist = self.filter.decide(now).twist
        self._sequence += 1
        datagram = lease_datagram(self._sequence, round(now * 1e9), twist, stops=False, estop=False)
        self.watchdog.on_lease(datagram, None, now)
        chance = self.random.random()
        if chance < 0.01:
            return
        latency_s = self.random.uniform(0.02, 0.05) if chance < 0.03 else self.random.uniform(0.0005, 0.005)
        arrival = max(now + latency_s, self._to_driver[-1][0] if self._to_driver else 0.0)
        self._to_driver.append((arrival, Twist2D(twist.linear_mps, twist.angular_radps)))

    def _send(self, frames: list[Frame]) -> None:
        waiting = deque(frames)
        while waiting:
            frame = waiting.popleft()
            self._to_watchdog.append(frame)
            waiting += self.driver.on_frame(frame, self.now)
            self.bench.on_frame(BenchFrame(frame.cob_id, frame.data), self.now)
            waiting += [Frame(each.cob_id, each.data) for each in self.bench.tick(self.now)]

    # Who drives

    def _any(self, share: float = 1.0) -> Twist:
        limits, uniform = self.robot.limits, self.random.uniform
        return Twist(share * uniform(-1.2, 1.2) * limits.linear_mps, share * uniform(-1.2, 1.2) * limits.angular_radps)

    def _joystick(self) -> Source:
        """50 Hz; jumps, full deflection, reversals at speed, turns in place, let go of."""
        while True:
            wanted = self._any()
            turn, stop = Twist(0.0, wanted.angular_radps), Twist(0.0, 0.0)
            wanted = self.random.choice((wanted, wanted, turn, stop, Twist(wanted.linear_mps, 0.0), wanted.scaled(5.0)))
            for _ in range(self.random.choice((1, 2, 5, 10, 25, 50, 100))):
                yield 0.02, wanted
            if self.random.random() < 0.3:
                for _ in range(self.random.randint(1, 30)):
                    yield 0.02, wanted.scaled(-1.0)

    def _navigation(self) -> Source:
        """20 Hz; curves that grow and shrink, bursts, and gaps in which the filter stops the base."""
        at = Twist(0.0, 0.0)
        while True:
            towards = self._any(0.8)
            for n in range(self.random.randint(5, 60)):
                at = Twist(
                    at.linear_mps + 0.15 * (towards.linear_mps - at.linear_mps),
                    at.angular_radps + 0.15 * (towards.angular_radps - at.angular_radps),
                )
                yield self.random.choice((0.05, 0.05, 0.05, 0.001, 0.1) if n else (0.6, 0.05)), at

    def _action(self) -> Source:
        """50 Hz; up, on and down to an exact zero, forward or backward, straight or in place."""
        limits = self.robot.limits
        while True:
            straight = self.random.random() < 0.7
            top = Twist(limits.linear_mps, 0.0) if straight else Twist(0.0, limits.angular_radps)
            top = top.scaled(self.random.choice((-1.0, 1.0)) * self.random.uniform(0.05, 1.0))
            rise, hold = self.random.randint(5, 60), self.random.randint(0, 100)
            shares = [n / rise for n in range(rise)] + [1.0] * hold + [1.0 - n / rise for n in range(rise)]
            for share in [*shares, *[0.0] * self.random.randint(1, 50)]:
                yield 0.02, top.scaled(share)

    def _rest(self) -> Source:
        """Nobody."""
        while True:
            yield 0.5, Twist(0.0, 0.0)


def drive(seconds: float, first_seed: int, tell: Callable[[str], None]) -> tuple[int, float]:
    """Drive for so long on one seed after the other. Number of trips, and the way of all robots [m]."""
    trips, way_m, seed, left = 0, 0.0, first_seed, seconds
    while left > 0.0:
        soak = Soak(seed)
        if soak.run(min(RUN_S, left)):
            trips += 1
            tell(f"seed {seed}, after {soak.now - 1000.0:.3f} s: {soak.verdict}")
        way_m += soak.bench.truth(soak.now).path_m
        left, seed = left - RUN_S, seed + 1
    return trips, way_m


def main() -> None:
    """Hours and first seed from the command line."""
    hours, first_seed = float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    trips, way_m = drive(hours * 3600.0, first_seed, lambda line: print(line, flush=True))
    print(f"{hours:g} h of driving in virtual time, {way_m / 1000.0:.2f} km, {trips} false trips")


if __name__ == "__main__":
    main()
