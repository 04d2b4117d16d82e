"""The keys of robot.yaml below `health` and `battery`: what motor_driver warns of, and where the supply comes from."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from canbase_config.section import MisfitError, Section


class Health(Section):
    """Limits of what a drive measures besides its motion. A value beyond one is a warning and stops nothing; a stall,
    which has keys of its own, stops the base."""

    voltage_low_v: Annotated[float, Field(ge=1.0, le=1000.0, description="a drive's supply below [V]")] | None = None
    voltage_high_v: Annotated[float, Field(ge=1.0, le=1000.0, description="a drive's supply above [V]")] | None = None
    current_high_a: Annotated[float, Field(gt=0.0, le=1000.0, description="a motor's current above [A]")] | None = None
    temperature_high_c: (
        Annotated[float, Field(ge=20.0, le=200.0, description="a drive's temperature above [°C]")] | None
    ) = None
    stall_torque_share: Annotated[
        float,
        Field(
            ge=0.1,
            le=3.0,
            description="a wheel stalls: at least this share of the rated torque (6077h, 6078h), no speed, though "
            "motion is ordered; ...",
        ),
    ] = 0.8
    stall_time_s: (
        Annotated[
            float,
            Field(
                ge=0.05, le=2.0, description="... for this time; default: 0.88 × watchdog.motion_missing_s, 0.22 s [s]"
            ),
        ]
        | None
    ) = None

    @model_validator(mode="after")
    def _low_below_high(self) -> Health:
        low, high = self.voltage_low_v, self.voltage_high_v
        if low is not None and high is not None and low >= high:
            message = f"voltage_low_v ({low}) must be below voltage_high_v ({high})"
            raise MisfitError(message, ("voltage_low_v",), ("voltage_high_v",))
        return self


class Battery(Section):
    """The drives' supply is the battery: motor_driver publishes battery_state from the voltage that they measure."""

    full_v: Annotated[float, Field(ge=1.0, le=1000.0, description="a full battery at rest [V]")]
    empty_v: Annotated[float, Field(ge=1.0, le=1000.0, description="an empty battery at rest [V]")]
    design_capacity_ah: (
        Annotated[float, Field(gt=0.0, le=10_000.0, description="by its manufacturer [Ah]; none: unknown")] | None
    ) = None

    @model_validator(mode="after")
    def _empty_below_full(self) -> Battery:
        if self.empty_v >= self.full_v:
            message = f"empty_v ({self.empty_v}) must be below full_v ({self.full_v})"
            raise MisfitError(message, ("empty_v",), ("full_v",))
        return self
