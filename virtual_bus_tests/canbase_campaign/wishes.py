"""What the sources of the mux want: the greatest motion that one of them has ordered and that still holds."""

from __future__ import annotations

from canbase_campaign.envelope import braking_s
from canbase_config.robot import Robot
from canbase_velocity.twist import Twist

RECENT_S = 0.05


class Wishes:
    """Each source's last command holds for its timeout in robot.yaml.

    One that orders motion while the stop button is pressed, or a reset is done, does not count from then on, until it
    orders zero or was absent for its neutral_after_s. By what has arrived: no part knows a command that is still on its
    way.
    """

    def __init__(self, robot: Robot, now_s: float) -> None:
        self._robot = robot
        self._timeouts = {source.topic: source.timeout_s for source in robot.mux.sources.values()}
        self._neutral_after = {source.topic: source.neutral_after_s for source in robot.mux.sources.values()}
        self._held: set[str] = set()
        self._last: dict[str, tuple[float, float]] = dict.fromkeys(self._timeouts, (0.0, now_s))
        self._arrived = dict(self._last)
        self._before = dict(self._last)
        """The greatest one of RECENT_S before it: a reader of one of two hands on a joystick may take the other."""

    def take(self, topic: str, twist: Twist, now_s: float) -> None:
        """A message was sent on any topic; only sources count, and only finite commands."""
        if topic not in self._timeouts or not twist.is_finite:
            return
        before = self._last[topic], self._before[topic]
        self._before[topic] = max((each for each in before if now_s <= each[1] + RECENT_S), default=(0.0, now_s))
        self._last[topic] = self._tau_s(twist), now_s

    def arrive(self, topic: str, twist: Twist, now_s: float) -> None:
        """The message has arrived at the mux."""
        if topic not in self._timeouts or not twist.is_finite:
            return
        patience_s = self._neutral_after[topic]
        if twist.is_zero or (patience_s and now_s > self._arrived[topic][1] + patience_s):
            self._held.discard(topic)
        self._arrived[topic] = self._tau_s(twist), now_s

    def on_stop(self, now_s: float) -> None:
        """A reset is done, or the stop button holds: a source that orders motion now was held over it. Its last command
        tells: of two hands one has shown zero since the motion of the other."""
        self._held = {topic for topic in self._arrived if self._holds_s(topic, self._arrived[topic], now_s) > 0.0}

    def on_pause(self, now_s: float) -> None:
        """The base is held by a lock, or by the absence of scans. Programs with a goal go on after it: a joystick that
        orders motion now, or publishes nothing, counts from its next zero on."""
        for topic, (tau_s, at) in self._arrived.items():
            at_zero = tau_s == 0.0 and now_s <= at + self._timeouts[topic]
            if self._neutral_after[topic] is None and not at_zero:
                self._held.add(topic)

    def greatest_s(self, now_s: float) -> float:
        """τ of the greatest command that holds [s]."""
        return max(0.0 if topic in self._held else self._orders_s(topic, now_s) for topic in self._last)

    def _orders_s(self, topic: str, now_s: float) -> float:
        before_s, before_at = self._before[topic]
        recent_s = before_s if now_s <= before_at + RECENT_S else 0.0
        return max(self._holds_s(topic, self._last[topic], now_s), recent_s)

    def _holds_s(self, topic: str, command: tuple[float, float], now_s: float) -> float:
        tau_s, at = command
        return tau_s if now_s <= at + self._timeouts[topic] else 0.0

    def _tau_s(self, twist: Twist) -> float:
        return braking_s(self._robot, twist.linear_mps, twist.angular_radps)
