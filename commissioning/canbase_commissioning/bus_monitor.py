"""The nodes on the bus, from received frames alone: their states and heartbeats, signs of a master, load. CiA 301.

Nothing is sent in here, and nothing is remembered longer than the listening lasts.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter
from dataclasses import dataclass, field

from canbase_config.bus_load import frame_bits
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID
from canbase_driver.cia301.emcy import Emcy, parse_emcy
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import (
    EMCY,
    HEARTBEAT,
    MAX_NODE_ID,
    NMT,
    RPDO,
    SDO_TO_CLIENT,
    SDO_TO_SERVER,
    TPDO,
    NmtState,
    parse_heartbeat,
)
from canbase_driver.cia301.node_guarding import without_toggle
from canbase_driver.supervision.watchdog_link import (
    RESET_COB_ID,
    WatchdogCounters,
    WatchdogState,
    parse_counters,
    parse_state,
)

SYNC = 0x080
OURS = {DRIVER_NODE_ID: "canbase's motor driver", WATCHDOG_NODE_ID: "canbase's watchdog"}
SDO_QUIET_S = 0.05
"""An SDO channel without a request for this long is free [s]: a boot uses it more often, a measurement now and then."""


@dataclass(slots=True)
class HeardNode:
    """One node, as far as its frames show it."""

    node_id: int
    nmt_state: NmtState | None = None
    heartbeats_at: list[float] = field(default_factory=list)
    pdo_at: dict[int, float] = field(default_factory=dict)
    """Last time of each TPDO, by its COB-ID without node id."""
    sdo_answers: int = 0
    emcy: Emcy | None = None
    has_sent_emcy: bool = False

    @property
    def period_s(self) -> float:
        """Of its heartbeat, the median [s]; NaN: fewer than two were received."""
        gaps = [b - a for a, b in zip(self.heartbeats_at, self.heartbeats_at[1:], strict=False)]
        return statistics.median(gaps) if gaps else math.nan

    def heartbeat_age_s(self, now_s: float) -> float:
        """Seconds since the last one; NaN: none."""
        return now_s - self.heartbeats_at[-1] if self.heartbeats_at else math.nan

    def pdo_age_s(self, now_s: float) -> float:
        """Seconds since the last TPDO of any kind; NaN: none."""
        return now_s - max(self.pdo_at.values()) if self.pdo_at else math.nan

    @property
    def sends_nothing(self) -> bool:
        """It has shown no frame but answers to SDO requests."""
        return self.nmt_state is None and not self.pdo_at and not self.has_sent_emcy

    @property
    def state_text(self) -> str:
        """NMT state in words, from what shows it best."""
        if self.nmt_state is not None:
            return self.nmt_state.text
        if self.pdo_at:
            return "operational"
        return "answers" if self.sdo_answers else "unknown"


class Listener:
    """Takes every frame of other nodes, and derives what it shows."""

    def __init__(self, now_s: float) -> None:
        self.since = now_s
        self.nodes: dict[int, HeardNode] = {}
        self.frames = 0
        self.bits = 0
        self.watchdog: WatchdogState | None = None
        self.watchdog_at = math.nan
        self.counters: WatchdogCounters | None = None
        self._nmt: Counter[int] = Counter()
        self._setpoints: Counter[int] = Counter()
        self._sdo_requests: Counter[int] = Counter()
        self._sdo_asked_at: dict[int, float] = {}
        self._syncs = 0

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take one frame."""
        self.frames += 1
        self.bits += frame_bits(len(frame.data))
        if not self._on_watchdog(frame, now_s) and not self._on_master(frame, now_s):
            self._on_node(frame, now_s)

    def _on_watchdog(self, frame: Frame, now_s: float) -> bool:
        state, counters = parse_state(frame), parse_counters(frame)
        if state is not None:
            self.watchdog, self.watchdog_at = state, now_s
        if counters is not None:
            self.counters = counters
        return state is not None or counters is not None

    def _on_master(self, frame: Frame, now_s: float) -> bool:
        function, node_id = frame.cob_id & 0x780, frame.cob_id & 0x7F
        if frame.cob_id == SYNC:
            self._syncs += 1
        elif frame.cob_id == NMT:
            self._nmt[frame.data[1] if len(frame.data) == 2 else 0] += 1
        elif function in RPDO and frame.cob_id != RESET_COB_ID and node_id:
            self._setpoints[node_id] += 1
        elif function == SDO_TO_SERVER and node_id:
            self._sdo_requests[node_id] += 1
            self._sdo_asked_at[node_id] = now_s
        else:
            return False
        return True

    def _on_node(self, frame: Frame, now_s: float) -> None:
        function, node_id = frame.cob_id & 0x780, frame.cob_id & 0x7F
        parsed = parse_heartbeat(without_toggle(frame)) if function == HEARTBEAT else None
        if not 1 <= node_id <= MAX_NODE_ID or (function not in (*TPDO, EMCY, SDO_TO_CLIENT) and parsed is None):
            return
        node = self.nodes.setdefault(node_id, HeardNode(node_id))
        if parsed is not None:
            self._on_heartbeat(node, parsed[1], now_s)
        elif function in TPDO:
            node.pdo_at[function] = now_s
        elif function == SDO_TO_CLIENT:
            node.sdo_answers += 1
        else:
            emcy, node.has_sent_emcy = parse_emcy(frame), True
            node.emcy = None if emcy is None or emcy.is_reset else emcy

    def _on_heartbeat(self, node: HeardNode, state: NmtState | None, now_s: float) -> None:
        node.nmt_state = state
        if state is NmtState.INITIALISING:
            node.nmt_state = NmtState.PRE_OPERATIONAL
        else:
            node.heartbeats_at.append(now_s)

    def sdo_free(self, node_id: int, now_s: float) -> bool:
        """Whether no other master has used SDO with this node for a while."""
        return now_s - self._sdo_asked_at.get(node_id, -math.inf) > SDO_QUIET_S

    @property
    def driver_lives(self) -> bool:
        """Whether canbase's own driver is on this bus."""
        return DRIVER_NODE_ID in self.nodes

    def masters(self, now_s: float, *, requests: bool = True) -> list[str]:
        """A sentence for each sign that somebody else commands this bus.

        `requests`: NMT and SDO count too. A tool that sends such frames itself may get them back late (udp_multicast).
        """
        seconds = max(now_s - self.since, 1e-3)
        signs = [f"heartbeat of node {node_id}, {OURS[node_id]}" for node_id in sorted(OURS) if node_id in self.nodes]
        if self._syncs:
            signs.append(f"SYNC, {self._syncs / seconds:.0f} a second")
        if self._nmt and requests:
            whom = ", ".join(f"node {node_id}" if node_id else "all nodes" for node_id in sorted(self._nmt))
            signs.append(f"NMT commands to {whom}")
        if self._setpoints:
            signs.append(f"setpoints (RPDOs) to {_nodes(self._setpoints)}")
        if self._sdo_requests and requests:
            signs.append(f"SDO requests to {_nodes(self._sdo_requests)}")
        return signs

    def sync_hz(self, now_s: float) -> float:
        """SYNCs a second, of whomever."""
        return self._syncs / max(now_s - self.since, 1e-3)

    def load(self, bitrate: int, now_s: float) -> float:
        """Share of the bus's time that the frames took, at most; 0 to 1 and a little more where `bitrate` is wrong."""
        return self.bits / bitrate / max(now_s - self.since, 1e-3)


def _nodes(counter: Counter[int]) -> str:
    return "node " + ", ".join(map(str, sorted(counter)))


class ListenSession:
    """Listens for `duration_s` [s] and sends nothing."""

    def __init__(self, duration_s: float) -> None:
        self.heard = Listener(0.0)
        self.now_s = 0.0
        self._duration_s = duration_s
        self._started = False

    @property
    def done(self) -> bool:
        """Whether the time is over."""
        return self._started and self.now_s - self.heard.since >= self._duration_s

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame."""
        self._begin(now_s)
        self.heard.on_frame(frame, now_s)

    def tick(self, now_s: float) -> list[Frame]:
        """Sends nothing, ever."""
        self._begin(now_s)
        self.now_s = now_s
        return []

    def _begin(self, now_s: float) -> None:
        if not self._started:
            self._started, self.heard = True, Listener(now_s)
