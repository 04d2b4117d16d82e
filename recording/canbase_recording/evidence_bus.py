"""Signs on the bus that somebody is silent, has restarted, or receives nothing. Pure."""

from __future__ import annotations

import bisect
import itertools
import math
from typing import Final

from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID
from canbase_driver.cia301.nmt import TPDO
from canbase_driver.supervision.watchdog_link import WATCHING
from canbase_recording.beat import Beat
from canbase_recording.cause import Found
from canbase_recording.frame_words import QUICK_STOP_COB_ID
from canbase_recording.scene import Scene
from canbase_recording.trace import Line, around_times, first_after, last_before, times_between, value_at

LOST_PERIODS: Final = 4.0
"""So many periods without it are no lost frame."""
LEAST_SILENCE_S: Final = 0.03
TOGETHER_S: Final = 0.05
"""Nodes that fall silent within this time do so together."""
LOOKS_AHEAD_S: Final = 1.0
"""What comes so much later tells whether a node lives [s]."""
PAUSE_S: Final = 0.12
ENDED_S: Final = {DRIVER_NODE_ID: 0.1, WATCHDOG_NODE_ID: 0.25}
"""A part whose SYNC or state frame has not come for so long, while its stop process acts, does not run any more."""
SIGNS: Final = 3
_RESETS: Final = (0x81, 0x82)
_RECEIVES_NOTHING: Final = (0x8130, 0x8250, 0x8120, 0x8140)
"""EMCY: heartbeat or life guarding lost, RPDO timeout, error passive, recovered from bus-off."""


def pause(scene: Scene) -> tuple[float, float] | None:
    """Since when nothing at all was recorded, neither sent nor received, and for how long [s]; None: it went on."""
    times = around_times(scene.frame_times, scene.reaction_s - 2.0, scene.reaction_s + 0.5)
    gaps = [(b - a, a) for a, b in itertools.pairwise(times)]
    if not gaps:
        return None
    longest_s, since_s = max(gaps)
    usual_s = sorted(gap for gap, _ in gaps)[len(gaps) // 2]
    return None if longest_s < max(PAUSE_S, 20.0 * usual_s) or since_s > scene.reaction_s else (since_s, longest_s)


def recorder_paused(scene: Scene) -> Found | None:
    """Nothing was recorded for a while."""
    paused = pause(scene)
    if paused is None:
        return None
    since_s, longest_s = paused
    who = "the driver stood still" if scene.sent_any else "the recorder stood still, or its bus was cut"
    return Found(since_s, f"no frame was sent or received for {longest_s:.3f} s: {who}")


def node_restarted(scene: Scene) -> Found | None:
    """A drive sends its boot-up though nobody has reset it."""
    for node_id in scene.drive_nodes:
        before_s = -math.inf
        for at_s, state in scene.heartbeats.get(node_id, ()):
            if state != 0:
                continue
            resets = (at for at, (command, to, _) in scene.nmt if command in _RESETS and to in (0, node_id))
            reset, before_s = any(before_s < at <= at_s for at in resets), at_s
            if at_s < scene.reaction_s - 1.0:
                continue
            since_s = last_before(scene.node_times[node_id], min(at_s - 1e-6, scene.reaction_s))
            away = since_s if since_s < at_s - LEAST_SILENCE_S else at_s
            if not reset and away <= scene.reaction_s:
                gone = f" after {at_s - away:.2f} s of silence" if away < at_s else ""
                return Found(
                    away, f"{scene.who(node_id)} sends a boot-up at {at_s:.3f} s{gone}: it has restarted", node_id
                )
    return None


def driver_silent(scene: Scene) -> Found | None:
    """SYNC ends, and the heartbeat of the master, while others go on; or it was killed, and its stop process acts."""
    return _killed(scene, scene.syncs, "canbase's driver sends no SYNC", DRIVER_NODE_ID) or _driver_missing(scene)


def _killed(scene: Scene, own: list[float], what: str, node_id: int) -> Found | None:
    """Quick stops on the PDO of a watchdog that watches, and nothing of a part's `own` frames from then on: its stop
    process sends them, which outlives it (docs/safety.md)."""
    stops = [at for node in scene.drive_nodes for at in scene.pdo_times.get(QUICK_STOP_COB_ID + node, ())]
    at_s = first_after(sorted(stops), scene.reaction_s - TOGETHER_S)
    watched, last_s = value_at(scene.watchdog, at_s), last_before(own, at_s)
    acts = at_s <= scene.reaction_s + TOGETHER_S and watched is not None and watched.state == WATCHING
    ended_s = ENDED_S[node_id]
    alive = bool(times_between(own, at_s, at_s + ended_s)) or scene.ended_s < at_s + ended_s
    if not acts or alive or last_s < at_s - ended_s:
        return None
    text = f"{what} after {last_s:.3f} s, and its stop process acts: it was killed, or it crashed"
    return Found(last_s, text, node_id, f"the {'driver' if node_id == DRIVER_NODE_ID else 'watchdog'}'s stop process")


def _driver_missing(scene: Scene) -> Found | None:
    period_s, syncs = scene.period_s, scene.syncs
    if len(syncs) < SIGNS or scene.silence_s(syncs) < max(LEAST_SILENCE_S, LOST_PERIODS * period_s):
        return None
    since_s = last_before(syncs, scene.reaction_s)
    others = [at for node, times in scene.node_times.items() if node != DRIVER_NODE_ID for at in times]
    if not any(since_s + period_s < at <= scene.reaction_s + LOOKS_AHEAD_S for at in others):
        return None
    beats = [at for at, _ in scene.heartbeats.get(DRIVER_NODE_ID, ())]
    lives = first_after(beats, since_s + period_s) <= scene.reaction_s
    if lives:
        return Found(
            since_s, f"SYNC ends at {since_s:.3f} s, though the heartbeat of the driver goes on", DRIVER_NODE_ID
        )
    whose = "and the driver's heartbeat end" if beats else "ends"
    back = first_after(syncs, scene.reaction_s)
    later = f"; it is back after {back - since_s:.2f} s: the driver hung" if back < math.inf else ""
    return Found(since_s, f"SYNC {whose} at {since_s:.3f} s, other nodes go on{later}", DRIVER_NODE_ID)


def watchdog_silent(scene: Scene) -> Found | None:
    """The watchdog's state frame and heartbeat end, while SYNC goes on; or it was killed, and its stop process acts."""
    own = scene.node_times.get(WATCHDOG_NODE_ID, [])
    return _killed(scene, own, "canbase's watchdog sends nothing", WATCHDOG_NODE_ID) or _watchdog_missing(scene)


def _watchdog_missing(scene: Scene) -> Found | None:
    beat = _beat([at for at, _ in scene.watchdog], scene.reaction_s)
    if not beat.is_missing(scene.reaction_s) or scene.silence_s(scene.syncs) > LOST_PERIODS * scene.period_s:
        return None
    heart = [at for at, _ in scene.heartbeats.get(WATCHDOG_NODE_ID, ())]
    if times_between(heart, beat.last_s + LEAST_SILENCE_S, scene.reaction_s):
        return None
    return Found(beat.last_s, f"no frame of canbase's watchdog since {beat.last_s:.3f} s", WATCHDOG_NODE_ID)


def watchdog_ended(scene: Scene) -> Found | None:
    """The watchdog trips because somebody ended it."""
    at_s = scene.tripped_s
    if at_s > scene.reaction_s + LEAST_SILENCE_S or not any(s.cause == ENDED for at, s in scene.watchdog if at == at_s):
        return None
    return Found(
        at_s, "the watchdog was asked to end while a wheel turned; it stopped the drives first", WATCHDOG_NODE_ID
    )


ENDED: Final = 11


def drives_deaf(scene: Scene) -> Found | None:
    """Drives report that the computer's frames do not reach them, while the recording has these frames."""
    since_s = scene.silence_s(scene.syncs)
    codes = {
        node: (at, code)
        for at, (node, code) in reversed(scene.emergencies)
        if code in _RECEIVES_NOTHING and scene.reaction_s - 1.0 <= at <= scene.reaction_s + LOOKS_AHEAD_S
    }
    if not codes or since_s > max(LEAST_SILENCE_S, LOST_PERIODS * scene.period_s) or not scene.syncs:
        return None
    quiet = [at for node in codes if (at := _no_answer_since(scene, node)) is not None]
    at_s = min(quiet, default=math.inf)
    if at_s > scene.reaction_s:
        return None
    whom = " and ".join(scene.who(node) for node in sorted(codes))
    code = next(iter(codes.values()))[1]
    text = f"{whom} report {code:04X}h and answer no SYNC since {at_s:.3f} s, though SYNC and heartbeats are sent"
    return Found(at_s, text, next(iter(codes)) if len(codes) == 1 else 0)


def bus_cut(scene: Scene) -> Found | None:
    """All drives, two at least, fall silent together."""
    silent = _silent_nodes(scene)
    if len(silent) < 2 or len(silent) < len(scene.drive_nodes):
        return None
    times = [at for at, _ in silent]
    if max(times) - min(times) > TOGETHER_S:
        return None
    return Found(
        min(times), f"no drive sends anything after {max(times):.3f} s: all {len(silent)} fall silent together"
    )


def node_silent(scene: Scene) -> Found | None:
    """One node sends nothing any more, while SYNC and others go on."""
    silent = _silent_nodes(scene)
    if not silent:
        return None
    at_s, node_id = min(silent)
    back = first_after(scene.node_times[node_id], scene.reaction_s)
    later = f"; it is back after {back - at_s:.2f} s" if back < math.inf else ""
    others = sorted(set(scene.drive_nodes) - {node for _, node in silent})
    more = f", {', '.join(scene.who(each) for each in others)} goes on" if others else ""
    return Found(at_s, f"{scene.who(node_id)} sends nothing after {at_s:.3f} s{more}{later}", node_id)


def _silent_nodes(scene: Scene) -> list[tuple[float, int]]:
    """Time of the last frame and id of nodes that were there, and send nothing at the reaction nor soon after."""
    found = []
    for node_id, times in scene.node_times.items():
        if node_id in (DRIVER_NODE_ID, WATCHDOG_NODE_ID):
            continue
        since_s = _no_answer_since(scene, node_id)
        beat = _beat([at for at, _ in scene.heartbeats.get(node_id, ())], scene.reaction_s)
        if since_s is None and beat.is_missing(scene.reaction_s):
            since_s = last_before(times, scene.reaction_s)
        if since_s is None or scene.reaction_s - since_s < LEAST_SILENCE_S:
            continue
        last_s = last_before(times, scene.reaction_s)
        soon = min(beat.limit_s(), LOOKS_AHEAD_S)
        if last_s <= since_s + scene.period_s and not times_between(times, last_s, last_s + soon):
            found.append((last_s, node_id))
    return found


def _no_answer_since(scene: Scene, node_id: int) -> float | None:
    """When a node that answered each SYNC last did, if it does not any more while SYNC goes on; None: it does."""
    own = [came for cob_id, came in scene.pdo_times.items() if cob_id & 0x7F == node_id and cob_id & 0x780 in TPDO]
    times = sorted(itertools.chain.from_iterable(own))
    last_s = last_before(times, scene.reaction_s)
    if last_s < scene.reaction_s - 2.0:
        return None
    was_regular = len(times_between(times, last_s - 10.0 * scene.period_s, last_s)) >= 8
    unanswered = len(times_between(scene.syncs, last_s, scene.reaction_s))
    return last_s if was_regular and unanswered >= LOST_PERIODS else None


def feedback_lost(scene: Scene) -> Found | None:
    """A TPDO of a node that lives does not come any more, while SYNC goes on."""
    for cob_id, times in scene.pdo_times.items():
        node_id, last_s = cob_id & 0x7F, last_before(times, scene.reaction_s)
        if cob_id & 0x780 not in TPDO or node_id == WATCHDOG_NODE_ID or last_s < scene.reaction_s - 2.0:
            continue
        regular = len(times_between(times, last_s - 10.0 * scene.period_s, last_s)) >= 8
        if not regular or len(times_between(scene.syncs, last_s, scene.reaction_s)) < LOST_PERIODS:
            continue
        lives = last_before(scene.node_times[node_id], scene.ended_s) > last_s + scene.period_s
        more = "the node sends other frames" if lives else "nothing else of the node came"
        layout = scene.pdo_layouts.get(cob_id)
        name = layout.name if layout else f"{cob_id:03X}h"
        return Found(last_s, f"{name} of {scene.who(node_id)} does not come after {last_s:.3f} s; {more}", node_id)
    return None


def bus_errors(scene: Scene) -> Found | None:
    """The CAN controller reports errors."""
    errors = times_between(scene.error_frames, scene.reaction_s - 1.0, scene.reaction_s)
    if len(errors) < SIGNS:
        return None
    return Found(errors[0], f"{len(errors)} error frames of the CAN controller in the second before")


def _beat(times: list[float], until_s: float) -> Beat:
    beat = Beat()
    for at_s in times[: bisect.bisect_right(times, until_s)]:
        beat.on_beat(at_s)
    return beat


def emergencies_before(scene: Scene) -> Line[tuple[int, int]]:
    """EMCY with an error code in the second before the reaction."""
    return [
        (at, found) for at, found in scene.emergencies
        if found[1] >> 8 and scene.reaction_s - 1.0 <= at <= scene.reaction_s + LEAST_SILENCE_S
    ]  # fmt: skip
