"""drive_distance_server in virtual time: its `GoalQueue` with the inputs, the timer and the callbacks of node.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from canbase_action_server.along_track import BasePose
from canbase_action_server.goal_queue import GoalQueue
from canbase_action_server.goal_request import DriveRequest
from canbase_action_server.inputs import Driver, Inputs, Mux, Odometry, Safety
from canbase_action_server.outcome import GoalOutcome
from canbase_campaign.clock import ComputerClock
from canbase_campaign.process import Process, Topics
from canbase_config.robot import Robot
from canbase_driver.snapshot import DriverSnapshot
from canbase_runtime.received import Received
from canbase_velocity.decision import Action, Decision
from canbase_velocity.mux import MuxDecision
from canbase_velocity.twist import Twist


@dataclass(slots=True)
class Goal:
    """One accepted goal: when it began, and each end that it was given."""

    number: int
    distance_m: float
    speed_mps: float
    began: float
    ends: list[GoalOutcome]
    ended_at: float = 0.0
    died: bool = False
    """Its server was killed."""
    held_up_s: float = 0.0
    """How long its server hung meanwhile."""


class ActionProcess(Process):
    """`goals`: every goal that was ever accepted."""

    name = "action"

    def __init__(self, robot: Robot, clock: ComputerClock, topics: Topics, on_end: Callable[[Goal], None]) -> None:
        super().__init__(clock)
        self._robot, self._topics, self._on_end = robot, topics, on_end
        self._own_source = robot.mux.action_source
        self.on_order: Callable[[Twist], None] = lambda twist: None
        """Takes each command that it publishes."""
        self.goals: list[Goal] = []
        self.refused = 0
        topics.subscribe("odom", self, self._on_odometry)
        topics.subscribe("motor_driver/status", self, self._on_driver)
        topics.subscribe("safety_filter/state", self, self._on_safety)
        topics.subscribe("velocity_mux/state", self, self._on_mux)
        self.begin()

    def begin(self) -> None:
        """A new owner without a goal; it has received nothing."""
        self.goal_queue = GoalQueue(self._robot)
        self._inputs = Inputs()
        self._turned_at = self.clock.now_s
        self._period_s = 1.0 / self._robot.action.control_hz
        self.every(self._period_s, self._on_timer, phase_s=0.002)

    def die(self) -> None:
        """The goal dies with its server."""
        super().die()
        for goal in self.goals:
            goal.died = goal.died or not goal.ends

    def end(self) -> None:
        """Its goal ends first, with a base that stands."""
        self._inputs = replace(self._inputs, shutdown=True)

    def send_goal(self, distance_m: float, speed_mps: float) -> None:
        """A client sends a goal. It is accepted or refused as in node.py."""
        self.receive("goals", 10, self._on_goal, distance_m, speed_mps)

    def cancel(self) -> None:
        """The client of the running goal wants it to end."""
        self.receive("cancels", 10, self._on_cancel)

    def _on_goal(self, distance_m: float, speed_mps: float) -> None:
        now_s = self.clock.now_s
        request = DriveRequest(distance_m, speed_mps)
        if self.goal_queue.refusal(request, self._inputs, now_s) is not None:
            self.refused += 1
            return
        self.goal_queue.admit(str(len(self.goals)), request, now_s)
        self.goals.append(Goal(len(self.goals), distance_m, speed_mps, now_s, []))

    def _on_cancel(self) -> None:
        if self.goal_queue.running is not None:
            self.goal_queue.cancel(self.goal_queue.running)

    def _on_timer(self) -> None:
        now_s = self.clock.now_s
        if self.goals and not self.goals[-1].ends:
            self.goals[-1].held_up_s += max(0.0, now_s - self._turned_at - self._period_s)
        self._turned_at = now_s
        cycle = self.goal_queue.tick(self._inputs, now_s)
        if cycle.twist is not None:
            twist = Twist(cycle.twist.linear_mps, cycle.twist.angular_radps)
            self.on_order(twist)
            self._topics.publish("cmd_vel_action", twist)
        for end in cycle.ends:
            goal = self.goals[int(end.key)]
            goal.ends.append(end.outcome)
            goal.ended_at = now_s
            self._on_end(goal)

    def _on_odometry(self, snapshot: DriverSnapshot) -> None:
        pose = BasePose(snapshot.odometry.pose.x_m, snapshot.odometry.pose.y_m, snapshot.odometry.pose.yaw_rad)
        twist, now_s = snapshot.odometry.twist, self.clock.now_s
        odometry = Odometry(now_s, pose, twist.linear_mps, twist.angular_radps)
        self._inputs = replace(self._inputs, odometry=Received(odometry, now_s))

    def _on_driver(self, snapshot: DriverSnapshot) -> None:
        driver = Driver(
            state=snapshot.state,
            cause=snapshot.finding.cause.value,
            detail=snapshot.finding.detail,
            watchdog=snapshot.watchdog.view,
            watchdog_cause=snapshot.watchdog.cause,
            standstill=snapshot.standstill,
            hears_command=snapshot.command.fresh,
            pose_resets=snapshot.odometry.pose_resets,
        )
        self._inputs = replace(self._inputs, driver=Received(driver, self.clock.now_s))

    def _on_safety(self, decision: Decision) -> None:
        stops, estop = decision.action is Action.STOP, decision.cause.is_estop
        safety = Safety(stops, decision.cause, decision.detail, estop)
        self._inputs = replace(self._inputs, safety=Received(safety, self.clock.now_s))

    def _on_mux(self, decision: MuxDecision) -> None:
        own = self._own_source
        locked = (source.reason for source in decision.sources if source.name == own and source.locked)
        mux = Mux(decision.active or "", next(locked, ""))
        self._inputs = replace(self._inputs, mux=Received(mux, self.clock.now_s))
