"""Driver, watchdog and simulated drives on one lossless bus in virtual time: the pure cores, no threads, no clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Literal

from canbase_campaign.disk import StopDisk
from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.units import mps_per_bit
from canbase_driver.cia301.frame import Frame
from canbase_driver.core import DriverCore
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.lifecycle import Aim
from canbase_runtime.driver_state import DriverState
from canbase_sim.cia402.states import State
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.node import SimulatedNode
from canbase_sim.odd.draw import OddDrive
from canbase_sim.personality import PERSONALITIES
from canbase_sim.world.bench import Bench, BenchParameters, Truth
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from canbase_watchdog.watchdog import Watchdog
from support.crews import robot_with

STEP_S = 0.002
"""Bus, drives and watchdog look at the clock this often; the watchdog wants it every 5 ms at least."""
COMMAND_PERIOD_S = 0.02
BOOTED_S = 1.5
"""From power on, every kind of drive is enabled within it; the slowest sends two boot-up messages."""
FORWARD = Twist2D(0.3, 0.0)
BITS_PER_MPS = 60.0 / (2.0 * math.pi * 0.1) * 20.0 * 10.0
"""60FFh of the sample robot: 0.1 rpm at the motor, gear 20, wheel radius 0.1 m."""


def bench_robot() -> Robot:
    """The sample robot of the bench: nodes 1 (left) and 2 (right, mirrored)."""
    return load_robot(sample("bench")).robot


KINDS = sorted(PERSONALITIES)
"""Every kind of drive that has a profile."""


def robot_of(*places: tuple[int, int, Literal["left", "right"]]) -> Robot:
    """The same robot with drives at these (node id, axis, side); those on the right are mounted mirrored."""
    robot = bench_robot()
    like = dict(zip(("left", "right"), robot.drives, strict=True))
    drives = [
        like[side].model_copy(update={"joint": f"{side}_{node_id}_{axis}", "node_id": node_id, "axis": axis})
        for node_id, axis, side in places
    ]
    return Robot.model_validate(robot.model_copy(update={"drives": tuple(drives)}).model_dump())


class World:
    """Everything that shares the bus. `run` lets time pass; the parts are open to the tests.

    `command`: what reaches the driver every 20 ms, None: nothing. `leases`: the watchdog receives the last order.
    `cable`: False: the driver receives and sends nothing, and gets the error of a failed bus.
    """

    def __init__(
        self,
        robot: Robot | None = None,
        parameters: BenchParameters | None = None,
        aim: Aim = Aim.ACTIVE,
        keeps: bool = False,
        odd: Mapping[int, OddDrive] = MappingProxyType({}),
    ) -> None:
        """`keeps`: driver and watchdog keep records of their stops, on `disk` and `watchdog_disk`. `odd`: by node."""
        self.robot = robot or bench_robot()
        self._start, self._steps = 100.0, 0
        self.bench = Bench(self.robot, self.now_s, parameters=parameters, odd=odd)
        self._keeps = keeps
        self.disk, self.watchdog_disk = StopDisk("driver"), StopDisk("watchdog")
        self.driver: DriverCore | None = DriverCore(self.robot, aim, self.disk.found() if keeps else None)
        self.watchdog: Watchdog | None = None
        self.start_watchdog()
        self.command: Twist2D | None = Twist2D.ZERO
        self.leases = True
        self.brakes_hard = False
        """The filter's leases have the flag "brakes hard", and zero."""
        self.loses: Callable[[Frame], bool] = lambda frame: False
        """Frames that the driver does not receive."""
        self.cable = True
        self.log: list[tuple[float, Frame]] = []
        """Every frame on the bus, with its time."""
        self.ticks: list[list[Frame]] = []
        """What the driver sent in each of its cycles."""
        self._ordered = Twist2D.ZERO
        self._sequence = 0
        self._next_cycle = self._next_command = self.now_s

    @property
    def now_s(self) -> float:
        """The time [s]."""
        return self._start + self._steps * STEP_S

    @property
    def core(self) -> DriverCore:
        """The driver, which must be alive."""
        assert self.driver is not None
        return self.driver

    @property
    def truth(self) -> Truth:
        """What the robot really does."""
        return self.bench.truth(self.now_s)

    @property
    def snapshot(self) -> DriverSnapshot:
        """What the driver knows."""
        return self.core.snapshot(self.now_s)

    @property
    def node(self) -> SimulatedNode:
        """The drive on node 1, the left one."""
        return self.bench.nodes[1]

    @property
    def powered(self) -> list[bool]:
        """Of all axes in use, which may have torque: what the drives themselves know."""
        on = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
        return [self.bench.nodes[drive.node_id].axes[drive.axis].state in on for drive in self.robot.drives]

    def run(self, duration_s: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let time pass; True as soon as `until` holds."""
        for _ in range(round(duration_s / STEP_S)):
            self._steps += 1
            self._step()
            if until():
                return True
        return until()

    def run_until(self, state: DriverState, within_s: float) -> float:
        """Let time pass until the driver is in `state`; it must get there in time. How long it took [s]."""
        start = self.now_s
        reached = self.run(within_s, lambda: self.core.state is state)
        assert reached, f"driver is {self.core.state.name}, not {state.name}: {self.core.finding}"
        return self.now_s - start

    def enable(self) -> None:
        """From power on to operation enabled, with a zero command seen."""
        self.run_until(DriverState.ENABLED, 3.0)
        self.run(0.05)

    def drive(self, twist: Twist2D = FORWARD, seconds: float = 0.8) -> None:
        """Enable, and up to speed."""
        self.enable()
        self.command = twist
        self.run(seconds)

    def kill_driver(self) -> None:
        """As by SIGKILL: from now on it sends nothing."""
        self.driver = None

    def start_driver(self) -> None:
        """A new driver process, without any state of the one before."""
        self.driver, self.ticks = DriverCore(self.robot, on_disk=self.disk.found() if self._keeps else None), []
        self.resume_cycles()

    def start_watchdog(self) -> None:
        """A new watchdog process."""
        past = self.watchdog_disk.found() if self._keeps else None
        self.watchdog = Watchdog(watchdog_config(self.robot), self.now_s, past)

    def reboot(self, seconds: float = 0.5) -> None:
        """The computer loses its supply for this long; the drives keep theirs."""
        self.driver = self.watchdog = None
        self.run(seconds)
        self.start_watchdog()
        self.start_driver()

    def pause_driver(self, seconds: float) -> None:
        """Its process gets no time; what the bus brings meanwhile waits until then."""
        driver, self.driver, taken_in = self.core, None, len(self.log)
        self.run(seconds)
        self.driver = driver
        for _, frame in self.log[taken_in:]:
            driver.on_frame(frame, self.now_s)
        self.resume_cycles()

    def resume_cycles(self) -> None:
        """The driver's next cycle is now: those in which it was not there are not made up for."""
        self._next_cycle = self.now_s

    def stands_after(self, within_s: float = 3.0) -> float:
        """Let time pass and see the base come to a lasting standstill. Until then, from now [s]."""
        start = self.now_s
        self.run(within_s)
        assert self.truth.standing_s > 0.5, self.truth
        return self.now_s - self.truth.standing_s - start

    def reset(self) -> RequestOutcome:
        """Request a reset of the driver and let it run to its end."""
        outcomes: list[RequestOutcome] = []
        self.core.request_reset(self.now_s, outcomes.append)
        assert self.run(12.0, lambda: bool(outcomes)), "the reset never ended"
        return outcomes[0]

    def go(self, aim: Aim) -> RequestOutcome:
        """Order the driver to this aim and let it get there, or fail."""
        outcomes: list[RequestOutcome] = []
        self.core.request_aim(aim, self.now_s, outcomes.append)
        assert self.run(20.0, lambda: bool(outcomes)), "the change never ended"
        return outcomes[0]

    def recovered(self) -> bool:
        """Order zero, reset, and see the base enabled again and following a command."""
        self.command = Twist2D.ZERO
        self.run(0.1)
        outcome = self.reset()
        assert outcome.done, outcome.sentence
        self.run_until(DriverState.ENABLED, 1.0)
        self.run(0.05)
        self.command = FORWARD
        self.run(0.8)
        return abs(self.truth.linear_mps - FORWARD.linear_mps) < 0.01

    def targets_mps(self) -> list[tuple[float, float]]:
        """What each cycle ordered of the left and the right wheel of a robot with two drives, forward positive."""
        left, right = (mps_per_bit(drive, self.robot.base.wheel_radius_m) for drive in self.robot.drives)
        pairs = [[target for _, target in setpoints(frames)] for frames in self.ticks]
        return [(pair[0] * left, pair[1] * right) for pair in pairs if len(pair) == 2]

    def sent(self, cob_id: int, since: float = 0.0) -> list[bytes]:
        """The data of all frames with this identifier from then on."""
        return [frame.data for at, frame in self.log if frame.cob_id == cob_id and at >= since]

    def inject(self, cob_id: int, data: str) -> None:
        """A frame on the bus that none of them sent."""
        self._send([Frame(cob_id, bytes.fromhex(data))])

    @property
    def is_guarded(self) -> bool:
        """Its drives report their NMT state on request of a watchdog alone."""
        return self.robot.drives[0].kind.self_stop.node_guarding

    def guard(self) -> None:
        """A node guarding request to each guarded drive, as the watchdog sends them."""
        guarded = {drive.node_id for drive in self.robot.drives if drive.kind.self_stop.node_guarding}
        self._send([Frame(0x700 + node_id, remote=True) for node_id in sorted(guarded)])

    def _step(self) -> None:
        if self.now_s >= self._next_command - STEP_S / 2:
            self._next_command += COMMAND_PERIOD_S
            self._order()
        if self.driver is not None and self.now_s >= self._next_cycle - STEP_S / 2:
            self._next_cycle += 1.0 / self.robot.rates.control_hz
            self._cycle(self.driver)
        if self.watchdog is not None:
            self._send([Frame(each.cob_id, each.data, each.remote) for each in self.watchdog.tick(self.now_s)])
            if self._keeps:
                self.watchdog.on_record(*self.watchdog_disk.write(self.watchdog.record))
        self._send([Frame(frame.cob_id, frame.data) for frame in self.bench.tick(self.now_s)])

    def _cycle(self, driver: DriverCore) -> None:
        driver.on_bus("" if self.cable else "the cable is cut", self.now_s)
        frames = driver.tick(self.now_s)
        if self._keeps:
            driver.on_record(*self.disk.write(driver.record))
        self.ticks.append(frames)
        self._send(frames if self.cable else [])

    def _order(self) -> None:
        if self.brakes_hard:
            self._ordered = Twist2D.ZERO
        elif self.command is not None and self.command.is_finite:
            self._ordered = self.command
        if self.driver is not None and self.command is not None:
            self.driver.accept_velocity_command(self.command, self.now_s)
        if self.leases and self.watchdog is not None:
            self._sequence += 1
            ordered = Twist(self._ordered.linear_mps, self._ordered.angular_radps)
            datagram = lease_datagram(self._sequence, round(self.now_s * 1e9), ordered, brakes_hard=self.brakes_hard)
            self.watchdog.on_lease(datagram, None, self.now_s)

    def _send(self, frames: list[Frame]) -> None:
        waiting = list(frames)
        while waiting:
            frame = waiting.pop(0)
            self.log.append((self.now_s, frame))
            if self.driver is not None and self.cable and not frame.remote and not self.loses(frame):
                waiting += self.driver.on_frame(frame, self.now_s)
            if self.watchdog is not None and not frame.remote:
                self.watchdog.on_frame(frame.cob_id, frame.data, self.now_s)
            self.bench.on_frame(BenchFrame(frame.cob_id, frame.data, remote=frame.remote), self.now_s)
            waiting += [Frame(each.cob_id, each.data) for each in self.bench.tick(self.now_s)]


def world_of(kind: str, **changes: object) -> World:
    """With two drives of that kind; `changes`: keys of both in robot.yaml."""
    return World(robot_with(kind, **changes))


def setpoints(frames: list[Frame]) -> Iterator[tuple[int, int]]:
    """Controlword and target of each setpoint (RPDO1 and RPDO2) among these frames."""
    for frame in frames:
        if frame.cob_id & 0x780 in (0x200, 0x300) and len(frame.data) in (4, 6):
            word, target = frame.data[:2], frame.data[2:]
            yield int.from_bytes(word, "little"), int.from_bytes(target, "little", signed=True)
