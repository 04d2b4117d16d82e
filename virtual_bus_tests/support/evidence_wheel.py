"""A wheel on the table: samples every 1/64 s, 1 mm/s per bit. Times and speeds are binary fractions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from canbase_watchdog.motion_evidence import Evidence, EvidenceWatch
from support.watchdog_story import config

HZ = 64.0
CONFIG = replace(
    config(),
    control_hz=HZ,
    drive_lag_s=0.125,
    standstill_mps=2.0**-7,
    motion_tolerance_mps=0.0625,
    motion_missing_s=0.25,
    motion_missing_m=2.0**-4,
    jolt_mps2=16.0,
    slow_wheel_share=0.25,
    slow_wheel_s=0.5,
    slowest_ramp_mps2=0.5,
)


class Wheel:
    """An enabled wheel on the table."""

    def __init__(self, m_per_count: float = 2.0**-13, mps_per_bit: float = 0.0, **changes: Any) -> None:
        drive = replace(CONFIG.drives[0], mps_per_bit=mps_per_bit, m_per_count=m_per_count)
        self.watch = EvidenceWatch(drive, replace(CONFIG, **changes), 0.0)
        self.n = 0

    @property
    def last(self) -> Evidence:
        return self.watch.last

    def sample(
        self,
        setpoint: float,
        velocity: float,
        *,
        rolls: float | None = None,
        enabled: bool = True,
        powered: bool = True,
        known: bool = True,
        cycles: float = 1.0,
        torque: float | None = None,
    ) -> Evidence:
        """One cycle. By default the encoder rolls like the velocity."""
        self.n += 1
        now_s, elapsed_s = self.n / HZ, cycles / HZ
        self.watch.on_setpoint(setpoint, now_s)
        step_m = (velocity if rolls is None else rolls) * elapsed_s
        self.watch.on_sample(
            velocity, step_m if known else None, powered, enabled and powered, elapsed_s, now_s, torque
        )
        return self.last

    def samples(self, count: int, setpoint: float, velocity: float, **how: Any) -> Evidence:
        for _ in range(count):
            self.sample(setpoint, velocity, **how)
        return self.last


def rolling(setpoint: float = 0.25, **changes: Any) -> Wheel:
    """It has followed its order for longer than the lag."""
    wheel = Wheel(**changes)
    wheel.samples(16, setpoint, setpoint / 2, rolls=setpoint)
    return wheel
