"""From power on to turning wheels with the simulated drives, in virtual time: boot, NMT start, enable, drive, fault."""

from collections.abc import Callable

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import SYNC, NmtCommand, NmtState, heartbeat, nmt
from canbase_driver.cia301.pdo import NodeLayout, pack_setpoint, unpack_status, unpack_velocity
from canbase_driver.cia402 import FAULT_RESET_CYCLES, DriveState, PowerGoal, decode_statusword, next_controlword
from canbase_driver.drive_units import AxisUnits
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.world.bench import Bench

LAYOUTS = (NodeLayout(1, (0,)), NodeLayout(2, (0,)))


class World:
    """The bench and a master of a few lines; the clock moves in steps of 1 ms, the cycle is 10 ms."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.bench = Bench(robot)
        self.now_s = 0.0
        self.states: list[DriveState | None] = [None, None]
        self.rims_mps = [0.0, 0.0]
        self._units = [AxisUnits(drive, robot.base) for drive in robot.drives]

    def send(self, frame: Frame) -> None:
        self.bench.on_frame(BenchFrame(frame.cob_id, frame.data), self.now_s)

    def received(self) -> list[Frame]:
        return [Frame(frame.cob_id, frame.data) for frame in self.bench.tick(self.now_s)]

    def boot(self, limit_s: float = 3.0) -> list[NodeBoot]:
        """Both nodes at the same time."""
        boots = [NodeBoot(drive.node_id, (drive,), self.robot) for drive in self.robot.drives]
        end = self.now_s + limit_s
        while self.now_s < end and not all(boot.done for boot in boots):
            self.now_s += 0.001
            for frame in self.received():
                for boot in boots:
                    boot.on_frame(frame, self.now_s)
            for boot in boots:
                for frame in boot.tick(self.now_s):
                    self.send(frame)
        return boots

    def cycle(self, goal: PowerGoal, rim_mps: float = 0.0) -> None:
        for node_id in (126, 127):
            self.send(heartbeat(node_id, NmtState.OPERATIONAL))
        for layout, state, units in zip(LAYOUTS, self.states, self._units, strict=True):
            setpoint = pack_setpoint(next_controlword(state, goal), units.velocity_raw(rim_mps))
            self.send(Frame(layout.setpoint_cob_id(0), setpoint))
        self.send(SYNC)
        self.now_s += 0.01
        for frame in self.received():
            self._take(frame)

    def _take(self, frame: Frame) -> None:
        for i, layout in enumerate(LAYOUTS):
            if frame.cob_id == layout.status_cob_id(0) and (status := unpack_status(frame.data)):
                self.states[i] = decode_statusword(status[0])
            if frame.cob_id == layout.velocity_cob_id(0) and (raw := unpack_velocity(frame.data)) is not None:
                self.rims_mps[i] = self._units[i].velocity_mps(raw)

    def cycles(self, goal: PowerGoal, until: Callable[[], bool], rim_mps: float = 0.0) -> int:
        """How many cycles it took; fails after 500."""
        count = 0
        while not until():
            self.cycle(goal, rim_mps)
            count += 1
            assert count < 500, self.states
        return count

    def drive(self) -> None:
        """Enable, and up to 0.3 m/s."""
        self.cycles(PowerGoal.ON, self.all_are(DriveState.OPERATION_ENABLED))
        self.cycles(PowerGoal.ON, lambda: min(self.rims_mps) > 0.29, rim_mps=0.3)

    def all_are(self, state: DriveState) -> Callable[[], bool]:
        return lambda: self.states == [state, state]


def booted() -> World:
    world = World(load_robot(sample("bench")).robot)
    boots = world.boot()
    assert [boot.error for boot in boots] == [None, None]
    world.send(nmt(NmtCommand.START, 0))
    return world


def test_two_drives_boot_together_within_half_a_second_of_power_on() -> None:
    world = World(load_robot(sample("bench")).robot)
    boots = world.boot()
    assert [boot.error for boot in boots] == [None, None]
    reports = [boot.report for boot in boots if boot.report]
    assert [report.node_id for report in reports] == [1, 2]
    assert [report.stops_by_itself for report in reports] == [True, True]
    assert [report.notes for report in reports] == [(), ()]
    # 0.3 s of these: the first question came before the drives could hear it
    assert world.now_s < 0.5


def test_a_booted_pair_is_enabled_within_ten_cycles_and_drives_forward() -> None:
    world = booted()
    assert world.cycles(PowerGoal.ON, world.all_are(DriveState.OPERATION_ENABLED)) <= 10
    world.drive()
    truth = world.bench.truth(world.now_s)
    assert min(truth.v_left_mps, truth.v_right_mps) > 0.28  # the right motor is mounted mirrored
    assert abs(truth.angular_radps) < 0.05


def test_a_quick_stop_stands_and_ends_without_torque() -> None:
    world = booted()
    world.drive()
    world.cycles(PowerGoal.QUICK_STOP, world.all_are(DriveState.SWITCH_ON_DISABLED))
    assert world.states == [DriveState.SWITCH_ON_DISABLED] * 2
    assert max(map(abs, world.rims_mps)) < 0.01


def test_a_running_robot_is_stopped_by_the_next_boot() -> None:
    world = booted()
    world.drive()
    boots = world.boot()  # a new driver, as after a crash; nobody ordered a stop
    assert [boot.error for boot in boots] == [None, None]
    truth = world.bench.truth(world.now_s)
    assert max(abs(truth.v_left_mps), abs(truth.v_right_mps)) < 0.005


def test_a_fault_goes_by_reset_alone_and_only_on_the_edge() -> None:
    world = booted()
    world.cycles(PowerGoal.ON, world.all_are(DriveState.OPERATION_ENABLED))
    world.bench.nodes[1].fail(0, 0x2310)
    world.cycles(PowerGoal.ON, lambda: world.states[0] is DriveState.FAULT)
    for _ in range(50):
        world.cycle(PowerGoal.ON)
    assert world.states[0] is DriveState.FAULT
    for _ in range(FAULT_RESET_CYCLES):
        world.cycle(PowerGoal.OFF)
    for _ in range(FAULT_RESET_CYCLES):
        world.cycle(PowerGoal.RESET)
    assert world.states == [DriveState.SWITCH_ON_DISABLED] * 2


def test_the_drives_stop_by_themselves_when_both_heartbeats_end() -> None:
    world = booted()
    world.drive()
    start = world.now_s
    while world.bench.truth(world.now_s).linear_mps > 0.005:
        world.now_s += 0.01
        world.received()
    # heartbeats count for 0.3 s, then 0.3 m/s go down the quick stop ramp
    assert 0.3 < world.now_s - start < 0.7
