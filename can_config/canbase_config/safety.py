"""The keys of robot.yaml below `safety`: what the safety filter evaluates, and how near the base may come."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from canbase_config.section import MisfitError, Section, Topic

MAX_SCANS = 8


class Scan(Section):
    """One laser scanner that the safety filter evaluates. Its pose is written here, or read from tf_static."""

    required: Annotated[
        bool, Field(description="true: without a fresh scan nothing moves; false: blind_mps where it looked")
    ]
    topic: Annotated[Topic, Field(description="sensor_msgs/LaserScan")] = "scan"
    timeout_s: Annotated[float, Field(ge=0.05, le=1.0, description="[s]")] = 0.3
    pose: Annotated[
        Literal["config", "tf"], Field(description="config: the keys below; tf: tf_static, by the scan's frame_id")
    ] = "config"
    x_m: Annotated[float, Field(ge=-5.0, le=5.0, description="scanner in base_link [m]")] = 0.0
    y_m: Annotated[float, Field(ge=-5.0, le=5.0, description="scanner in base_link [m]")] = 0.0
    yaw_rad: Annotated[float, Field(ge=-2 * math.pi, le=2 * math.pi, description="scanner in base_link [rad]")] = 0.0
    upside_down: Annotated[bool, Field(description="mounted with its z axis down (roll π)")] = False
    range_m: Annotated[
        float | None,
        Field(
            gt=0.0,
            le=200.0,
            description="how far it detects what the base must not touch, also dark things; nothing beyond it counts "
            "as free; none: range_max of its scans [m]",
        ),
    ] = None
    min_points: Annotated[
        int, Field(ge=1, le=10, description="fewer adjacent beams count only if the next scan sees them again")
    ] = 2
    below_range_min: Annotated[
        Literal["invalid", "too_near"],
        Field(description="meaning of 0 and finite readings below range_min: unusable beam, or an object too near"),
    ] = "invalid"
    allow_empty: Annotated[
        bool, Field(description="true: a scan may have no reading in range; false: such a scan is not used")
    ] = True
    frozen_s: Annotated[
        float, Field(ge=0.2, le=10.0, description="identical readings for longer: the scanner is frozen [s]")
    ] = 0.5
    same_clock: Annotated[
        bool,
        Field(
            description="true: its stamps use this computer's clock, or one kept in step: their age is the delay; "
            "false: how old its scans are is unknown, what only it sees is limited to blind_mps"
        ),
    ] = True
    noisy: Annotated[
        bool, Field(description="false: a simulator without noise; equal readings count only while the base moves")
    ] = True


class Estop(Section):
    """The software emergency stop topic (std_msgs/Bool, true = stop). Not a safety function: STO is."""

    required: Annotated[bool, Field(description="true: pressed while no message arrives")]
    topic: Annotated[Topic, Field(description="std_msgs/Bool, true: stop")] = "estop_state"
    timeout_s: Annotated[float, Field(ge=0.05, le=2.0, description="[s]")] = 0.5
    latched: Annotated[
        bool, Field(description="true: a reset is needed after its release; false: one zero command")
    ] = True


class Footprint(Section):
    """Rectangle around the base in base_link, distances from its origin, all positive."""

    front_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]
    rear_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]
    left_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]
    right_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]


class LimitZone(Section):
    """A rectangle in base_link in which any obstacle limits the speed, whatever the direction of travel."""

    front_m: Annotated[float, Field(gt=0.0, le=10.0, description="[m]")]
    rear_m: Annotated[float, Field(gt=0.0, le=10.0, description="[m]")]
    left_m: Annotated[float, Field(gt=0.0, le=10.0, description="[m]")]
    right_m: Annotated[float, Field(gt=0.0, le=10.0, description="[m]")]
    linear_mps: Annotated[float, Field(gt=0.0, le=5.0, description="at most, while it is not empty [m/s]")]
    angular_radps: Annotated[float, Field(gt=0.0, le=20.0, description="at most, while it is not empty [rad/s]")]


class Ceiling(Section):
    """What the filter lets through at most, beside `limits`, which the driver holds by itself."""

    linear_mps: Annotated[float, Field(gt=0.0, le=5.0, description="[m/s]")]
    angular_radps: Annotated[float, Field(gt=0.0, le=20.0, description="[rad/s]")]
    acceleration_mps2: Annotated[float, Field(gt=0.0, le=10.0, description="orders grow no faster [m/s²]")]
    angular_acceleration_radps2: Annotated[float, Field(gt=0.0, le=50.0, description="orders grow no faster [rad/s²]")]


class Safety(Section):
    """The safety filter, the last part that changes a command."""

    footprint: Footprint
    padding_m: Annotated[float, Field(ge=0.0, le=0.5, description="added to the footprint on all sides [m]")] = 0.01
    scan: Scan
    more_scans: Annotated[
        tuple[Scan, ...], Field(max_length=MAX_SCANS - 1, strict=False, description="further scanners")
    ] = ()
    estop: Estop
    ceiling: Annotated[Ceiling | None, Field(description="none: the speeds of `limits`")] = None
    command_timeout_s: Annotated[float, Field(ge=0.05, le=0.5, description="cmd_vel_mux at the filter [s]")] = 0.2
    reaction_s: Annotated[float, Field(ge=0.01, le=1.0, description="from an order until the wheels follow it [s]")] = (
        0.1
    )
    stop_distance_m: Annotated[float, Field(gt=0.0, le=5.0, description="free path below: stop [m]")] = 0.15
    slow_distance_m: Annotated[float, Field(gt=0.0, le=10.0, description="free path below: slow down [m]")] = 0.6
    limit_zones: Annotated[
        tuple[LimitZone, ...],
        Field(
            max_length=8, strict=False, description="obstacles in them, or places without a scanner, limit the speed"
        ),
    ] = ()
    blind_mps: Annotated[
        float,
        Field(ge=0.0, le=0.3, description="speed limit where scanners do not cover the path; 0: no motion there [m/s]"),
    ] = 0.15
    uncommissioned_mps: Annotated[
        float,
        Field(
            ge=0.02,
            le=5.0,
            description="speed limit until canbase setup commission has finished all steps, and at most a tenth of "
            "limits.linear_mps until its step scale has proven the units of the drives [m/s]",
        ),
    ] = 0.3
    require_self_stop: Annotated[
        bool,
        Field(
            description="true: no power before canbase setup commission has proven, with these drives, "
            "that each one stops "
            "by itself when this computer fails; false: STO has to stop those that do not"
        ),
    ] = False

    @property
    def scans(self) -> tuple[Scan, ...]:
        """All scanners."""
        return (self.scan, *self.more_scans)

    @model_validator(mode="after")
    def _slow_before_stop(self) -> Safety:
        if self.slow_distance_m <= self.stop_distance_m:
            slow, stop = self.slow_distance_m, self.stop_distance_m
            message = f"slow_distance_m ({slow}) must be greater than stop_distance_m ({stop})"
            raise MisfitError(message, ("slow_distance_m",), ("stop_distance_m",))
        return self

    @model_validator(mode="after")
    def _a_topic_each(self) -> Safety:
        topics = [scan.topic for scan in self.scans]
        for i, scan in enumerate(self.more_scans):
            if topics.index(scan.topic) <= i:
                message = f"two scanners have the topic {scan.topic}; each needs its own"
                raise MisfitError(message, ("more_scans", i, "topic"))
        return self
