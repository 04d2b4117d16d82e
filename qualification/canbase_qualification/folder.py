"""The folder of a qualification: what was run, on which robot, by which software, and its results.

qualification.json says what results.jsonl is about; robot.yaml is the file as it was. `--resume` compares them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter

from canbase_base.own_folder import replaced
from canbase_qualification.job import Amount, Load
from canbase_qualification.software import Software

NAME: Final = "qualification.json"
ROBOT: Final = "robot.yaml"
DIGITS: Final = 12
"""Of a hash, that people compare."""


class FolderError(ValueError):
    """The folder cannot be used: a sentence with its name, and what can be done."""


@dataclass(frozen=True, slots=True)
class About:
    """Of one qualification."""

    robot: str
    """Name in robot.yaml."""
    file: str
    """robot.yaml as it was named on the command line."""
    configuration_sha256: str
    """Of canbase_config.fingerprint."""
    software: Software
    load: Load
    amount: Amount
    full_mps: float
    """The speed from which the stops are measured."""
    assumed: tuple[str, ...]
    not_judged: tuple[str, ...]

    def text(self) -> str:
        """As JSON."""
        return f"{_ABOUT.dump_json(self, indent=2).decode()}\n"


_ABOUT: Final = TypeAdapter(About)


def read_about(folder: Path) -> About:
    """FolderError: there is none, or it cannot be read."""
    try:
        return _ABOUT.validate_json((folder / NAME).read_bytes())
    except FileNotFoundError as error:
        raise FolderError(f"{folder} has no {NAME}: it is no folder of canbase prove qualify") from error
    except (OSError, ValueError) as error:
        raise FolderError(f"{folder / NAME} cannot be read: {error}") from error


def check_new(folder: Path) -> None:
    """FolderError: something of a qualification is there already."""
    if (folder / NAME).exists():
        raise FolderError(f"{folder} has results already: --resume goes on with them, --output names another folder")


def check_same(folder: Path, before: About, now: About) -> None:
    """FolderError: results of both do not belong together."""
    if before.software != now.software:
        raise FolderError(
            f"{folder} was computed by {before.software}; this is {now.software}. Results of both do not belong "
            "together: go on with the same version, or begin again with another --output"
        )
    if before.load != now.load:
        raise FolderError(f"{folder} has {_words(before.load)}; now it is {_words(now.load)}. Choose another --output")
    check_robot(folder, before, now.file, now.configuration_sha256)


def check_robot(folder: Path, before: About, file: str, sha256: str) -> None:
    """FolderError: the results are about another configuration than that of `file`."""
    if before.configuration_sha256 != sha256:
        raise FolderError(
            f"{folder} is about another configuration: SHA-256 {before.configuration_sha256[:DIGITS]}…, and {file} has "
            f"{sha256[:DIGITS]}…. Compare it with {folder / ROBOT}, or choose another --output"
        )


def _words(load: Load) -> str:
    low, high = load.payloads
    return f"--payload {low:g}..{high:g} --slope {load.slope:g}"


def write(folder: Path, about: About, robot_yaml: bytes) -> None:
    """OSError. A crash leaves a whole file."""
    for name, data in ((ROBOT, robot_yaml), (NAME, about.text().encode())):
        with replaced(folder / name) as file:
            file.write(data)
