"""What the sources of the mux want: the greatest motion that one of them has ordered and that still holds."""

from __future__ import annotations

from campaign.envelope import braking_s
from canbase_config.robot import Robot
from canbase_velocity.twist import Twist


class Wishes:
    """Each source's last command holds for its timeout in robot.yaml."""

    def __init__(self, robot: Robot, now: float) -> None:
        self._robot = robot
        self._timeouts = {source.topic: source.timeout_s for source in robot.mux.sources.values()}
        self._last: dict[str, tuple[float, float]] = dict.fromkeys(self._timeouts, (0.0, now))

    def take(self, topic: str, twist: Twist, now: float) -> None:
        """A message on any topic; only sources count, and only finite commands."""
        if topic in self._timeouts and twist.is_finite:
            self._last[topic] = braking_s(self._robot, twist.linear_mps, twist.angular_radps), now

    def greatest_s(self, now: float) -> float:
        """τ of the greatest command that holds [s]."""
        return max(tau_s if now <= at + self._timeouts[topic] else 0.0 for topic, (tau_s, at) in self._last.items())
