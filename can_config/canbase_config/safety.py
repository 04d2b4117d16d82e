"""The keys of robot.yaml below `safety`: what the safety filter looks at and how near it lets the base come."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from canbase_config.section import MisfitError, Section, Topic


class Scan(Section):
    """The laser scanner that the safety filter looks at."""

    required: Annotated[bool, Field(description="true: without a fresh scan nothing moves")]
    topic: Topic = "scan"
    timeout_s: Annotated[float, Field(ge=0.05, le=1.0, description="[s]")] = 0.3
    x_m: Annotated[float, Field(ge=-5.0, le=5.0, description="scanner in base_link [m]")] = 0.0
    y_m: Annotated[float, Field(ge=-5.0, le=5.0, description="scanner in base_link [m]")] = 0.0
    yaw_rad: Annotated[float, Field(ge=-2 * math.pi, le=2 * math.pi, description="scanner in base_link [rad]")] = 0.0


class Estop(Section):
    """The software emergency stop topic (std_msgs/Bool, true = stop). Not a safety function: STO is."""

    required: Annotated[bool, Field(description="true: a silent topic counts as pressed")]
    topic: Topic = "estop_state"
    timeout_s: Annotated[float, Field(ge=0.05, le=2.0, description="[s]")] = 0.5


class Footprint(Section):
    """Rectangle around the base in base_link, distances from its origin, all positive."""

    front_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]
    rear_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]
    left_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]
    right_m: Annotated[float, Field(gt=0.0, le=5.0, description="[m]")]


class Safety(Section):
    """The last place where a command is decided."""

    footprint: Footprint
    scan: Scan
    estop: Estop
    command_timeout_s: Annotated[float, Field(ge=0.05, le=0.5, description="cmd_vel_mux at the filter [s]")] = 0.2
    stop_distance_m: Annotated[float, Field(gt=0.0, le=5.0, description="free way below: stop [m]")] = 0.15
    slow_distance_m: Annotated[float, Field(gt=0.0, le=10.0, description="free way below: slow down [m]")] = 0.6

    @model_validator(mode="after")
    def _slow_before_stop(self) -> Safety:
        if self.slow_distance_m <= self.stop_distance_m:
            slow, stop = self.slow_distance_m, self.stop_distance_m
            message = f"slow_distance_m ({slow}) must be greater than stop_distance_m ({stop})"
            raise MisfitError(message, ("slow_distance_m",), ("stop_distance_m",))
        return self
