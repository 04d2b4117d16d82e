"""The keys of robot.yaml below `action`: drive_distance, rotate_angle, and the behaviours of Nav2."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import BeforeValidator, Field, model_validator

from canbase_config.section import MisfitError, Section

BEHAVIORS: Final = ("drive_on_heading", "backup", "spin")
"""Actions of Nav2 that the action server has with `nav2_behaviors`, under the names that behavior_server gives them."""


def _no_parallel(policy: object) -> object:
    if policy == "parallel":
        raise MisfitError(
            "there is one base, and two goals would both order its speed; choose reject, queue or preempt"
        )
    return policy


class Action(Section):
    """The action server: drive_distance and rotate_angle."""

    goal_policy: Annotated[
        Literal["reject", "queue", "preempt"],
        BeforeValidator(_no_parallel),
        Field(description="a new goal while one runs: rejected, queued, or it replaces the running goal after a stop"),
    ] = "reject"
    queue_length: Annotated[
        int, Field(ge=1, le=100, description="maximum number of waiting goals, with goal_policy: queue")
    ] = 8

    require_client_lease: Annotated[
        bool, Field(description="true: a goal runs only while its client sends keepalives; `canbase drive` does")
    ] = False
    client_lease_s: Annotated[
        float, Field(ge=0.3, le=10.0, description="without a keepalive for longer: CLIENT_LOST, if required [s]")
    ] = 1.0
    min_distance_m: Annotated[float, Field(gt=0.0, le=1.0, description="[m]")] = 0.01
    max_distance_m: Annotated[float, Field(gt=0.0, le=1000.0, description="[m]")] = 5.0
    min_speed_mps: Annotated[float, Field(gt=0.0, le=1.0, description="[m/s]")] = 0.02
    max_speed_mps: Annotated[float, Field(gt=0.0, le=5.0, description="[m/s]")] = 0.5
    min_angle_rad: Annotated[float, Field(gt=0.0, le=1.0, description="smallest goal of rotate_angle [rad]")] = 0.02
    max_angle_rad: Annotated[
        float, Field(gt=0.0, le=1000.0, description="largest goal of rotate_angle; default: ten turns [rad]")
    ] = 63.0
    min_speed_radps: Annotated[float, Field(gt=0.0, le=1.0, description="[rad/s]")] = 0.1
    max_speed_radps: Annotated[float, Field(gt=0.0, le=20.0, description="[rad/s]")] = 1.5
    tolerance_m: Annotated[
        float,
        Field(
            gt=0.0,
            le=0.1,
            description="a goal that ends within this distance has succeeded; of a turn, at the wheels' rims [m]",
        ),
    ] = 0.005
    lateral_tolerance_m: Annotated[
        float,
        Field(
            gt=0.0, le=1.0, description="farther beside its line, or in a turn away from its position: DRIVE_FAULT [m]"
        ),
    ] = 0.05
    heading_tolerance_rad: Annotated[
        float, Field(gt=0.0, le=1.5, description="heading differs more from its line: DRIVE_FAULT [rad]")
    ] = 0.2
    control_hz: Annotated[float, Field(ge=10.0, le=100.0, description="cmd_vel_action [Hz]")] = 50.0
    feedback_hz: Annotated[float, Field(ge=1.0, le=50.0, description="[Hz]")] = 10.0
    progress_timeout_s: Annotated[
        float, Field(ge=0.2, le=60.0, description="without motion for longer: NO_PROGRESS [s]")
    ] = 2.0
    overall_factor: Annotated[
        float,
        Field(ge=1.1, le=100.0, description="overall timeout = factor × the ideal time of the goal + overall_extra_s"),
    ] = 2.0
    overall_extra_s: Annotated[float, Field(ge=0.5, le=600.0, description="[s]")] = 5.0
    nav2_behaviors: Annotated[
        bool,
        Field(
            description="true: also serves drive_on_heading, backup and spin of Nav2, whose behavior_server must not"
        ),
    ] = False
    spin_speed_radps: Annotated[
        float, Field(gt=0.0, le=20.0, description="of Nav2's spin; max_speed_radps where that is lower [rad/s]")
    ] = 1.0

    @model_validator(mode="after")
    def _ordered(self) -> Action:
        if self.spin_speed_radps < self.min_speed_radps:
            message = (
                f"spin_speed_radps ({self.spin_speed_radps}) must not be below min_speed_radps ({self.min_speed_radps})"
            )
            raise MisfitError(message, ("spin_speed_radps",), ("min_speed_radps",))
        for quantity in ("distance_m", "speed_mps", "angle_rad", "speed_radps"):
            low, high = f"min_{quantity}", f"max_{quantity}"
            if getattr(self, low) >= getattr(self, high):
                message = f"{high} ({getattr(self, high)}) must be greater than {low} ({getattr(self, low)})"
                raise MisfitError(message, (high,), (low,))
        if self.nav2_behaviors and self.require_client_lease:
            message = "behaviour trees send no keepalives: each of their goals would end with CLIENT_LOST"
            raise MisfitError(message, ("nav2_behaviors",), ("require_client_lease",))
        return self
