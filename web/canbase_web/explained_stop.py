"""The page of `canbase explain` for the recordings of the page `Stops`: those that stop events name, no other file."""

from __future__ import annotations

import html
from collections.abc import Iterable
from pathlib import Path
from typing import Final
from urllib.parse import quote

from canbase_config.robot import Robot
from canbase_recording.explain_file import explain_file
from canbase_recording.recording_file import NoRecordingError

ADDRESS: Final = "/explained/{name}"
LARGEST_BYTES: Final = 20_000_000
"""A recording has 6 MB at most."""


def named(recordings: Iterable[str], name: str) -> Path | None:
    """The recording with this file name among those that stop events name; None: none of them is called so."""
    return next((Path(each) for each in recordings if each and Path(each).name == name), None)


def link(recording: str) -> str:
    """Where its page is; empty: there is no recording, or it is not on this computer."""
    return ADDRESS.format(name=quote(Path(recording).name)) if recording and Path(recording).is_file() else ""


def explained(path: Path, robot: Robot, config: str) -> tuple[int, str]:
    """Status and page. It takes a second or two."""
    try:
        from canbase_recording.explain_page import page
    except ModuleNotFoundError as error:
        return 503, _sentence(f"this page needs the Python package {error.name}: pip install 'plotly>=6,<8'")
    try:
        if path.suffix != ".asc" or not path.is_file() or path.stat().st_size > LARGEST_BYTES:
            return 404, _sentence(f"{path.name} is no recording of a stop")
        return 200, page(*explain_file(path, robot, config=config))
    except (OSError, NoRecordingError) as error:
        return 404, _sentence(f"{path.name} cannot be read: {error}")


def missing(name: str) -> str:
    """The page for a name that no stop event has."""
    return _sentence(f"no stop since the start of the page has a recording {name}")


def _sentence(text: str) -> str:
    said = html.escape(text)
    return f'<!doctype html><html lang="en"><title>Stop</title><p>{said}</p><a href="/stops">back</a></html>'
