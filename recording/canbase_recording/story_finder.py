"""Finds the stops of a recording while it is read: keeps the last seconds, tells each stop when it is over. Pure."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from canbase_config.robot import Robot
from canbase_driver.cia402 import DriveState
from canbase_recording.entry import Entry
from canbase_recording.event import Event, EventKind, Level
from canbase_recording.pdo_layouts import PdoLayouts
from canbase_recording.scene import Scene, SceneMaker
from canbase_recording.story import Story, tell

BEFORE_S: Final = 6.0
"""So much before the first reaction belongs to a stop."""
QUIET_S: Final = 3.0
"""A stop is over when each drive that lost its power has it again, or so long after its last alarm ..."""
LONGEST_S: Final = 15.0
"""... or after this time: what goes on is the next one."""
SIGNS: Final = frozenset(
    {EventKind.HEARTBEAT_LOST, EventKind.SYNC_LOST, EventKind.EMERGENCY, EventKind.BOOT_UP, EventKind.NMT_COMMAND}
)
"""Alarms that report, and stop nothing themselves."""
SIGN_S: Final = 1.0
"""A sign this long before the first part acts is a story of its own [s]."""
BACK_S: Final = 0.2
"""A SYNC that is back for so long before anything else happens has stopped nothing."""
LEAST_ENTRIES: Final = 200
"""So many before it belong to a stop in any case: those before a long pause."""
MOST_STOPS: Final = 12
MOST_ENTRIES: Final = 300_000
MOST_EVENTS: Final = 2_000


class StoryFinder:
    """`stories`: the first MOST_STOPS; `further`: how many more there were, which are not told."""

    def __init__(self, layouts: PdoLayouts, robot: Robot | None) -> None:
        self.stories: list[Story] = []
        self.further = 0
        self._maker = SceneMaker(layouts, robot)
        self._ring: deque[Entry] = deque(maxlen=MOST_ENTRIES)
        self._events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self._began_s: float | None = None
        self._alarm_s = 0.0
        self._acted = False
        """Some part has acted, not only reported."""
        self._only_sync = False
        self._back_s = math.inf
        """When SYNC was back, of a stop that began by its absence, and in which nothing else has happened."""
        self._off: dict[str, float] = {}
        """Axes without power, and since when [s]."""

    def on_entry(self, entry: Entry) -> None:
        """The next entry; its events come after it."""
        if self._began_s is not None and self._is_over(entry.at_s):
            self.end(entry.at_s)
        ring = self._ring
        ring.append(entry)
        if self._began_s is None:
            oldest = entry.at_s - BEFORE_S
            while ring[0].at_s < oldest and len(ring) > LEAST_ENTRIES:
                ring.popleft()

    def on_event(self, event: Event) -> None:
        """Something happened."""
        while self._began_s is None and self._events and self._events[0].at_s < event.at_s - BEFORE_S:
            self._events.popleft()
        self._events.append(event)
        if event.level is Level.ALARM:
            self._on_alarm(event)
        if event.kind is EventKind.DRIVE_STATE:
            self._on_drive(event)
        if event.kind is EventKind.SYNC_BACK and self._only_sync:
            self._back_s = event.at_s

    def _on_alarm(self, event: Event) -> None:
        acts = event.kind not in SIGNS
        if self._began_s is not None and not self._acted:
            is_old = acts and event.at_s - self._began_s > SIGN_S
            if is_old or event.at_s - self._back_s > BACK_S:
                self.end(event.at_s)
        if self._began_s is None:
            self._began_s, self._acted, self._only_sync = event.at_s, False, True
        self._only_sync = self._only_sync and event.kind is EventKind.SYNC_LOST
        self._back_s = math.inf
        self._alarm_s = event.at_s
        self._acted = self._acted or acts

    def _on_drive(self, event: Event) -> None:
        """A stop ends with the power of the last axis that had lost it."""
        if not event.text.startswith(DriveState.OPERATION_ENABLED.text):
            since_s = self._off.get(event.who, event.at_s)
            self._off[event.who] = event.at_s if event.level is Level.ALARM else since_s
        elif self._off.pop(event.who, None) is not None and self._began_s is not None:
            recent_s = self._began_s - SIGN_S
            if all(off_s < recent_s for off_s in self._off.values()):
                self.end(event.at_s)

    def end(self, at_s: float) -> None:
        """The stop that is open is over, if there is one."""
        if self._began_s is None:
            return
        if len(self.stories) < MOST_STOPS:
            ended_s = self._ring[-1].at_s if self._ring else at_s
            scene = self._maker.make(self._ring, list(self._events), self._began_s, ended_s)
            if self._acted or not _all_went_on(scene):
                self.stories.append(tell(scene))
                scene.slim()
        else:
            self.further += 1
        self._began_s = None

    def _is_over(self, now_s: float) -> bool:
        assert self._began_s is not None
        return now_s - self._alarm_s > QUIET_S or now_s - self._began_s > LONGEST_S


def _all_went_on(scene: Scene) -> bool:
    """Every axis that had power reports it at the end: what was seen stopped nothing."""
    axes = scene.enabled_axes()
    return bool(axes) and all(
        trace.state_at(scene.ended_s) is DriveState.OPERATION_ENABLED
        and trace.status[-1][0] > scene.ended_s - REPORTS_S
        for trace in axes
    )


REPORTS_S: Final = 0.5
