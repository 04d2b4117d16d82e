"""The keys of robot.yaml below `black_box`: what the driver writes down at each latched stop, and where."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from canbase_config.section import Section


class BlackBox(Section):
    """A file with the last CAN frames and commands for each latched stop."""

    folder: (
        Annotated[
            str,
            Field(
                min_length=1, max_length=1000, description="none: $STATE_DIRECTORY, else canbase/ in the state folder"
            ),
        ]
        | None
    ) = None
    seconds: Annotated[float, Field(ge=2.0, le=60.0, description="time recorded before the end of the stop [s]")] = 10.0
    files: Annotated[int, Field(ge=1, le=1000, description="number of files kept; then the oldest is deleted")] = 20
