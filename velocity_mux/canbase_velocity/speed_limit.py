"""Speed limits that are set while the robot runs: by a parameter and by Nav2, never above robot.yaml. Pure.

Rules:
1. Each giver has a limit of its own; of two the lower one holds. What one gives, another one cannot lift.
2. A limit that is no number, negative or above robot.yaml is refused, and the one before stays.
3. A limit stays until its giver changes it: a giver that ends or hangs lifts nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

from canbase_config.robot import Robot
from canbase_velocity.twist import Twist


class Giver(Enum):
    """Who sets a limit."""

    PARAMETER = "the parameters speed_limit of safety_filter"
    NAV2 = "Nav2 on speed_limit"


@dataclass(frozen=True, slots=True)
class SpeedLimit:
    """Greatest speeds, as magnitudes [m/s], [rad/s]; 0: no motion."""

    linear_mps: float = math.inf
    angular_radps: float = math.inf

    def share(self, twist: Twist) -> float:
        """How much of `twist` both limits leave, 0 to 1, on the same curve."""
        return min(_share(twist.linear_mps, self.linear_mps), _share(twist.angular_radps, self.angular_radps))

    def lower_of(self, other: SpeedLimit) -> SpeedLimit:
        """Of each speed the lower limit."""
        return SpeedLimit(min(self.linear_mps, other.linear_mps), min(self.angular_radps, other.angular_radps))

    def __str__(self) -> str:
        return f"{self.linear_mps:g} m/s, {self.angular_radps:g} rad/s"


NO_LIMIT = SpeedLimit()


class RefusedLimitError(ValueError):
    """A limit that cannot be; its text is for the one who gave it."""


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """`most`: what robot.yaml permits. A change is a new value."""

    most: SpeedLimit
    given: Mapping[Giver, SpeedLimit] = field(default_factory=dict)

    @staticmethod
    def of(robot: Robot) -> SpeedLimits:
        """Nothing is lowered yet: `limits`, and `safety.ceiling` where it is lower."""
        ceiling = robot.safety.ceiling
        most = SpeedLimit(robot.limits.linear_mps, robot.limits.angular_radps)
        return SpeedLimits(most.lower_of(SpeedLimit(ceiling.linear_mps, ceiling.angular_radps)) if ceiling else most)

    @property
    def effective(self) -> SpeedLimit:
        """What holds now."""
        limit = self.most
        for each in self.given.values():
            limit = limit.lower_of(each)
        return limit

    @property
    def by(self) -> str:
        """Who has lowered it; empty: nobody."""
        return " and ".join(
            giver.value for giver, limit in self.given.items() if limit.lower_of(self.most) != self.most
        )

    def parameter(self, name: str, value: object) -> SpeedLimits:
        """With one of the parameters, `linear_mps` or `angular_radps`. Raises RefusedLimitError."""
        before = self.given.get(Giver.PARAMETER, self.most)
        return self._with(Giver.PARAMETER, replace(before, **{name: _within(name, value, getattr(self.most, name))}))

    def nav2(self, speed_limit: float, *, percentage: bool) -> SpeedLimits:
        """With a message of nav2_msgs/SpeedLimit: 0 is no limit. As in Nav2's controllers the ratio of the linear
        speeds counts for both. More than ours is none. Raises RefusedLimitError.
        """
        if not (math.isfinite(speed_limit) and speed_limit >= 0.0):
            raise RefusedLimitError(f"{speed_limit:g} is no speed limit: expected 0 or more")
        if speed_limit == 0.0:
            return self._with(Giver.NAV2, self.most)
        ratio = speed_limit / (100.0 if percentage else self.most.linear_mps)
        return self._with(Giver.NAV2, SpeedLimit(ratio * self.most.linear_mps, ratio * self.most.angular_radps))

    def _with(self, giver: Giver, limit: SpeedLimit) -> SpeedLimits:
        return SpeedLimits(self.most, {**self.given, giver: limit})


def _within(name: str, value: object, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= most:
        raise RefusedLimitError(
            f"speed_limit.{name} is {value!r}: expected 0 to {most:g}, which is the limit in robot.yaml; "
            "a robot that shall be faster needs another limits or safety.ceiling there"
        )
    return float(value)


def _share(speed: float, limit: float) -> float:
    return 1.0 if abs(speed) <= limit else limit / abs(speed)
