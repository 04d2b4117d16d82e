"""What of a recording does not fit into an ASC file, as JSON: exact values, the configuration, the software. Pure.

One event a line, in the order of time. Its form is described in docs/ros_api.md, "The black box".
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

from canbase_driver.runtime.black_box import EventEntry, Recording
from canbase_driver.supervision.stop_history import StopRecord

FORMAT = 1
"""Grows when a reader of this form would misread a new one. A new event, or a new value in one, is no new form."""


def json_lines(recording: Recording, record: StopRecord, asc: str, about: Mapping[str, Any]) -> Iterator[str]:
    """The file, piece by piece; all of them together are one JSON object. `asc`: name of the file of the frames.

    Times are local monotonic seconds; `began_s` is the zero of the ASC file, `wall_offset_s` on top of any of them is
    the time since 1970.
    """
    head = {
        "format": FORMAT,
        "frames": asc,
        "stopped_by": record.stopped_by,
        "cause": record.cause,
        "detail": record.detail,
        "at_s": record.at_s,
        "began_s": recording.began_s,
        "wall_offset_s": recording.wall_offset_s,
        **about,
    }
    lead = "{\n"
    for name, value in head.items():
        yield f"{lead}{json.dumps(name)}: {_text(value)}"
        lead = ",\n"
    yield ',\n"events": ['
    lead = "\n"
    for event in recording.events:
        yield lead + _event(event)
        lead = ",\n"
    yield "\n]}\n"


def _event(event: EventEntry) -> str:
    at_s, what, values = event
    return _text({"at_s": at_s, "what": what, **values})


def _text(value: object) -> str:
    """JSON knows no infinity and no NaN: they are the texts that Python's float() takes."""
    try:
        return json.dumps(value, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(value), allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _finite(inner) for name, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(inner) for inner in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
