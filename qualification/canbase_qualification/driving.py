"""A drive without any failure: nothing may stop it, and how near each timeout came to its limit."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import replace

from canbase_campaign.ordinary import OrdinaryHour
from canbase_campaign.robots import DrawnRobot
from canbase_campaign.world import World
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID
from canbase_qualification.outcome import Ages, Outcome, Violation

WATCHDOG_STATE, STATUS = 0x1FE, 0x180
HEARTBEATS = (0x700 + DRIVER_NODE_ID, 0x700 + WATCHDOG_NODE_ID)
WATCHED = ("lease_s", "command_s", "odometry_s", "feedback_s", "drive_heartbeat_s", "watchdog_s")
"""Keys of robot.yaml below `timeouts`."""


class AgeWatch:
    """The longest time between two of the same kind, as their receiver sees it; frames: as the bus carries them."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._last: dict[tuple[str, int], float] = {}
        self._longest: dict[str, float] = {}
        self._statuses = {STATUS + node_id for node_id in world.drives.bench.nodes}
        world.on_lease = lambda twist: self._comes("lease_s")
        world.bus.watch = self._on_frame
        world.topics.subscribe("cmd_vel", world.driver, self._takes("command_s"))
        world.topics.subscribe("odom", world.action, self._takes("odometry_s"))

    def _takes(self, key: str) -> Callable[[object], None]:
        return lambda message: self._comes(key)

    def _on_frame(self, sender: str, cob_id: int, data: bytes) -> None:
        if cob_id in self._statuses:
            self._comes("feedback_s", cob_id)
        elif cob_id in HEARTBEATS:
            self._comes("drive_heartbeat_s", cob_id)
        elif cob_id == WATCHDOG_STATE:
            self._comes("watchdog_s")

    def _comes(self, key: str, which: int = 0) -> None:
        now_s = self._world.clock.now_s
        before = self._last.get((key, which), now_s)
        self._longest[key] = max(self._longest.get(key, 0.0), now_s - before)
        self._last[key, which] = now_s

    @property
    def ages(self) -> tuple[Ages, ...]:
        """Until now. A key of which nothing came is missing."""
        limits, longest = self._world.robot.timeouts, self._longest
        found = (key for key in WATCHED if key in longest)
        return tuple(Ages(f"timeouts.{key}", round(longest[key], 6), getattr(limits, key)) for key in found)


def drive(empty: Outcome, drawn: DrawnRobot, steepest: float, seconds: float) -> Outcome:
    """Drive for so long; `empty`: the outcome before anything happened."""
    hour = OrdinaryHour(empty.seed, drawn=drawn, steepest=steepest)
    watch: AgeWatch | None = None
    try:
        trip = hour.run(0.0)
        if trip is None:
            watch = AgeWatch(hour.world)
            trip = hour.go_on(seconds)
    except Exception:  # noqa: BLE001 - whatever it is: that nothing raises is one of the properties
        raised = Violation("exception", round(hour.now_s, 4), traceback.format_exc(limit=-4))
        return replace(empty, violations=(raised,), virtual_s=hour.now_s)
    stopped = () if trip is None else (Violation("undisturbed", round(trip.at_s, 4), trip.what),)
    ages = watch.ages if watch is not None else ()
    moved_m = hour.world.drives.bench.base.path_m
    return replace(empty, violations=stopped, ages=ages, virtual_s=hour.now_s, moved_m=moved_m)
