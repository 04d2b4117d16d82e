"""What `canbase explain --json` prints: the stories and the network as plain values. Pure."""

from __future__ import annotations

import math
from typing import Any

from canbase_recording.event import Event
from canbase_recording.explain_text import gaps, node_facts
from canbase_recording.explanation import Explanation
from canbase_recording.frame_words import pdo_sources
from canbase_recording.recording_facts import OwnTrip, RecordingFacts
from canbase_recording.story import Story
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable


def as_json(facts: RecordingFacts, told: Explanation) -> dict[str, Any]:
    """Strings, numbers, lists and objects; what cannot be told is null."""
    found: dict[str, Any] = _clean(
        {
            "file": facts.file, "format": facts.format, "began": facts.began, "config": facts.config,
            "problems": list(facts.problems), "frames": told.frames, "notes": told.notes, "seconds": told.ended_s,
            "stops": [_story(story) for story in told.stories], "further_stops": told.further_stops,
            "watchdog": facts.trip and _own_trip(facts.trip),
            "network": _network(told), "events": [_event(event) for event in told.events],
        }
    )  # fmt: skip
    return found


def _own_trip(trip: OwnTrip) -> dict[str, Any]:
    stories = trip.told.stories if trip.told else ()
    return {"file": trip.path, "detail": trip.detail, "at_s": trip.at_s, "stops": [_story(story) for story in stories]}


def _story(story: Story) -> dict[str, Any]:
    return {
        "cause": story.cause.value, "at_s": story.found.at_s, "node": story.found.node_id, "text": story.found.text,
        "reaction_s": story.scene.reaction_s, "caught_by": story.caught_by, "reported": story.reported,
        "advice": story.advice, "standstill_s": story.standstill.stood_s, "distance_m": story.standstill.distance_m,
        "wheels": [
            {"name": w.name, "stood_s": w.stood_s, "distance": w.distance, "unit": w.unit, "why_not": w.why_not}
            for w in story.standstill.wheels
        ],
        "also": [{"cause": cause.value, "at_s": found.at_s, "text": found.text} for cause, found in story.also],
        "chain": [_event(event) for event in story.chain],
    }  # fmt: skip


def _event(event: Event) -> dict[str, Any]:
    return {
        "at_s": event.at_s, "kind": event.kind.value, "level": event.level.name.lower(), "who": event.who,
        "node": event.node_id, "text": event.text,
    }  # fmt: skip


def _network(told: Explanation) -> dict[str, Any]:
    network = told.network
    return {
        "bus_load_mean": network.load.mean, "bus_load_highest": network.load.highest, "bitrate": network.load.bitrate,
        "gaps": gaps(told), "error_frames": network.error_frames, "frames": dict(network.kinds),
        "pdo_sources": {
            source.value: [f"{each:03X}" for each in cob_ids] for source, cob_ids in pdo_sources(told.layouts).items()
        },
        "nodes": {
            str(node.node_id): {
                "name": told.decoder.who(node.node_id), "facts": node_facts(told, node), "frames": node.frames,
                "heartbeat_s": node.heartbeat.period_s, "heartbeat_lost": node.heartbeat.is_lost,
                "boot_ups": node.boot_ups,
                "emergencies": {f"{code:04X}": count for code, count in node.emergencies.items()},
                "aborts": [
                    {"object": str(at), "code": f"{code:08X}", "count": count}
                    for (at, code), count in node.aborts.items()
                ],
            }
            for node in network.nodes.values()
        },
    }  # fmt: skip


def _clean(value: Any) -> Any:
    """JSON has no NaN and no infinity, and no control characters of others."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str):
        return printable(value, SENTENCE_LENGTH)
    if isinstance(value, dict):
        return {key: _clean(each) for key, each in value.items()}
    return [_clean(each) for each in value] if isinstance(value, list) else value
