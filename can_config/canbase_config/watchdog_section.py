"""The keys of robot.yaml below `watchdog`: how much the watchdog forgives. What its process gets is `watchdog.py`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from canbase_config.section import Section


class Relay(Section):
    """A GPIO output that is toggled as long as the last rung of the ladder is not reached. Needs the package gpiod."""

    chip: Annotated[str, Field(min_length=1, max_length=100, description="/dev/gpiochip0, …")]
    line: Annotated[int, Field(ge=0, le=1023, description="offset of the line on the chip")]


class Watchdog(Section):
    """Times and tolerances of the watchdog. No tolerance can be switched off; most are bounded by the limits too."""

    latency_s: Annotated[
        float,
        Field(ge=0.02, le=0.5, description="delay of an order to the driver, in addition to timeouts.command_s [s]"),
    ] = 0.05
    drive_lag_s: Annotated[
        float, Field(ge=0.01, le=0.5, description="time for which a wheel may keep the speed of an older setpoint [s]")
    ] = 0.1
    target_tolerance_mps: Annotated[
        float,
        Field(gt=0.0, le=0.2, description="tolerance of a setpoint beyond what the leases allow, at the rim [m/s]"),
    ] = 0.03
    target_tolerance_share: Annotated[
        float, Field(ge=0.0, le=0.2, description="the same as a share of the allowed speed, added to it")
    ] = 0.03
    motion_tolerance_mps: Annotated[
        float,
        Field(gt=0.0, le=0.5, description="tolerance of a wheel beyond what its setpoints allow, at the rim [m/s]"),
    ] = 0.05
    motion_tolerance_share: Annotated[
        float, Field(ge=0.0, le=0.25, description="the same as a share of the allowed speed, added to it")
    ] = 0.1
    feedback_samples: Annotated[
        int,
        Field(
            ge=1,
            le=10,
            description="number of bad velocity samples in a row that stops the base; fewer below 100 Hz",
        ),
    ] = 5
    overspeed_factor: Annotated[
        float, Field(ge=1.05, le=1.5, description="overspeed: a multiple of the speed that the limits allow")
    ] = 1.2
    travel_tolerance_m: Annotated[
        float,
        Field(
            ge=0.005, le=0.0625, description="encoder and measured velocity apart, within about 0.25 m of travel [m]"
        ),
    ] = 0.05
    motion_missing_s: Annotated[
        float,
        Field(
            ge=0.1,
            le=2.0,
            description="no sign of ordered motion for this time, after the lag; with a brake: longer [s]",
        ),
    ] = 0.25
    motion_missing_m: Annotated[
        float, Field(ge=0.001, le=0.1, description="... and for this much of the ordered travel [m]")
    ] = 0.005
    stand_proof: Annotated[
        Literal["let_go", "none"],
        Field(
            description="let_go: after an order, a drive that holds a wheel at standstill loses its power for a "
            "moment, because a dead encoder also reports standstill; none: never, and a dead encoder at standstill is "
            "not detected"
        ),
    ] = "let_go"
    stand_impulse_s: Annotated[
        float,
        Field(ge=0.02, le=2.0, description="... after this time at rated torque, or longer at less torque [s]"),
    ] = 0.05
    stand_answer_s: Annotated[
        float,
        Field(
            ge=0.1,
            le=2.0,
            description="a drive switches its power off and reports it within this time; with a brake: longer [s]",
        ),
    ] = 0.2
    jolt_mps2: Annotated[
        float,
        Field(ge=5.0, le=200.0, description="greater changes of speed are not plausible: the sensor has failed [m/s²]"),
    ] = 20.0
    slow_wheel_share: Annotated[
        float, Field(ge=0.0, le=0.5, description="a wheel slower than its setpoint, beside motion_tolerance_mps")
    ] = 0.3
    slow_wheel_s: Annotated[float, Field(ge=0.1, le=3.0, description="a wheel is too slow for this time [s]")] = 0.5
    slowest_ramp_mps2: (
        Annotated[
            float,
            Field(
                gt=0.0,
                le=10.0,
                description="least acceleration towards the setpoint; default: a quarter of the limits [m/s²]",
            ),
        ]
        | None
    ) = None
    twist_tolerance_mps: Annotated[
        float, Field(gt=0.0, le=0.2, description="tolerance of the base motion that was not ordered, at the rim [m/s]")
    ] = 0.01
    twist_tolerance_share: Annotated[
        float, Field(ge=0.0, le=0.25, description="the same as a share of the ordered speed, added to it")
    ] = 0.08
    twist_s: Annotated[float, Field(ge=0.1, le=3.0, description="... and for this time [s]")] = 0.5
    bus_failed_s: Annotated[
        float, Field(ge=0.06, le=0.5, description="the bus accepts no frames for this time [s]")
    ] = 0.1
    loop_late_s: Annotated[
        float, Field(ge=0.02, le=0.5, description="the watchdog's own loop does not run for this time [s]")
    ] = 0.1
    relay: Annotated[Relay, Field(description="GPIO line that keeps a safety relay closed")] | None = None
