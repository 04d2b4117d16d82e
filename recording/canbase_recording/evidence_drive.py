"""Signs that a drive stopped by itself, or lost its setpoints: faults, emergencies, power-off, RPDOs. Pure."""

from __future__ import annotations

from typing import Final

from canbase_driver.cia301.emcy import emcy_text
from canbase_driver.cia301.nmt import RPDO
from canbase_driver.cia402 import Command, DriveState, decode_statusword
from canbase_recording.cause import Found
from canbase_recording.evidence_bus import LOST_PERIODS, emergencies_before
from canbase_recording.frame_words import CONTROLWORDS, controlword_command
from canbase_recording.scene import Scene
from canbase_recording.trace import AxisTrace, between, last_before, times_between

SLACK_S: Final = 0.03
"""A statusword shows a change this much later than the EMCY or the reaction to it."""
BEFORE_S: Final = 1.0
_FAULTS: Final = (DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT)


def drive_fault(scene: Scene) -> Found | None:
    """A drive enters fault, or one that had power reports an error by EMCY."""
    signs = [sign for trace in scene.axes.values() if (sign := _enters_fault(scene, trace)) is not None]
    powered = {trace.node_id for trace in scene.enabled_axes()}
    for at_s, (node_id, code) in emergencies_before(scene):
        if node_id not in powered:
            continue
        signs.append(Found(at_s, f"{scene.who(node_id)} reports {code:04X}h {emcy_text(code)}", node_id))
    if not signs:
        return None
    first = min(signs, key=lambda sign: sign.at_s)
    more = [sign.text for sign in signs if sign is not first and sign.node_id == first.node_id]
    return Found(first.at_s, "; ".join((first.text, *more[:2])), first.node_id)


def _enters_fault(scene: Scene, trace: AxisTrace) -> Found | None:
    before = trace.state_at(scene.reaction_s - BEFORE_S)
    for at_s, word in between(trace.status, scene.reaction_s - BEFORE_S, scene.reaction_s + SLACK_S):
        state = decode_statusword(word)
        if state in _FAULTS and before not in _FAULTS:
            return Found(at_s, f"{trace.name} goes to {state.text} (statusword {word:04X}h)", trace.node_id)
        before = state
    return None


def drive_disabled(scene: Scene) -> Found | None:
    """A drive leaves operation enabled though its controlword orders it."""
    for trace in scene.axes.values():
        before = trace.state_at(scene.reaction_s - BEFORE_S)
        for at_s, word in between(trace.status, scene.reaction_s - BEFORE_S, scene.reaction_s + SLACK_S):
            state = decode_statusword(word)
            left = before is DriveState.OPERATION_ENABLED and state not in (*_FAULTS, before)
            if left and _ordered_on(scene, trace, at_s):
                shown = state.text if state else "an unknown state"
                text = f"{trace.name} goes from operation enabled to {shown} (statusword {word:04X}h)"
                return Found(at_s, f"{text}, while its controlword orders enable operation", trace.node_id)
            before = state
    return None


def _ordered_on(scene: Scene, trace: AxisTrace, at_s: float) -> bool:
    """The controlword that was in force orders power; nobody took it away by another way either."""
    if trace.command_at(at_s - scene.period_s) is not Command.ENABLE_OPERATION:
        return False
    return trace.command_at(at_s) is Command.ENABLE_OPERATION and scene.tripped_s > at_s


def ordered_off(scene: Scene) -> Found | None:
    """The master takes power away in motion, and the recording shows no reason before it."""
    for trace in scene.enabled_axes():
        before = trace.command_at(scene.reaction_s - BEFORE_S)
        for at_s, word in between(trace.control, scene.reaction_s - BEFORE_S, scene.reaction_s + SLACK_S):
            command = controlword_command(word)
            moves = trace.moves_at(at_s)
            if before is Command.ENABLE_OPERATION and command not in (before, None) and moves:
                text = f"{trace.name} is ordered: {CONTROLWORDS[command]} in motion"
                return Found(at_s, f"{text}; what made the master do so is not in this recording", trace.node_id)
            before = command
    return None


def setpoints_missing(scene: Scene) -> Found | None:
    """An axis gets no setpoint for the SYNCs, or for every second one only."""
    for cob_id, times in scene.pdo_times.items():
        layout = scene.pdo_layouts.get(cob_id)
        if cob_id & 0x780 not in RPDO[:2] or layout is None or layout.node_id not in scene.drive_nodes:
            continue
        last_s = last_before(times, scene.reaction_s)
        regular = len(times_between(times, last_s - 10.0 * scene.period_s, last_s)) >= 8
        if regular and len(times_between(scene.syncs, last_s, scene.reaction_s)) > LOST_PERIODS:
            text = f"{layout.name} with the setpoint of {scene.who(layout.node_id)} is not sent after {last_s:.3f} s"
            return Found(last_s, f"{text}, though SYNC goes on", layout.node_id)
    return None
