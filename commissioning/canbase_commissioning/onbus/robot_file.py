"""Changes to robot.yaml on disk: the new file takes the place of the old one only when it is good."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from canbase_base.own_folder import replaced
from canbase_commissioning.edits import Edit, edited
from canbase_config.load import load_robot


def write_edits(config: Path, edits: Sequence[Edit]) -> None:
    """Writes `config` with these values; the old file stays beside it as `….before`.

    Raises OSError, ConfigError or KeyError, with `config` as it was.
    """
    text = config.read_text(encoding="utf-8")
    with replaced(config) as file:
        file.write(edited(text, edits).encode())
        file.flush()
        load_robot(file.name)
        with replaced(config.with_name(f"{config.name}.before")) as before:
            before.write(text.encode())
