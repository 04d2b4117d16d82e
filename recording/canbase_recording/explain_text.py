"""What `canbase explain` prints: each stop with its first cause, and the network. Pure: lines of text.

All text of the file (names, details, ids) is made printable: it may come from somebody else's recording.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from canbase_config.robot import DRIVER_NODE_ID, LSS_REQUEST, WATCHDOG_NODE_ID
from canbase_recording.event import Event
from canbase_recording.explanation import Explanation
from canbase_recording.frame_words import LSS_ANSWER, is_pdo, pdo_sources
from canbase_recording.node_seen import NodeSeen
from canbase_recording.recording_facts import RecordingFacts
from canbase_recording.standstill import WheelStop
from canbase_recording.story import Story
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable

MOST_CHAIN = 40
"""Lines of one stop; the page has all of them."""


def text_lines(facts: RecordingFacts, told: Explanation) -> Iterator[str]:
    """The whole answer, line by line."""
    for line in _lines(facts, told):
        yield printable(line, SENTENCE_LENGTH) if line else ""


def _lines(facts: RecordingFacts, told: Explanation) -> Iterator[str]:
    yield facts.sentence(told)
    for problem in facts.problems:
        yield f"  warning: {problem}"
    if facts.trip is not None and facts.trip.told is not None:
        yield from ("", facts.trip.sentence)
        for number, story in enumerate(facts.trip.told.stories, start=1):
            yield from _story(number, len(facts.trip.told.stories), story)
        yield from ("", f"What the driver recorded then, {facts.file}:")
    for number, story in enumerate(told.stories, start=1):
        yield ""
        yield from _story(number, len(told.stories), story)
    if told.further_stops:
        yield f"{told.further_stops} further stops are not told; cut the recording to see them"
    if not told.stories:
        yield ""
        yield f"No stop was found. {no_stop(told)}"
        yield from (f"  {line}" for line in ending(told))
    yield ""
    yield from _network(told)
    if facts.trip is not None:
        yield from ("", facts.trip.sentence) if facts.trip.told is None else ("",)
        yield from ("To see what the watchdog decided:", f"  canbase record replay {facts.trip.path}")


def no_stop(told: Explanation) -> str:
    """What it means that no stop was found."""
    network = told.network
    ours = (DRIVER_NODE_ID, WATCHDOG_NODE_ID) if network.watchdog is not None else ()
    others = [node for node in network.nodes.values() if node.node_id not in ours]
    unread = [node.node_id for node in others if not any(axis.state for axis in node.axes.values())]
    if len(unread) < len(others):
        none = "lost its power in motion, and no part of canbase stopped the base."
        if not unread:
            return f"No drive {none}"
        nodes = ", ".join(map(str, sorted(unread)))
        return f"No drive whose statusword (6041h) can be read {none} What node {nodes} did is not known."
    return "No part of canbase stopped the base. No statusword (6041h) can be read: what the drives did is not known."


def ending(told: Explanation) -> list[str]:
    """What is still going on when the recording ends."""
    moving = [
        told.decoder.who(node.node_id, number)
        for node in told.network.nodes.values()
        for number, axis in node.axes.items()
        if axis.is_enabled and axis.moves
    ]
    if not moving:
        return []
    return [f"The recording ends while {', '.join(moving)} moves with power: what came then is not in it."]


def _story(number: int, count: int, story: Story) -> Iterator[str]:
    yield f"{story.kind} {number} of {count}, at {story.scene.reaction_s:.3f} s"
    yield f"  first cause:  {story.cause.value}"
    yield f"                {story.found.text}"
    if story.caught_by:
        yield f"  caught by:    {story.caught}"
    yield f"  standstill:   {standstill_sentence(story)}"
    yield f"  look at:      {story.advice}"
    for cause, found in story.also:
        yield f"  also seen:    {cause.value}: {found.text}"
    yield "  what happened:"
    chain = collapsed(story.chain)
    for event, times in chain[:MOST_CHAIN]:
        again = f"  ({times} times)" if times > 1 else ""
        yield f"    {event.at_s:9.3f} s  {event.who}: {event.text}{again}"
    if len(chain) > MOST_CHAIN:
        yield f"    and {len(chain) - MOST_CHAIN} more: --html shows them"


def standstill_sentence(story: Story) -> str:
    """When and after what distance the wheels were stationary, from the first cause on."""
    if not story.standstill.wheels:
        return "unknown: the recording has no position (6064h)"
    if story.standstill.was_stationary:
        return "the base was stationary"
    return "; ".join(_wheel(wheel) for wheel in story.standstill.wheels)


def _wheel(wheel: WheelStop) -> str:
    if wheel.stood_s is None:
        return f"{wheel.name}: unknown, {wheel.why_not}"
    if wheel.distance is None:
        return f"{wheel.name} after {wheel.stood_s:.2f} s"
    distance = f"{wheel.distance:.3f} m" if wheel.unit == "m" else f"{wheel.distance:.0f} increments"
    return f"{wheel.name} after {wheel.stood_s:.2f} s and {distance}"


def collapsed(events: Iterable[Event]) -> list[tuple[Event, int]]:
    """Events of which the same one came again within a second are one, with their number."""
    found: list[tuple[Event, int]] = []
    last: dict[tuple[str, str], tuple[int, float]] = {}
    for event in events:
        key = (event.who, event.text)
        at, seen_s = last.get(key, (-1, -math.inf))
        if at >= 0 and event.at_s - seen_s <= 1.0:
            found[at] = (found[at][0], found[at][1] + 1)
        else:
            at = len(found)
            found.append((event, 1))
        last[key] = (at, event.at_s)
    return found


def _network(told: Explanation) -> Iterator[str]:
    network = told.network
    load = network.load
    yield (
        f"Network: {len(network.nodes)} nodes, {told.frames} frames, bus load {100 * load.mean:.0f} % on average, "
        f"{100 * load.highest:.0f} % at most (at {load.bitrate // 1000} kbit/s)"
    )
    for node in sorted(network.nodes.values(), key=lambda each: each.node_id):
        yield f"  {told.decoder.who(node.node_id)}: {', '.join(node_facts(told, node))}"
    if network.error_frames:
        yield f"  {network.error_frames} error frames of the CAN controller"
    for source, cob_ids in pdo_sources(told.layouts).items():
        yield f"  PDOs {_ids(cob_ids)}: {source.value}"
    yield from (f"  {line}" for line in gaps(told))


def gaps(told: Explanation) -> list[str]:
    """What robot.yaml has and the recording has not, and frames that nobody can decode."""
    drives = told.robot.drives if told.robot else ()
    sent = {node.node_id for node in told.network.nodes.values() if node.frames}
    lines = [
        f"{told.decoder.who(node_id)} of robot.yaml sends nothing in this recording"
        for node_id in sorted({drive.node_id for drive in drives} - sent)
    ]
    unknown = sorted(told.network.unknown_pdos)
    if pdos := [each for each in unknown if is_pdo(each[0])]:
        why = "they do not fit robot.yaml" if told.robot else "give --config robot.yaml, or record from the boot on"
        lines.append(f"PDOs {_lengths(pdos)}: contents not known; {why}")
    if others := [each for each in unknown if not is_pdo(each[0]) and each[0] not in (LSS_ANSWER, LSS_REQUEST)]:
        lines.append(f"frames {_lengths(others)}: no service of CiA 301")
    return lines


def _lengths(frames: Sequence[tuple[int, int]]) -> str:
    shown = ", ".join(f"{cob_id:03X}h ({length} bytes)" for cob_id, length in frames[:8])
    return shown + (f" and {len(frames) - 8} more" if len(frames) > 8 else "")


def node_facts(told: Explanation, node: NodeSeen) -> list[str]:
    """What is known of one node, a few words each."""
    facts = [node.nmt.text if node.nmt is not None else "NMT state not seen"]
    if node.ordered:
        facts[0] += f" before NMT {node.ordered}"
    facts += [
        f"{axis.state.text}{f' (axis {number})' if number else ''}" for number, axis in node.axes.items() if axis.state
    ]
    beat = node.heartbeat
    if not math.isnan(beat.period_s):
        facts.append(f"{'guarded' if node.guarded else 'heartbeat'} each {1000.0 * beat.period_s:.0f} ms")
        if beat.longest_s > beat.limit_s():
            facts.append(f"longest pause {beat.longest_s:.2f} s")
    elif node.axes:
        facts.append("no heartbeat")
    if beat.is_lost:
        facts.append(f"MISSING since {beat.last_s:.3f} s")
    if node.boot_ups:
        facts.append(f"{node.boot_ups} boot-ups")
    facts += [
        f"EMCY {told.decoder.emergency(node.node_id, code)}{f' ({count} times)' if count > 1 else ''}"
        for code, count in node.emergencies.items() if code >> 8
    ][:5]  # fmt: skip
    if node.aborts:
        facts.append(f"{node.aborts.total()} SDO aborts")
    return facts


def _ids(cob_ids: Sequence[int]) -> str:
    shown = ", ".join(f"{cob_id:03X}h" for cob_id in cob_ids[:12])
    return shown + (f" and {len(cob_ids) - 12} more" if len(cob_ids) > 12 else "")
