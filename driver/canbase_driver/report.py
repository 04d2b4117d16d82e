"""What the driver knows at one moment, collected from its parts into a `DriverSnapshot`. It changes none of them."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_config.robot import Base
from canbase_driver.drives.drive_group import Drives, age_s
from canbase_driver.drives.odometry_feed import OdometryFeed
from canbase_driver.motion.kinematics import base_twist
from canbase_driver.motion.velocity_command import Command
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.bus_health import BusReport
from canbase_driver.supervision.cycle_stats import CycleStats
from canbase_driver.supervision.supervisor import Supervisor
from canbase_driver.supervision.watchdog_link import WatchdogLink


@dataclass(frozen=True, slots=True)
class Told:
    """The parts of the core that have something to tell. `frames_dropped`: by the core itself."""

    supervisor: Supervisor
    watchdog: WatchdogLink
    drives: Drives
    feed: OdometryFeed
    command: Command
    stats: CycleStats
    bus: BusReport
    bus_problem: str
    frames_dropped: int


def snapshot_of(told: Told, base: Base, now_s: float) -> DriverSnapshot:
    """The snapshot at the monotonic time `now_s` [s]."""
    supervisor, watchdog, drives, odometry = told.supervisor, told.watchdog, told.drives, told.feed.odometry
    view, _detail = watchdog.view(now_s)
    measured = base_twist(*drives.speeds_mps(), base.track_m)
    counters, finding = watchdog.counters, supervisor.finding
    return DriverSnapshot(
        time_s=now_s,
        state=supervisor.state,
        cause=finding.cause,
        detail=finding.detail,
        clears_on=finding.clears_on,
        watchdog=view,
        watchdog_cause=watchdog.cause,
        watchdog_age_s=watchdog.age_s(now_s),
        watchdog_rung=watchdog.rung,
        watchdog_lease_age_s=watchdog.lease_age_s,
        watchdog_trips=counters.trips,
        watchdog_leases_refused=counters.leases_refused,
        watchdog_frames_dropped=counters.frames_dropped,
        watchdog_bus_errors=counters.bus_errors,
        watchdog_pause_max_s=counters.pause_max_ms / 1000.0,
        standstill=drives.are_proven_to_stand(now_s),
        standstill_assumed=drives.assumed(now_s),
        command_age_s=age_s(now_s, told.command.received_at),
        command_fresh=told.command.is_fresh(now_s),
        commands_refused=told.command.refused,
        cycles=told.stats.cycles,
        overruns=told.stats.overruns,
        cycle_lateness_max_s=told.stats.worst_s,
        frames_dropped=told.frames_dropped + told.bus.dropped,
        send_errors=told.bus.send_errors,
        bus_problem=told.bus_problem,
        controller=told.bus.controller,
        receive_errors=told.bus.receive_errors,
        error_frames=told.bus.error_frames,
        bus_failures=told.bus.failures,
        drives=drives.snapshots(now_s),
        x_m=odometry.pose.x_m,
        y_m=odometry.pose.y_m,
        yaw_rad=odometry.pose.yaw_rad,
        linear_mps=measured.linear_mps,
        angular_radps=measured.angular_radps,
        pose_covariance=odometry.pose_covariance(),
        twist_covariance=odometry.twist_covariance(),
        odometry_valid=drives.are_fresh(now_s) and drives.have_references(),
        travel_losses=drives.losses(),
        pose_resets=told.feed.pose_resets,
        odom_frame=base.odom_frame,
        base_frame=base.base_frame,
    )
