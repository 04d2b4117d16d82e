"""Signs on the bus of somebody who does not belong there: a second master, or a second node with one id. Pure."""

from __future__ import annotations

import itertools
import math
from typing import Final

from canbase_config.robot import WATCHDOG_NODE_ID
from canbase_driver.cia301.nmt import TPDO
from canbase_driver.cia402 import DriveState
from canbase_recording.cause import Found
from canbase_recording.evidence_bus import LOST_PERIODS
from canbase_recording.frame_words import nmt_text
from canbase_recording.scene import Scene
from canbase_recording.trace import between, last_before, times_between

SIGNS: Final = 3
"""Once may be a frame that was late or lost."""
TWINS: Final = 2
"""So many answers too many, while none is missing: the watchdog trips soon after."""
_STOPPING: Final = (0x01, 0x02, 0x80, 0x81, 0x82)
_MOTION: Final = (0x6040, 0x6060, 0x60FF, 0x6840, 0x6860, 0x68FF)


def second_master(scene: Scene) -> Found | None:
    """Frames that canbase's one driver cannot have sent, before the watchdog tripped."""
    if not scene.is_canbase:
        return None
    signs = (_foreign_nmt(scene), _two_setpoints(scene), _extra_syncs(scene), _foreign_write(scene))
    return min((sign for sign in signs if sign is not None), key=lambda sign: sign.at_s, default=None)


def nmt_command(scene: Scene) -> Found | None:
    """An NMT command that takes a drive with power out of operational, in a network of another master."""
    return None if scene.is_canbase else _foreign_nmt(scene)


def _foreign_nmt(scene: Scene) -> Found | None:
    for at_s, (command, node_id, sent) in scene.nmt:
        before = scene.reaction_s - 0.5 <= at_s <= min(scene.reaction_s, _ladder_begins_s(scene))
        if before and not sent and command in _STOPPING and _has_power(scene, node_id, at_s):
            text = nmt_text(bytes((command, node_id)))
            return Found(at_s, f"somebody sent {text}, while a drive had power", node_id)
    return None


def _ladder_begins_s(scene: Scene) -> float:
    """From when on an NMT command may be the watchdog's: it reports its trip a little after its first frames. For
    another master's command it trips afterwards."""
    causes = (state.cause for at_s, state in scene.watchdog if at_s == scene.tripped_s)
    return scene.tripped_s - (0.0 if next(causes, 0) == FOREIGN_MASTER else LADDER_S)


FOREIGN_MASTER: Final = 8
LADDER_S: Final = 0.02


def _has_power(scene: Scene, node_id: int, at_s: float) -> bool:
    """Whether a node, 0: any, reported operation enabled at this time, and not only some cycles ago."""
    since_s = at_s - LOST_PERIODS * scene.period_s
    return any(
        trace.state_at(at_s) is DriveState.OPERATION_ENABLED and bool(between(trace.status, since_s, at_s))
        for trace in scene.axes.values()
        if node_id in (0, trace.node_id)
    )


def _two_setpoints(scene: Scene) -> Found | None:
    """Different targets for one axis between two SYNCs."""
    if len(scene.syncs) < SIGNS:
        return None
    for trace in scene.enabled_axes():
        signs = []
        for (a_s, a), (b_s, b) in itertools.pairwise(trace.target):
            if a != b and last_before(scene.syncs, a_s) == last_before(scene.syncs, b_s) and b_s <= scene.reaction_s:
                signs.append((a_s, a, b))
        recent = [sign for sign in signs if sign[0] >= scene.reaction_s - 1.0]
        if len(recent) >= SIGNS:
            at_s, a, b = recent[0]
            unit = " m/s" if trace.has_units else ""
            text = f"{trace.name} gets two setpoints in one cycle, {trace.speed(a):.2f} and {trace.speed(b):.2f}{unit}"
            return Found(at_s, f"{text}, {len(recent)} times: two masters order it", trace.node_id)
    return None


def _extra_syncs(scene: Scene) -> Found | None:
    """SYNCs that the one driver cannot have sent: strangers, too many, or one soon after another without setpoints."""
    window = times_between(scene.syncs, scene.reaction_s - SYNC_WINDOW_S, scene.reaction_s)
    strangers = times_between(scene.foreign_syncs, scene.reaction_s - SYNC_WINDOW_S, scene.reaction_s)
    if scene.own_syncs and len(strangers) >= SIGNS:
        text = f"SYNC comes {len(strangers)} times that this driver did not send"
        return Found(strangers[0], f"{text}: another master sends it")
    early = [b for a, b in itertools.pairwise(window) if b - a < EARLY * scene.period_s]
    targets = sorted(at for trace in scene.axes.values() for at, _ in trace.target)
    bare = [
        b for a, b in itertools.pairwise(window)
        if b - a < BARE * scene.period_s and targets and not times_between(targets, a, b)
    ]  # fmt: skip
    half = times_between(window, scene.reaction_s - MANY_S, scene.reaction_s)
    if len(bare) >= SIGNS or (early and len(half) > MANY * MANY_S / scene.period_s):
        signs = bare or early
        return Found(signs[0], f"SYNC comes {len(signs)} times too early: two masters send it")
    return None


SYNC_WINDOW_S: Final = 1.0
EARLY, BARE = 0.95, 0.75
"""Shares of the period: with setpoints before it, and without."""
MANY, MANY_S = 1.5, 0.15


def _foreign_write(scene: Scene) -> Found | None:
    for at_s, (node_id, index) in scene.writes:
        before = scene.reaction_s - 0.5 <= at_s < min(scene.reaction_s, scene.tripped_s)
        if before and index in _MOTION and _has_power(scene, node_id, at_s):
            return Found(at_s, f"somebody wrote {index:04X}h of {scene.who(node_id)} by SDO in motion", node_id)
    return None


def twin_node(scene: Scene) -> Found | None:
    """A PDO of a node that answers each SYNC comes twice for one."""
    for cob_id, times in scene.pdo_times.items():
        if cob_id & 0x780 not in TPDO or cob_id & 0x7F == WATCHDOG_NODE_ID:
            continue
        twice = _twice(scene.syncs, times, scene.reaction_s)
        syncs = times_between(scene.syncs, twice[0] - 0.001, scene.reaction_s) if twice else ()
        came = times_between(times, twice[0] - scene.period_s, scene.reaction_s) if twice else ()
        if len(twice) >= TWINS and len(came) > 1.4 * len(syncs):
            node_id = cob_id & 0x7F
            text = f"{scene.who(node_id)} answers one SYNC twice, {len(twice)} times: two nodes have this id"
            return Found(twice[0], text, node_id)
    return None


def _twice(syncs: list[float], times: list[float], until_s: float) -> list[float]:
    """Times of PDOs that follow another one of the same SYNC, in the half second before."""
    window = [at for at in times if until_s - 0.5 <= at <= until_s]
    return [b for a, b in itertools.pairwise(window) if last_before(syncs, a) == last_before(syncs, b) > -math.inf]
