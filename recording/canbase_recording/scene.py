"""The seconds around a stop, sorted by what they are about: what the rules of a first cause look at. Pure."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from canbase_config.object_map import (
    CONTROLWORD,
    CURRENT_ACTUAL,
    POSITION_ACTUAL,
    STATUSWORD,
    TARGET_VELOCITY,
    TORQUE_ACTUAL,
    VELOCITY_ACTUAL,
)
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID, Robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import EMCY, HEARTBEAT, NMT, SDO_TO_CLIENT, SDO_TO_SERVER, TPDO
from canbase_driver.supervision.watchdog_link import STATE_COB_ID, TRIPPED, WatchdogState, parse_state
from canbase_recording.entry import Entry, FrameKind, RecordedFrame
from canbase_recording.event import Event
from canbase_recording.frame_words import SYNC
from canbase_recording.notes import CommandNote, DriverNote, FilterNote, MuxNote, TitleNote, parse_note
from canbase_recording.pdo_layouts import PdoLayout, PdoLayouts
from canbase_recording.sdo_words import sdo_request
from canbase_recording.trace import AxisTrace, Line, last_before, units_of

_LINES: Final = {
    STATUSWORD: "status", CONTROLWORD: "control", TARGET_VELOCITY: "target", VELOCITY_ACTUAL: "velocity",
    POSITION_ACTUAL: "position", TORQUE_ACTUAL: "torque", CURRENT_ACTUAL: "torque",
}  # fmt: skip
SILENT_PERIODS: Final = 10.0
"""A statusword that has not come for so many cycles is no longer known."""
PERIOD_SAMPLES: Final = 100
DEFAULT_PERIOD_S: Final = 0.01
"""Of SYNC, where the recording shows none."""


@dataclass
class Scene:
    """`reaction_s`: when the first part reacted; what lies after it may be its consequence."""

    reaction_s: float
    ended_s: float
    robot: Robot | None
    events: list[Event]
    began_s: float = math.inf
    axes: dict[tuple[int, int], AxisTrace] = field(default_factory=dict)
    frames: list[RecordedFrame] = field(default_factory=list)
    """Those around the reaction, to be shown: MOST_SHOWN at most."""
    frame_times: list[float] = field(default_factory=list)
    syncs: list[float] = field(default_factory=list)
    own_syncs: int = 0
    """Of these, how many the recorder sent: all, where it is the one master."""
    foreign_syncs: list[float] = field(default_factory=list)
    pdo_times: dict[int, list[float]] = field(default_factory=dict)
    """By COB-ID: the PDOs that came."""
    pdo_layouts: dict[int, PdoLayout] = field(default_factory=dict)
    node_times: dict[int, list[float]] = field(default_factory=dict)
    """Every frame that only this node sends."""
    heartbeats: dict[int, Line[int]] = field(default_factory=dict)
    emergencies: Line[tuple[int, int]] = field(default_factory=list)
    """Node and code."""
    nmt: Line[tuple[int, int, bool]] = field(default_factory=list)
    """Command, node, sent by the recorder."""
    writes: Line[tuple[int, int]] = field(default_factory=list)
    """SDO writes: node and index."""
    error_frames: list[float] = field(default_factory=list)
    watchdog: Line[WatchdogState] = field(default_factory=list)
    commands: list[CommandNote] = field(default_factory=list)
    filters: list[FilterNote] = field(default_factory=list)
    muxes: list[MuxNote] = field(default_factory=list)
    drivers: list[DriverNote] = field(default_factory=list)
    titles: list[TitleNote] = field(default_factory=list)
    sent_any: bool = False
    """Some frames are marked as sent: it is a black box of canbase's driver, or was recorded by a master."""

    @functools.cached_property
    def period_s(self) -> float:
        """Of SYNC [s], from the begin of the scene: later somebody else may send it too."""
        times = [at_s for at_s in self.syncs if at_s <= self.reaction_s][:PERIOD_SAMPLES]
        gaps = sorted(b - a for a, b in itertools.pairwise(times))
        return gaps[len(gaps) // 2] if gaps else DEFAULT_PERIOD_S

    def slim(self) -> None:
        """Keeps what is shown: the story is told, and a long recording has many scenes."""
        _ = self.period_s
        for times in (self.frame_times, self.syncs, self.error_frames):
            times.clear()
        self.pdo_times.clear()
        self.node_times.clear()
        for trace in self.axes.values():
            trace.slim(SILENT_PERIODS * self.period_s, self.ended_s)

    @property
    def is_canbase(self) -> bool:
        """Canbase's watchdog or driver is on this bus."""
        return bool(self.watchdog or self.drivers or DRIVER_NODE_ID in self.heartbeats)

    @property
    def tripped_s(self) -> float:
        """When the watchdog tripped, the trip that holds at the reaction or the next one; infinity: it did not."""
        tripped_s = math.inf
        for at_s, state in self.watchdog:
            if state.state == TRIPPED:
                tripped_s = min(tripped_s, at_s)
            elif at_s <= self.reaction_s:
                tripped_s = math.inf
        return tripped_s

    @property
    def drive_nodes(self) -> list[int]:
        """Nodes with a CiA 402 axis that reports."""
        return sorted({trace.node_id for trace in self.axes.values() if trace.status})

    def enabled_axes(self) -> list[AxisTrace]:
        """Those that had power in the second before the reaction."""
        return [
            trace for trace in self.axes.values() if trace.was_enabled(self.reaction_s - ENABLED_S, self.reaction_s)
        ]

    def silence_s(self, times: list[float]) -> float:
        """How long something had not come at the reaction; infinity: never."""
        return self.reaction_s - last_before(times, self.reaction_s)

    def who(self, node_id: int, axis: int | None = None) -> str:
        """A node for people, with its joints."""
        names = [
            trace.name for (node, of), trace in sorted(self.axes.items()) if node == node_id and axis in (None, of)
        ]
        joints = [name for name in names if not name.startswith("node ")]
        return f"node {node_id}" + (f" ({', '.join(joints)})" if joints else f" axis {axis}" if axis else "")


ENABLED_S: Final = 1.0
SHOWN_BEFORE_S, SHOWN_AFTER_S, MOST_SHOWN = 1.0, 1.0, 4_000


class SceneMaker:
    """Sorts entries into a scene."""

    def __init__(self, layouts: PdoLayouts, robot: Robot | None) -> None:
        self._layouts, self._robot = layouts, robot
        self._units = units_of(robot)

    def make(self, entries: Iterable[Entry], events: list[Event], reaction_s: float, ended_s: float) -> Scene:
        """All entries of the time around a stop."""
        scene = Scene(reaction_s, ended_s, self._robot, events)
        for entry in entries:
            scene.began_s = min(scene.began_s, entry.at_s)
            if isinstance(entry, RecordedFrame):
                self._frame(scene, entry)
            else:
                _note(scene, parse_note(entry))
        return scene

    def _frame(self, scene: Scene, frame: RecordedFrame) -> None:
        at_s, cob_id, data, sent, kind = frame
        _count(scene, frame)
        if kind is not FrameKind.DATA:
            return
        if cob_id == SYNC:
            _sync(scene, at_s, sent=sent)
        elif cob_id == NMT and len(data) == 2:
            scene.nmt.append((at_s, (data[0], data[1], sent)))
        elif cob_id == STATE_COB_ID and (state := parse_state(Frame(cob_id, data))):
            scene.watchdog.append((at_s, state))
            scene.node_times.setdefault(WATCHDOG_NODE_ID, []).append(at_s)
        elif cob_id & 0x7F:
            self._of_node(scene, at_s, cob_id, data)

    def _of_node(self, scene: Scene, at_s: float, cob_id: int, data: bytes) -> None:
        node_id, function = cob_id & 0x7F, cob_id & 0x780
        if function == SDO_TO_SERVER:
            request = sdo_request(data)
            if request is not None and request.is_write:
                scene.writes.append((at_s, (node_id, request.at.index)))
            return
        if function in (HEARTBEAT, EMCY, SDO_TO_CLIENT) or function in TPDO:
            scene.node_times.setdefault(node_id, []).append(at_s)
        if function == HEARTBEAT and len(data) == 1:
            scene.heartbeats.setdefault(node_id, []).append((at_s, data[0]))
        elif function == EMCY and len(data) >= 2:
            scene.emergencies.append((at_s, (node_id, int.from_bytes(data[:2], "little"))))
        elif function not in (HEARTBEAT, EMCY, SDO_TO_CLIENT):
            self._pdo(scene, at_s, cob_id, data)

    def _pdo(self, scene: Scene, at_s: float, cob_id: int, data: bytes) -> None:
        scene.pdo_times.setdefault(cob_id, []).append(at_s)
        layout = self._layouts.of(cob_id, len(data))
        if layout is None or not layout.fits(len(data)):
            return
        scene.pdo_layouts[cob_id] = layout
        for mapped in layout.mapped:
            line = _LINES.get(mapped.base)
            if line is not None and not (mapped.base == CONTROLWORD and layout.name == "RPDO4" and scene.is_canbase):
                getattr(self._trace(scene, layout.node_id, mapped.axis), line).append((at_s, mapped.value(data)))

    def _trace(self, scene: Scene, node_id: int, axis: int) -> AxisTrace:
        key = (node_id, axis)
        trace = scene.axes.get(key)
        if trace is None:
            name, units = self._units.get(key, (f"node {node_id}" + (f" axis {axis}" if axis else ""), None))
            trace = scene.axes[key] = AxisTrace(node_id, axis, name, units)
        return trace


def _sync(scene: Scene, at_s: float, *, sent: bool) -> None:
    scene.syncs.append(at_s)
    if sent:
        scene.own_syncs += 1
    else:
        scene.foreign_syncs.append(at_s)


def _count(scene: Scene, frame: RecordedFrame) -> None:
    at_s = frame.at_s
    scene.frame_times.append(at_s)
    scene.sent_any = scene.sent_any or frame.sent
    if frame.kind is FrameKind.ERROR:
        scene.error_frames.append(at_s)
    if -SHOWN_BEFORE_S <= at_s - scene.reaction_s <= SHOWN_AFTER_S and len(scene.frames) < MOST_SHOWN:
        scene.frames.append(frame)


def _note(scene: Scene, note: object) -> None:
    if isinstance(note, CommandNote):
        scene.commands.append(note)
    elif isinstance(note, FilterNote):
        scene.filters.append(note)
    elif isinstance(note, MuxNote):
        scene.muxes.append(note)
    elif isinstance(note, DriverNote):
        scene.drivers.append(note)
    elif isinstance(note, TitleNote):
        scene.titles.append(note)
